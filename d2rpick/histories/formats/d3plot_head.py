"""Read the header of an LS-DYNA d3plot or d3thdt: number format, state length, and parts."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import FormatError
from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.formats.d3plot_geometry import (
    WITH_RIGID_BODIES,
    Geometry,
    Titles,
)
from d2rpick.histories.formats.d3plot_words import (
    HEAD,
    Form,
    Words,
    count_dimensions,
    detect_form,
)
from d2rpick.histories.names import Part, clean_text

if TYPE_CHECKING:
    from collections.abc import Mapping

    from d2rpick.histories.content import Content

# Number of values of the whole model: kinetic, internal and total energy, and three velocity components.
GLOBALS: Final = 6

# Value that femzip writes in place of the number of parts.
_FEMZIP: Final = 76_893_465
# If the control word ``maxint`` is at most this value, a state lists deleted elements rather than deleted nodes.
_BY_ELEMENT: Final = -10_000
# First release whose states contain the position of each rigid wall next to its force.
_WITH_WALL_PLACES: Final = 971.0

# Number of thermal values per node, keyed by flag: temperatures of one or three layers, and the heat flux.
_THERMAL: Final = {0: 0, 1: 1, 2: 4, 3: 6}


class Head(NamedTuple):
    """The layout of the states of a family, as given in the header of the family's first file.

    The states begin at byte ``begin`` of this file; each has ``state`` bytes. In a state, ``globals`` words follow the
    time: the values of the model, ``part_values`` quantities of each part, and the forces of ``walls`` rigid walls.
    ``no_parts`` is the reason why there are no parts, if there are none.
    """

    form: Form
    title: str
    version: str
    begin: int
    state: int
    globals: int
    parts: tuple[Part, ...]
    part_values: int
    walls: int
    no_parts: str


def read_d3plot_head(content: Content, source: str) -> Head:
    """Read the header of the first file of a family.

    Raises
    ------
    FormatError
        If the file ends within its header, is packed by femzip, or has a section of unexpected length.
    """
    form = detect_form(content[:HEAD])
    if form is None:
        raise FormatError(
            f"{source}: this is not the first file of a d3plot or d3thdt; name the first file of the run"
        )
    words = Words(content, form, source)
    control = words.control()
    if control["nmmat"] == _FEMZIP:
        raise FormatError(
            f"{source}: this file is packed by femzip; unpack it, or name the glstat or binout of the run"
        )
    if control["nglbv"] < GLOBALS:
        problem = f"{source}: its states have {control['nglbv']} global values, but {GLOBALS} or more were expected"
        raise FormatError(f"{problem}; name the glstat or binout of the run")
    geometry = Geometry(words, control)
    geometry.pass_over()
    titles = Titles(words, geometry.at * form.width)
    titles.read()
    number = _count_parts(control)
    values, no_parts = _count_values_of_part(control["nglbv"], number, source)
    ids = _order_ids(geometry, titles, number) if values else ()
    if len({*ids}) < len(ids):
        raise words.damaged("the id of a part twice")
    parts = tuple(Part(id_, titles.of_parts.get(id_, "")) for id_ in ids)
    state = form.width * _count_words_of_state(control, geometry)
    if state < form.width * (1 + control["nglbv"]):
        raise words.damaged(
            f"states of {state} bytes, too few for the values of the model,"
        )
    return Head(
        form=form,
        title=clean_text(content[: 10 * form.width]) or titles.of_run,
        version=words.version(),
        begin=titles.at,
        state=state,
        globals=control["nglbv"],
        parts=parts,
        part_values=values,
        walls=_count_walls(control["nglbv"], len(parts), values, words),
        no_parts=no_parts,
    )


def _count_parts(control: Mapping[str, int]) -> int:
    """Return the number of parts. Older files contain a separate number for each element type."""
    return control["nmmat"] or sum(
        control[name] for name in ("nummat8", "nummat2", "nummat4", "nummatt", "ngpsph")
    )


def _order_ids(geometry: Geometry, titles: Titles, number: int) -> tuple[int, ...]:
    """Return the part ids in the order in which the part values are stored.

    If the parts are numbered consecutively, the file has no list of their ids; the titles contain the ids, too.
    """
    titled = tuple(titles.of_parts)
    lists = geometry.part_ids or (tuple(range(1, number + 1)),)
    if len(titled) == number and (titled in lists or not geometry.part_ids):
        return titled
    return lists[0]


def _count_values_of_part(values: int, number: int, source: str) -> tuple[int, str]:
    """Return the number of quantities per part (7, or fewer in older files); 0, with a reason, if it is unusable."""
    of_parts = values - GLOBALS
    if number == 0 or of_parts == 0:
        return (
            0,
            f"{source}: its states have no values of parts; give the matsum or binout of the run",
        )
    per_part = 7 if of_parts >= 7 * number else of_parts // number
    fits = of_parts >= 7 * number or of_parts % number == 0
    if not fits or per_part < 2:
        problem = f"{source}: its states have {of_parts} values for {number} parts, which cannot be told apart"
        return 0, f"{problem}; give the matsum or binout of the run for its parts"
    return per_part, ""


def _count_walls(values: int, parts: int, of_part: int, words: Words) -> int:
    """Return the number of rigid walls, whose forces follow the part values; 0 if the number is ambiguous.

    Releases with a name (R9 and later) are newer than 971, although the number in their files is 960.
    """
    of_walls = values - GLOBALS - parts * of_part
    is_new = words.is_named or words.release() >= _WITH_WALL_PLACES
    per_wall = 4 if is_new else 1
    return of_walls // per_wall if parts and of_walls % per_wall == 0 else 0


def _count_words_of_state(control: Mapping[str, int], geometry: Geometry) -> int:
    """Count the words of a state: time, global values, nodes, elements, deletions, SPH, airbags and roads."""
    solids = abs(control["nel8"])
    elements = (
        solids * (control["nv3d"] + control["nt3d"])
        + control["nelt"] * control["nv3dt"]
        + control["nel2"] * control["nv1d"]
        + (control["nel4"] - geometry.rigid_shells) * control["nv2d"]
    )
    words_of_body = 12 if control["ndim"] == max(WITH_RIGID_BODIES) else 24
    special = (
        control["nmsph"] * geometry.values_of_sph
        + geometry.airbag_values
        + 6 * geometry.roads
        + geometry.rigid_bodies * words_of_body
    )
    nodes = control["numnp"] * _count_words_of_node(control)
    return (
        1
        + control["nglbv"]
        + nodes
        + elements
        + _count_deletion_words(control)
        + special
    )


def _count_words_of_node(control: Mapping[str, int]) -> int:
    """Count the words per node in a state."""
    vectors = sum(control[name] != 0 for name in ("iu", "iv", "ia"))
    heat = control["it"] % 10
    scaled_mass = control["it"] // 10 % 10 == 1
    rates = control["idtdt"] % 10 == 1
    residuals = control["idtdt"] // 10 % 10 == 1
    contact = control["penout"] + (control["engout"] == 1)
    return (
        count_dimensions(control) * vectors
        + _THERMAL.get(heat, 0)
        + scaled_mass
        + rates
        + 6 * residuals
        + contact
    )


def _count_deletion_words(control: Mapping[str, int]) -> int:
    """Count the words that mark deleted elements or nodes in a state."""
    if control["maxint"] <= _BY_ELEMENT:
        return (
            abs(control["nel8"]) + control["nelt"] + control["nel4"] + control["nel2"]
        )
    return control["numnp"] if control["maxint"] < 0 else 0
