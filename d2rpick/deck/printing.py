"""Switching windows as solver input: one function per solver, one table of solvers.

LS-DYNA: a pair of *DEFORMABLE_TO_RIGID_AUTOMATIC cards for each window.  Radioss: engine files whose legs end at the
switching times, with /RBODY/ON and /RBODY/OFF, or sensors of times that switch in one run.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.base import __version__
from d2rpick.base.errors import DeckError
from d2rpick.deck import printed_card
from d2rpick.deck.printed_card import LONGEST, PHYSICS, PrintedCard, Solver, check_ids, comments, shortest

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from d2rpick.deck.printed_card import Printing, Times

_FILE: Final = "switches.k"

_SET_HEAD = "$#   swset      code     time1     time2     time3     entno     relsw    paired"
_COUNT_HEAD = "$#    nrbf      ncsf       rwf     dtmax       d2r       r2d    offset"
_OF_LS_DYNA = (
    "Nodal rigid bodies, spotwelds and rigid walls on these parts stay active",
    "  (NRBF, NCSF, RWF 0); where they are, delete them (1) and activate again (2).",
    "Springs and dampers are not switched.",
)
_CAPPED = "DTMAX: with nothing deformable left the time step would grow without limit."
# Parts that are listed one by one; of more a set is printed, here with its number.
_MOST_LISTED: Final = 10
PartSets = Mapping[tuple[int, ...], int]
_NO_SETS: Final[PartSets] = {}
# Of the rigid window, per step: the release is at most a thousandth of it late.  Each window has its own, so that
# further windows leave the run up to them as it was.
_CAP_SHARE = 1000


def _ls_dyna(windows: Sequence[Times], printing: Printing, remarks: Sequence[str] = ()) -> PrintedCard:
    """Print two unpaired CODE 0 sets for each window, their times in at most 9 characters.

    Raises
    ------
    DeckError
        If windows do not follow each other, as given or as printed, or an id does not fit.
    """
    windows, ids = printed_card.check_windows(windows), check_ids(printing.part)
    sets = list(_sets(printing.swset, len(windows)))
    if printing.merge is not None:
        check_ids([printing.merge], LONGEST)  # stands right of an id, with a blank between them
    texts = [(shortest(tr), shortest(td)) for tr, td in windows]
    _check_printed([text for pair in texts for text in pair])
    notes = tuple(note for times, pair in zip(windows, texts, strict=True) for note in _roundings(times, pair))
    told = (*notes, *_warnings(ids, printing), *comments(remarks))
    spans = ", ".join(f"{tr} to {td}" for tr, td in texts)
    lines = [*comments([f"Rigid from {spans}; written by d2rpick {__version__}"]), *told]
    lines = [f"$ {line}" for line in lines]
    part_sets = _part_sets((ids, *_groups(ids, printing).values()), printing.swset[0])
    for members, number in part_sets.items():
        lines += _part_set(members, number)
    for pair, numbers in zip(texts, sets, strict=True):
        lines += _window(pair, numbers, ids, printing, part_sets)
    text = "\n".join(lines) + "\n"
    return PrintedCard(text, tuple((float(tr), float(td)) for tr, td in texts), {_FILE: text}, notes)


def _window(
    texts: tuple[str, str], sets: tuple[int, int], ids: Sequence[int], printing: Printing, part_sets: PartSets
) -> Iterator[str]:
    rigid, free = [*to_rigid(ids, printing, part_sets)], [*to_deformable(ids, part_sets)]  # with a comment each
    cap = printing.step_cap or _step_cap(*map(float, texts))
    yield from (*header(sets[0], texts[0], shortest(cap), (len(rigid) - 1, 0)), *rigid)
    yield from (*header(sets[1], texts[1], "0.0", (0, len(free) - 1)), *free)


def to_rigid(ids: Sequence[int], printing: Printing, part_sets: PartSets = _NO_SETS) -> Iterator[str]:
    """Write the parts that become rigid, those that lead first, or the sets that they make up."""
    yield "$#     pid       lrb     ptype"
    for lead, some in _groups(ids, printing).items():
        yield from (f"{name:10d}{lead:10d}{kind:>10}" for name, kind in _named(some, part_sets))


def to_deformable(ids: Sequence[int], part_sets: PartSets = _NO_SETS) -> Iterator[str]:
    """Write the parts that become deformable, or their set."""
    yield "$#     pid     ptype"
    yield from (f"{name:10d}{kind:>10}" for name, kind in _named(ids, part_sets))


def _step_cap(tr: float, td: float) -> float:
    """Largest step while rigid [time]."""
    return float(f"{(td - tr) / _CAP_SHARE:.2g}")


def _named(parts: Sequence[int], part_sets: PartSets) -> list[tuple[int, str]]:
    """Name parts with their kind: by their set where there is one."""
    number = part_sets.get(tuple(sorted(parts)))
    return [(part, "PART") for part in parts] if number is None else [(number, "PSET")]


def _part_sets(groups: Iterable[Sequence[int]], first: int) -> dict[tuple[int, ...], int]:
    """Number a set for each of the groups that are too many to be listed."""
    many = dict.fromkeys(tuple(sorted(group)) for group in groups if len(group) > _MOST_LISTED)
    return {group: first + place for place, group in enumerate(many)}


def _part_set(parts: Sequence[int], number: int) -> Iterator[str]:
    yield f"$ Part set {number}: give it another id where the deck has one of that."
    yield from ("*SET_PART_LIST", "$#     sid", f"{number:10d}")
    yield "$#    pid1      pid2      pid3      pid4      pid5      pid6      pid7      pid8"
    yield from ("".join(f"{part:10d}" for part in parts[i : i + 8]) for i in range(0, len(parts), 8))


def _groups(ids: Sequence[int], printing: Printing) -> dict[int, list[int]]:
    """Give the parts by their lead, those without one first, under 0."""
    leads = _leads(ids, printing)
    found: dict[int, list[int]] = {}
    for part in sorted(ids, key=lambda part: part in leads):
        found.setdefault(leads.get(part, 0), []).append(part)
    return found


def _leads(ids: Sequence[int], printing: Printing) -> dict[int, int]:
    """Give the lead of each part that is merged into another."""
    if printing.merge is not None:
        return {part: printing.merge for part in ids if part != printing.merge}
    bodies = [[part for part in body if part in ids] for body in printing.bodies]
    return {part: body[0] for body in bodies for part in body[1:]}


class Waiting(NamedTuple):
    """What a switch waits for: its CODE, the contact, the delay after it [time], the set of its pair, and its place.

    ``offset`` is how far from each other the surfaces of the contact are when it switches back [length].
    """

    code: int = 0
    contact: int = 0
    delay: float = 0.0
    other: int = 0
    paired: int = 0
    offset: float = 0.0


def header(
    swset: int, time: str, step_cap: str, counts: tuple[int, int], waits: Waiting | None = None
) -> Iterator[str]:
    """Write the lines of a switch set down to its parts: at a ``time``, or from then on where it waits."""
    on = waits or Waiting()
    yield "*DEFORMABLE_TO_RIGID_AUTOMATIC"
    yield _SET_HEAD
    yield (
        f"{swset:10d}{on.code:10d}{time:>10s}{'0.0':>10s}{shortest(on.delay):>10s}"
        f"{on.contact:10d}{on.other:10d}{on.paired:10d}"
    )
    yield _COUNT_HEAD
    yield f"{0:10d}{0:10d}{0:10d}{step_cap:>10s}{counts[0]:10d}{counts[1]:10d}{shortest(on.offset):>10s}"


def _sets(first: tuple[int, int], count: int) -> Iterator[tuple[int, int]]:
    """Ids of the switch sets of each window, all different."""
    if first[0] == first[1]:
        raise DeckError(f"both switch sets are {first[0]}, two different ids were expected")
    above = max(first) + 1
    check_ids([*first, above + 2 * count])
    yield first
    yield from ((above + 2 * i, above + 2 * i + 1) for i in range(count - 1))


def _check_printed(texts: Sequence[str]) -> None:
    for one, other in pairwise(texts):
        if float(one) >= float(other):
            found = f"two switching times are both {one} in {LONGEST} characters"
            raise DeckError(f"{found}, different times were expected")


def _roundings(asked: Times, texts: tuple[str, str]) -> Iterator[str]:
    for name, value, text in zip(("tr", "td"), asked, texts, strict=True):
        if float(text) != value:
            off = f"{float(text) - value:+.1e} off {value!r}"
            yield f"{name} is printed as {text}, {off}: nearest in {LONGEST} characters."


def _warnings(ids: Sequence[int], printing: Printing) -> Iterator[str]:
    yield from (*PHYSICS, *_OF_LS_DYNA)
    yield _CAPPED
    if printing.merge is None and printing.bodies:
        yield from (
            f"{len(body)} parts are one rigid body by the deck, led by part {body[0]} (LRB)."
            for body in printing.bodies
            if len(body) > 1
        )
    elif printing.merge is None and len(ids) > 1:
        yield "Merge parts that share nodes (d2rpick card --merge), never loose ones."
    elif printing.merge is not None and printing.merge not in ids:
        yield f"Part {printing.merge} is the lead: it must be rigid already."


_RUN_NAME = re.compile(r"[\w.-]+", re.ASCII)
_NODES_PER_LINE = 10
_MOST_LEGS = 99  # the solver numbers them with two digits where it matters, in the names of time histories
_OF_RADIOSS = (
    "Ids are main nodes of /RBODY, not bodies; an unknown one is skipped silently.",
    "Gravity and damping act on a rigid body only if its main node is in their",
    "  node groups; no warning is given.",
    "The energy reported for rigid solids can be wrong until the release.",
    "The starter looks for /RBODY/OFF in the engine files; keep all of them.",
    "A body that the first file does not put off is rigid from time 0.",
    "The starter takes the nodes of an /RBODY from every /RWALL; Ikrem 1 keeps",
    "  them there while the body is off.",
    "An initial velocity must move the main node of a body too.",
    "Repeat your output keywords (/TFILE, /ANIM, ...) in every file.",
)
_OF_SENSORS = tuple(line for line in _OF_RADIOSS[1:-1] if not line.startswith(("The starter looks", "A body that")))


class EngineFile(NamedTuple):
    """An engine run: its number, its end, and its largest step where the bodies are rigid in it, else None."""

    number: int
    stop: float
    cap: float | None


def _radioss(windows: Sequence[Times], printing: Printing, remarks: Sequence[str] = ()) -> PrintedCard:
    """Print the engine files, a leg up to each switch and one to the end.

    The main nodes are those of /RBODY in the starter file, of bodies without sensor.  Without a cap the step is
    held below a thousandth of the rigid window while the bodies are rigid.

    Raises
    ------
    DeckError
        If windows do not follow each other, an id does not fit, or the run does not end after the last window.
    """
    windows, ids, end = _of_run(windows, printing)
    files = {
        f"{printing.name}_{leg.number:04d}.rad": "\n".join(engine_lines(leg, printing.name, ids, printing.off)) + "\n"
        for leg in legs(windows, end, printing.step_cap)
    }
    return _told(windows, printing, (*_OF_RADIOSS, *remarks), files)


def _radioss_sensors(windows: Sequence[Times], printing: Printing, remarks: Sequence[str] = ()) -> PrintedCard:
    """Print sensors of times that switch the bodies with these main nodes, and one engine file for the whole run.

    The largest step holds for the whole run, so that it is the least of those that the windows ask for.

    Raises
    ------
    DeckError
        As `_radioss` does.
    """
    from d2rpick.deck.radioss_deck import STOPS_SINCE  # not above: other cards do without

    windows, ids, end = _of_run(windows, printing)
    sensors, last = _sensors(windows, printing.sensor)
    cap = min(leg.cap for leg in legs(windows, end, printing.step_cap) if leg.cap is not None)
    lines = (f"/RUN/{printing.name}/1", f"{end!r:>20}", *off(printing.off), *capped(cap))
    files = {f"{printing.name}_0001.rad": "\n".join(lines) + "\n"}
    nodes = ", ".join(map(str, ids))
    how = (
        f"Each /RBODY with main node {nodes} takes sensor {last}: sens_ID, columns 11 to 20 below its title.",
        f"/BEGIN needs version {STOPS_SINCE} or later, which knows when a sensor of time stops.",
    )
    slow = (
        f"The largest step, {cap:.4g}, holds for the whole run, which takes {end / cap:.0f} cycles at least;"
        " where it takes fewer without switching, set --step-cap to the deformable step or more."
    )
    told = _told(windows, printing, (*_OF_SENSORS, *how, slow, *remarks), files, sensors)
    return replace(told, sensors=dict.fromkeys(ids, last), notes=(*told.notes, slow))


def _sensors(windows: Sequence[Times], first: int) -> tuple[str, int]:
    """Write sensors with ids from ``first`` on, and give the id of the one that is active outside of the windows."""
    from d2rpick.deck.radioss_deck import NEVER, inactive

    spans = inactive(tuple(windows))
    texts, last = list[str](), first
    for number, (start, stop) in enumerate(spans, start=first):
        until = min(stop, NEVER)
        texts.append(f"/SENSOR/TIME/{number}\ndeformable\n{shortest(start, 20):>20}\n{shortest(until, 20):>20}\n")
    for number, other in enumerate(range(first + 1, first + len(spans)), start=first + len(spans)):
        texts.append(f"/SENSOR/OR/{number}\ndeformable\n{0:20d}\n{last:10d}{other:10d}\n")
        last = number
    return "".join(texts), last


def _of_run(windows: Sequence[Times], printing: Printing) -> tuple[tuple[Times, ...], list[int], float]:
    """Return the windows, main nodes and end of a run; DeckError where they do not make one."""
    windows, ids = printed_card.check_windows(windows), check_ids(printing.node)
    if not _RUN_NAME.fullmatch(printing.name):
        raise DeckError(f"the name of the run is {printing.name!r}, letters, digits, '.', '_' and '-' were expected")
    if printing.end is None or not windows[-1][1] < printing.end < math.inf:
        found = "the end of the run is not given" if printing.end is None else f"the run ends at {printing.end:g}"
        raise DeckError(f"{found}, a time after td = {windows[-1][1]:g} was expected")
    return windows, ids, printing.end


def _told(
    windows: tuple[Times, ...], printing: Printing, remarks: Sequence[str], files: Mapping[str, str], more: str = ""
) -> PrintedCard:
    """Put comments, cards for the starter deck and engine files together."""
    spans = ", ".join(f"{tr!r} to {td!r}" for tr, td in windows)
    head = comments([f"Rigid from {spans}; written by d2rpick {__version__}", *PHYSICS, *remarks])
    text, starter = "".join(f"# {line}\n" for line in head), printing.starter + more
    text += f"# ---- into {printing.name}_0000.rad, before /END\n{starter}" if starter else ""
    text += "".join(f"# ---- {file}\n{content}" for file, content in files.items())
    return PrintedCard(text, windows, files, starter=starter)


def legs(windows: Sequence[Times], end: float, step_cap: float | None) -> list[EngineFile]:
    """Give the engine runs that the windows ask for; a window from 0 on needs none before it."""
    caps = [step_cap or _step_cap(tr, td) for tr, td in windows]
    switches = zip(windows, caps, strict=True)
    stops = [(time, cap) for (tr, td), own in switches for time, cap in ((tr, None), (td, own)) if time > 0]
    if len(stops) >= _MOST_LEGS:
        raise DeckError(f"{len(windows)} windows need {len(stops) + 1} engine runs, at most {_MOST_LEGS} were expected")
    numbered = enumerate([*stops, (end, None)], start=1)
    return [EngineFile(number, stop, cap) for number, (stop, cap) in numbered]


def off(nodes: Sequence[int]) -> Iterator[str]:
    """Put rigid bodies off; the starter of OpenRadioss overlooks a second such block right behind the first."""
    if nodes:
        yield from ("/RBODY/OFF", *listed(nodes))


def listed(ids: Sequence[int]) -> Iterator[str]:
    """Write numbers in lines."""
    yield from (" ".join(map(str, ids[i : i + _NODES_PER_LINE])) for i in range(0, len(ids), _NODES_PER_LINE))


def engine_lines(leg: EngineFile, name: str, ids: Sequence[int], others: Sequence[int]) -> Iterator[str]:
    """Write what an engine file says of a leg: its run, and which main nodes are rigid; ``others`` stay off."""
    yield f"/RUN/{name}/{leg.number}"
    yield f"{leg.stop!r:>20}"
    if leg.cap is not None and ids:
        yield from ("/RBODY/ON", *listed(ids))
    yield from off(others if leg.cap is not None else (*ids, *others))
    if leg.cap is not None:
        yield from capped(leg.cap)


def capped(cap: float) -> Iterator[str]:
    """Hold the step of a leg with rigid bodies below a limit."""
    yield from ("# with nothing deformable left the step would grow without limit", "/DTIX", f"{cap!r} {cap!r}")


SOLVERS: Final[Mapping[str, Solver]] = {
    "ls-dyna": Solver("LS-DYNA", ("glstat", "matsum", "binout"), "part", ("merge", "swset", "step_cap"), _ls_dyna),
    "radioss": Solver("Radioss", ("radioss-th",), "node", ("step_cap", "end", "name"), _radioss),
    "radioss-sensors": Solver("Radioss", (), "node", ("step_cap", "end", "name"), _radioss_sensors),
}
DEFAULT: Final = "ls-dyna"  # of histories that name no solver


def solver_of(history_format: str) -> str:
    """Name the solver that wrote a history of this format (several are joined by ``+``).

    Examples
    --------
    >>> solver_of("radioss-th"), solver_of("glstat + matsum"), solver_of("csv")
    ('radioss', 'ls-dyna', 'ls-dyna')
    """
    formats = set(history_format.split(" + "))
    return next((name for name, solver in SOLVERS.items() if formats & {*solver.histories}), DEFAULT)


def cards(
    windows: Sequence[Times], printing: Printing, solver: str = DEFAULT, remarks: Sequence[str] = ()
) -> PrintedCard:
    """Print the cards of windows.

    Parameters
    ----------
    windows : sequence of (float, float)
        tr and td of each [time of the model], 0 <= tr < td, each after the one before.
    printing : Printing
        Whom the card switches, and what else it says.
    solver : str
        A key of `SOLVERS`.
    remarks : sequence of str
        Further comment lines.

    Raises
    ------
    DeckError
        If windows do not follow each other, or the solver's input cannot say what is asked for.

    Examples
    --------
    >>> from d2rpick.deck.printed_card import Printing
    >>> card = cards([(0.02, 0.09), (0.2, 0.3)], Printing(part=(11,)))
    >>> card.windows
    ((0.02, 0.09), (0.2, 0.3))
    """
    return SOLVERS[solver].cards(windows, printing, remarks)
