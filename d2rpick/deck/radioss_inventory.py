"""Read parts, elements, gravity, supports, prescribed motion and joints of a Radioss starter deck.

Columns: Altair's public help for the elements, properties and materials, /GRAV, /FUNCT, /BCS, /IMPVEL, /IMPDISP,
/IMPACC and /INTER/TYPE2, and the solver's published source.
"""

from __future__ import annotations

from math import inf
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.deck import formulations, model
from d2rpick.deck.expression import real
from d2rpick.deck.mesh import KINDS, NOT_COUNTED, Mesh, elements_of, nodes_of
from d2rpick.deck.model import Formulation, Inventory, Material, PartData, Section
from d2rpick.deck.radioss_deck import (
    SOLIDS,
    Starter,
    below_title,
    blocks,
    kept_off,
    keyword,
    number_of,
    reals,
    whole,
)
from d2rpick.deck.radioss_flaws import flaws_of
from d2rpick.deck.radioss_run import (
    Run,
    find_parts_of_fixed_bodies,
    find_run_windows,
    find_sensors_of_parts,
    left_rigid,
)
from d2rpick.deck.reader import cuts, holds_mesh
from d2rpick.deck.unswitchable import find_unswitchable_in_radioss

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from d2rpick.deck.card import Card, Row
    from d2rpick.deck.mesh import Integers
    from d2rpick.deck.switching import Window

_WIDTH, _REAL = 10, 20

# Laws whose lines begin with density, Young's modulus and Poisson's ratio.
_ELASTIC: Final = {
    *(
        "ELAST",
        "LAW1",
        "LAW01",
        "PLAS_JOHNS",
        "LAW2",
        "LAW02",
        "PLAS_ZERIL",
        "PLAS_BRIT",
        "LAW27",
        "PLAS_TAB",
        "LAW36",
    ),
    *("COWPER", "LAW44", "DAMA", "LAW22", "LAW22_DAMA"),
}
_VOID: Final = {"VOID", "LAW0", "LAW00"}
_AIRBAG: Final = {"FABRI", "FABR_A", "LAW19", "LAW58"}
# Properties with the thickness in the same columns.
_PLAIN_SHELLS: Final = {
    "SHELL",
    "TYPE1",
    "SH_ORTH",
    "TYPE9",
}
_SHELLS: Final = {*_PLAIN_SHELLS, "SH_COMP", "TYPE10", "SH_SANDW", "TYPE11", "SH_FABR", "TYPE16", "STACK", "TYPE17",
                  "TYPE51"}  # fmt: skip
_AREA_LINE: Final = {
    "BEAM": 2,
    "TYPE3": 2,
    "TRUSS": 0,
    "TYPE2": 0,
}  # line of the area below the title
_SPRING: Final = {"SPRING", "TYPE4"}
_OTHER_SPRINGS: Final = {"SPR_GENE", "TYPE8", "SPR_BEAM", "TYPE13", "SPR_PUL", "TYPE12", "SPR_AXI", "TYPE25", "KJOINT",
                         "TYPE33", "KJOINT2", "TYPE45"}  # fmt: skip
_OF_SPRINGS: Final = _SPRING | _OTHER_SPRINGS
_DEFAULT_SHELL, _DEFAULT_TRIANGLE, _DEFAULT_SOLID = 1, 2, 1

# Further keywords that connect parts; the connected parts are unknown.
_OTHER_TIES: Final = ("RBE2", "RBE3", "RLINK", "MPC")
_MOTIONS: Final = ("IMPVEL", "IMPDISP", "IMPACC")
_AXES: Final = "XYZ"
_TRANSLATIONS, _ROTATIONS = slice(3, 6), slice(7, 10)  # columns of the codes of /BCS


class _Property(NamedTuple):
    """A property as written: its type, its formulation flags for shells, triangles and solids, and its section."""

    type: str
    shell: int = 0
    triangle: int = 0
    solid: int = 0
    section: Section = Section()


def read(run: Run) -> Inventory:
    """Return the parts and elements of a run; empty with a note if it has no starter deck."""
    starter = run.starter
    if starter is None:
        return Inventory(
            "radioss",
            {},
            (),
            np.empty((0, 3)),
            ("no starter deck (NAME_0000.rad) was found",),
            False,
        )
    ids, coordinates = nodes_of(starter.named("NODE"))
    mesh = Mesh.of(
        [block for card in starter.named(*KINDS) for block in elements_of(card)],
        ids,
        coordinates,
    )
    notes = (*_notes(run, starter), *mesh.doubts(starter.parts.keys(), "/"))
    windows = find_run_windows(run).windows.windows if run.legs else ()
    joints = _joints(run, starter)
    # Without an engine file all bodies may be switched.
    switched = run.named if run.legs else {body.node.value for body in starter.bodies}
    rigid = _always_rigid(windows) | find_parts_of_fixed_bodies(run)
    return Inventory(
        "radioss", _parts(starter, mesh, rigid), mesh.elements, mesh.coordinates, notes,
        not notes, joints=model.placed(joints.found, mesh.table), switched=model.placed(joints.switched, mesh.table),
        ties=joints.unknown, watched=mesh.table.known(_watched(starter)),
        moved=starter.transformed, files=tuple(run.deck.sources),
        history_groups=frozenset(number_of(card, -1) for card in starter.named("THPART")),
        kept_off=kept_off(run.legs), flaws=flaws_of(run, switched),
        boundary=_boundary(run, starter).placed(mesh.table), left_rigid=left_rigid(run, windows),
    )  # fmt: skip


def _watched(starter: Starter) -> Integers:
    """Return the node ids of /TH/NODE; a title and a line of variables precede them."""
    rows = [
        row
        for card in starter.named("TH")
        if card.words[1:2] == ("NODE",)
        for row in below_title(card)
    ]
    ids = (row.text[:_WIDTH].strip() for row in rows)
    return np.unique(
        np.array(
            [int(text) for text in ids if text.isdecimal() and int(text)], np.int64
        )
    )


def _notes(run: Run, starter: Starter) -> Iterator[str]:
    """Yield notes on elements that may be missing."""
    yield from (
        f"{card.at}: elements of /{card.name} are not read"
        for card in starter.named(*NOT_COUNTED)
    )
    yield from (
        f"{block.source.name}: {sign}"
        for block, sign in cuts(run.deck)
        if holds_mesh(block)
    )
    yield from (
        f"{include.name.at}: {include.name.text} was not read: {include.reason}"
        for include in run.deck.unread
    )
    if starter.moved:
        yield "a //SUBMODEL may offset ids, which d2rpick does not evaluate"


def _parts(starter: Starter, mesh: Mesh, rigid: set[int]) -> Mapping[int, PartData]:
    """Return the data of all parts."""
    materials = dict(_materials(starter))
    properties = dict(_properties(starter))
    kinds = mesh.kinds
    unturned = starter.unturned
    unswitchable = find_unswitchable_in_radioss(starter)
    sensors = find_sensors_of_parts(starter)
    part_data: dict[int, PartData] = {}
    for part, line in starter.parts.items():
        section = _section(
            properties.get(line.prop),
            kinds.get(part, set()),
            turns=part not in unturned,
        )
        material = _material(
            materials.get(line.material), properties.get(line.prop), part in rigid
        )
        if part in sensors:
            by_sensor = f"the deck switches it by sensor {sensors[part]} already"
        else:
            by_sensor = ""
        reason = unswitchable[part].reason if part in unswitchable else by_sensor
        part_data[part] = PartData(part, line.title, material, section, reason)
    return part_data


def _material(
    written: Material | None, prop: _Property | None, rigid: bool
) -> Material | None:
    """Return the material of a part: springs have their stiffness in the property, and a rigid body is rigid."""
    if prop and prop.type in _OF_SPRINGS:
        return Material(f"PROP/{prop.type}", "spring")
    if written and rigid:
        return written._replace(kind="rigid")
    return written


def _always_rigid(windows: Sequence[Window]) -> set[int]:
    """Return the parts that are rigid from the start to the end; empty without an engine file."""
    return {
        window.unit.id
        for window in windows
        if not window.unit.is_body and window.tr == 0 and window.td is None
    }


def _materials(starter: Starter) -> Iterator[tuple[int, Material]]:
    """Yield id and material of each /MAT."""
    for card in starter.named("MAT"):
        if len(card.words) < 3:
            continue
        rows = [row.text for row in below_title(card)]
        law = card.words[1]
        is_elastic = law in _ELASTIC
        modulus, poisson = (
            _at(rows, 1, at) if is_elastic else None for at in (0, _REAL)
        )
        kind = "deformable"
        if law in _VOID:
            kind = "void"
        elif law in _AIRBAG:
            kind = "airbag"
        yield (
            number_of(card, 2),
            Material(f"MAT/{law}", kind, _at(rows, 0, 0), modulus, poisson),
        )


def _properties(starter: Starter) -> Iterator[tuple[int, _Property]]:
    """Yield id and property of each /PROP, with the defaults of /DEF_SHELL and /DEF_SOLID."""
    defaults = {
        card.words[0]: _flags(card, card.lines)
        for card in starter.named("DEF_SHELL", "DEF_SOLID")
    }
    shell, _, triangle = defaults.get("DEF_SHELL", [0, 0, 0])[:3]
    solid = defaults.get("DEF_SOLID", [0])[0]
    for card in starter.named("PROP"):
        if len(card.words) < 3:
            continue
        below = below_title(card)
        type_ = card.words[1]
        flags = _flags(card, below)
        rows = [row.text for row in below]
        shells = (
            flags[0] or shell or _DEFAULT_SHELL,
            flags[2] or triangle or _DEFAULT_TRIANGLE,
        )
        bricks = flags[0] or solid or _DEFAULT_SOLID
        prop = _Property(
            type_,
            *(shells if type_ in _SHELLS else (0, 0)),
            bricks if type_ in SOLIDS else 0,
        )
        yield number_of(card, 2), prop._replace(section=_section_of(type_, rows))


def _section_of(type_: str, rows: Sequence[str]) -> Section:
    """Read the thickness, area or spring constants from the lines of a property."""
    if type_ in _PLAIN_SHELLS:
        return _of_plain_shells(rows)
    if type_ in _AREA_LINE:
        return Section(area=_at(rows, _AREA_LINE[type_], 0))
    return _of_springs(rows) if type_ in _SPRING else Section()


def _section(prop: _Property | None, kinds: set[str], *, turns: bool) -> Section:
    """Return the section of a part with the formulations of its elements."""
    if prop is None:
        return Section(turns=turns)
    formulations_by_kind: dict[str, Formulation] = {}
    for kind in sorted(kinds):
        flags = (prop.shell, prop.triangle, prop.solid)
        needed = {"shell": flags[0], "triangle": flags[1]}.get(kind, 1)
        formulation = formulations.radioss(kind, *flags) if needed else None
        if formulation:
            formulations_by_kind[kind] = formulation
    return prop.section._replace(formulations=formulations_by_kind, turns=turns)


def _of_springs(rows: Sequence[str]) -> Section:
    """Read mass and stiffness of a spring; a function of the length replaces the constant stiffness."""
    linear = len(rows) < 3 or not rows[2][:_WIDTH].strip(" 0")
    return Section(
        damped=_at(rows, 1, _REAL) is not None,
        mass=_at(rows, 0, 0),
        stiffness=_at(rows, 1, 0) if linear else None,
    )


def _of_plain_shells(rows: Sequence[str]) -> Section:
    """Read thickness and integration points of a shell; 0 points mean global integration, which counts as one."""
    points = rows[2][:_WIDTH].strip() if len(rows) > 2 else None
    if points is None:
        layers = None
    else:
        layers = max(int(points) if points.isdecimal() else 0, 1)
    return Section(thickness=_at(rows, 2, 20), layers=layers)


def _flags(card: Card, rows: Sequence[Row]) -> list[int]:
    """Return the eight integers in the first line, of 10 columns each; 0 for other text."""
    return [card.integer(rows[0], at).value if rows else 0 for at in range(8)]


def _at(rows: Sequence[str], row: int, start: int) -> float | None:
    """Read a positive number in 20 columns, or None."""
    value = real(rows[row][start : start + _REAL]) if row < len(rows) else 0.0
    return value if value > 0 else None


def _boundary(run: Run, starter: Starter) -> model.Boundary:
    """Return supports, prescribed motion and gravity."""
    if starter.moved and starter.named("GRAV", "BCS", *_MOTIONS):
        return model.Boundary(
            notes=(
                "a //SUBMODEL may offset ids, so supports and gravity of the deck are unknown",
            )
        )
    holds = [*_holds(run, starter)]
    holds += [
        *_of_bodies(
            run, starter, [hold for hold in holds if isinstance(hold, model.Hold)]
        )
    ]
    return model.Boundary.of(holds, [*_gravity(starter)], whole=not run.deck.unread)


def _name(card: Card) -> str:
    """Return the keyword with its place."""
    return f"/{card.name} ({card.at})"


# Supports and imposed motion.


def _holds(run: Run, starter: Starter) -> Iterator[model.Hold | str]:
    """Yield the supports and prescribed motions, or notes on those that cannot be read."""
    engine = [source for source in run.deck.sources if source not in starter.sources]
    lifted = any(
        keyword(block)[:1] == ("BCSR",) for source in engine for block in blocks(source)
    )
    for card in starter.named("BCS", *_MOTIONS):
        words = card.words
        rows = below_title(card)
        if not rows:
            continue
        if words[0] == "BCS" and lifted:
            yield f"{_name(card)}: an engine file removes supports (/BCSR), which d2rpick does not evaluate"
        elif words[1:2] == ("FGEO",):
            group = frozenset({card.integer(rows[0], 1).value} - {0})
            nodes = model.ids({whole(row.text[:_WIDTH]) for row in rows[2:]} - {0})
            yield model.Hold(_name(card), nodes, group, counts=True)
        else:
            held = _support(card, rows) if words[0] == "BCS" else _motion(card, rows)
            members = starter.group_members(
                card.integer(rows[0], 2 if words[0] == "BCS" else 4).value
            )
            if members is None:
                yield f"{_name(card)}: the nodes of its group are unknown"
            elif held:
                yield held._replace(
                    nodes=model.ids(members[0]), parts=frozenset(members[1])
                )


def _support(card: Card, rows: Sequence[Row]) -> model.Hold | None:
    """Read a /BCS; along the axes of a skew it is always a support, unless it fixes all translations."""
    moves, turns = (rows[0].text[at].ljust(3) for at in (_TRANSLATIONS, _ROTATIONS))
    axes = frozenset(axis for axis, code in enumerate(moves) if code == "1")
    if not axes and "1" not in turns:
        return None
    skewed = bool(card.integer(rows[0], 1).value) and 0 < len(axes) < len(_AXES)
    return model.Hold(_name(card), model.ids(()), axes=axes, counts=skewed)


def _motion(card: Card, rows: Sequence[Row]) -> model.Hold:
    """Read a prescribed motion with its times; with a sensor or its own units it acts at all times."""
    timed = (
        len(rows) > 1 and not card.integer(rows[0], 3).value and not number_of(card, 2)
    )
    start, stop = reals(rows[1], 4)[2:] if timed else (0.0, 0.0)
    is_finite = np.isfinite([start, stop]).all()
    return model.Hold(
        _name(card),
        model.ids(()),
        counts=True,
        start=start if is_finite else 0.0,
        end=stop if is_finite and stop else inf,
    )


def _of_bodies(
    run: Run, starter: Starter, holds: Sequence[model.Hold]
) -> Iterator[model.Hold]:
    """Yield supports of all nodes of a rigid body that is on, for each support of its main node."""
    for body in starter.bodies:
        if body.sensor or body.node.value in run.named:
            members = None
        else:
            members = starter.group_members(body.group)
        for hold in holds if members else ():
            if members and body.node.value in hold.nodes:
                yield hold._replace(
                    nodes=model.ids(members[0]), parts=frozenset(members[1])
                )


# Gravity.


def _gravity(starter: Starter) -> Iterator[model.Gravity | str]:
    """Yield the gravity loads, or notes on those that cannot be read."""
    loads = [card for card in starter.named("GRAV") if below_title(card)]
    functions = dict(_functions(starter)) if loads else {}
    units = next(
        (card.rows[2:4] for card in starter.named("BEGIN") if len(card.words) == 1), ()
    )
    converted = (
        len(units) > 1
        and units[0].text.split() != units[1].text.split()
        and units[1].text.strip() != ""
    )
    for card in loads:
        if converted or number_of(card, 2):
            load = None
        else:
            load = _of_card(card, starter, functions)
        yield (
            load
            or f"{_name(card)} cannot be read, so gravity is found from the run alone"
        )


def _of_card(
    card: Card, starter: Starter, functions: Mapping[int, tuple[float, ...]]
) -> model.Gravity | None:
    """Read values and nodes of a /GRAV; None if they are unknown. Before its sensor is active it is 0."""
    row = below_title(card)[0]
    function, skew, sensor, group = (card.integer(row, at).value for at in (0, 2, 3, 4))
    scale = reals(row, 5)[4] or 1.0
    if function:
        values = model.plateaus(functions.get(function, ()), scale)
    else:
        values = (scale,)
    members = starter.group_members(group) if group else (set[int](), set[int]())
    direction = row.text[_WIDTH : 2 * _WIDTH].strip().upper() or "Z"
    if (
        not values
        or not np.isfinite(values).all()
        or members is None
        or direction not in _AXES
    ):
        return None
    axis = None if skew else _AXES.index(direction)
    values = (0.0, *values) if sensor else values
    if group:
        return model.Gravity(axis, values, model.ids(members[0]), frozenset(members[1]))
    return model.Gravity(axis, values)


def _functions(starter: Starter) -> Iterator[tuple[int, tuple[float, ...]]]:
    """Yield id and ordinates of each function; empty for a function that the deck scales."""
    moved = {number_of(card) for card in starter.named("MOVE_FUNCT") if card.words[1:]}
    for card in starter.named("FUNCT"):
        number = number_of(card)
        yield (
            number,
            ()
            if number in moved
            else tuple(reals(row, 2)[1] for row in below_title(card)),
        )


# Joints connect parts that share no nodes: ties, and rigid bodies that are always on.  While a part is rigid, they must
# be off, as a node cannot obey two of them (Altair's help on incompatible kinematic conditions).


def _joints(run: Run, starter: Starter) -> model.Joints:
    """Return the tied interfaces (/INTER/TYPE2) whose main surface is one part, and the rigid bodies.

    A rigid body that no engine file and no sensor switches is always on, and connects the parts of its nodes. Without
    engine files all bodies may be switched.
    """
    of_parts = (
        card
        for card in starter.named("SURF")
        if card.words[1:2] == ("PART",) and card.words[2:]
    )
    surfaces = {number_of(card, -1): card for card in of_parts}
    joints = list[model.Joint]()
    switched = list[model.Joint]()
    unknown = list[str]()
    for card in starter.named("INTER", *_OTHER_TIES):
        interface = card.words[:2] == ("INTER", "TYPE2")
        tie = _of_interface(card, starter, surfaces) if interface else None
        if tie:
            joints.append(tie)
        elif interface or card.words[0] != "INTER":
            unknown.append(_name(card))
    for body in starter.bodies:
        always_on = (
            bool(run.legs) and not body.sensor and body.node.value not in run.named
        )
        members = starter.group_members(body.group)
        if members:
            joint = model.Joint(
                "rigid body",
                model.ids(members[0] | {body.node.value}),
                frozenset(members[1]),
            )
            (joints if always_on else switched).append(joint)
        elif always_on:
            unknown.append(f"/RBODY/{body.id} ({body.card.at})")
    return model.Joints(tuple(joints), tuple(unknown), tuple(switched))


def _of_interface(
    card: Card, starter: Starter, surfaces: dict[int, Card]
) -> model.Joint | None:
    """Return the joint of a tied interface; None if its nodes or its main part are unknown."""
    rows = below_title(card)
    if rows:
        group, surface = (card.integer(rows[0], at).value for at in range(2))
    else:
        group, surface = (0, 0)
    members = starter.group_members(group)
    main = frozenset(_listed(surfaces[surface]) if surface in surfaces else ())
    if members is None or len(main) != 1:
        return None
    return model.Joint(
        "tied interface", model.ids(members[0]), frozenset(members[1]) | main
    )


def _listed(card: Card) -> Iterator[int]:
    """Yield the ids below the title of a surface."""
    for row in below_title(card):
        yield from (
            value for at in range(10) if (value := card.integer(row, at).value) > 0
        )
