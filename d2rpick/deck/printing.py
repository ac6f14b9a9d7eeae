"""Print rigid windows as solver input: one function per solver, and a table of the solvers.

For LS-DYNA, there is a pair of *DEFORMABLE_TO_RIGID_AUTOMATIC cards for each window. For Radioss, there are engine
files that end at the switching times, with /RBODY/ON and /RBODY/OFF, or time sensors that switch within one engine run.
"""

from __future__ import annotations

import math
import re
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Final

from d2rpick.base import __version__
from d2rpick.base.errors import DeckError, name_units
from d2rpick.deck import printed_card
from d2rpick.deck.engine_files import (
    CAP_SHARE,
    choose_step_cap,
    plan_legs,
    write_bodies_off,
    write_engine_lines,
    write_step_limit,
)
from d2rpick.deck.part_sets import PartSets, number_sets, write_part_set
from d2rpick.deck.printed_card import (
    LONGEST,
    PHYSICS,
    CardSolver,
    PrintedCard,
    check_ids,
    write_comments,
    write_number,
)
from d2rpick.deck.radioss_columns import (
    RUN,
)
from d2rpick.deck.switch_sets import (
    Waiting,
    group_by_lead,
    write_joint_remarks,
    write_set_pair,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from d2rpick.base.spans import Times
    from d2rpick.deck.contact_timing import Pushes
    from d2rpick.deck.printed_card import Printing

_FILE: Final = "switches.k"

# For each kind of contact, the CODE for a switch when its force ends, and that for a switch when its force acts.
_CODES: Final = {"INTER": (2, 4), "RWALL": (1, 3)}
_OF_OFFSET: Final = "OFFSET was not tested with the solver: it should exceed the thickness of the contact."
_LEFT_ACTIVE = (
    "Nodal rigid bodies, spotwelds and rigid walls on these parts stay active. If",
    "  each of these bodies and spotwelds lies only on switched parts, set NRBF and",
    "  NCSF to 1 (delete) on the first card and to 2 (activate) on the second. The",
    "  window must end before the parts touch a rigid wall (RWF 0).",
)
_FAILED_JOINTS = (
    "Merged parts stay one rigid body even if the welds or ties that connect them",
    "  have failed before the first switch: look for such failures in the reference",
    "  run, and keep parts that came loose deformable.",
)
_NODAL_BODIES_DELETED = (
    "Nodal rigid bodies and generalized welds of the deck, which all lie on these",
    "  parts, are deleted (NRBF 1) while these are rigid, and activated again (2).",
)
_NODE_SETS_DELETED = (
    "Joints, extra nodes, spotwelds and other nodal constraints of the deck, which",
    "  all lie on these parts, are deleted (NCSF 1) while these are rigid, and",
    "  activated again (2).",
)
_SEPARATE = (
    "CHECK BEFORE USE: each part becomes a rigid body of its own (LRB 0). This is",
    "  wrong for parts that share nodes, and nothing shows here whether they do.",
    "  Merge parts that share nodes (--merge), or give a deck in which d2rpick can",
    "  read all elements of these parts (--deck). Do not merge loose parts.",
)
_RUN_NAME = re.compile(r"[\w.-]+", re.ASCII)
_OF_RADIOSS = (
    "Ids are main nodes of /RBODY, not bodies; an unknown one is skipped silently.",
    "Gravity and damping act on a rigid body only if its main node is in their",
    "  node groups; no warning is given.",
    "The energy reported for rigid solids can be wrong until the release.",
    "The starter looks for /RBODY/OFF in the engine files; keep all of them.",
    "A body that the first file does not deactivate is rigid from time 0.",
    "The starter takes the nodes of an /RBODY from every /RWALL; Ikrem 1 keeps",
    "  them there while the body is inactive.",
    "Define initial velocities for the main node of a body too.",
    "Repeat your output keywords (/TFILE, /ANIM, ...) in every file.",
)
_BY_FORCE = (
    "The windows are those of the history: a switched run lands elsewhere, and at",
    "  other times, after its first window that freezes vibration energy.",
    "They end in the first step of a contact, without a margin before it.",
)
_OF_SENSORS = tuple(
    line
    for line in _OF_RADIOSS[1:-1]
    if not line.startswith(("The starter looks", "A body that"))
)
# Solver that is assumed if the format of a history does not identify one.
DEFAULT: Final = "ls-dyna"


def _print_ls_dyna(
    windows: Sequence[Times], printing: Printing, remarks: Sequence[str] = ()
) -> PrintedCard:
    """Print two unpaired CODE 0 sets per window, with times of at most 9 characters.

    Raises
    ------
    DeckError
        If windows overlap or are not in order, as given or as printed, or an id does not fit.
    """
    windows = printed_card.refuse_overlapping_windows(windows)
    ids = check_ids(printing.part)
    sets = list(_number_switch_sets(printing.swset, len(windows)))
    if printing.merge is not None:
        # The lead id follows another id on the same line, after a space.
        check_ids([printing.merge], LONGEST)
    texts = [(write_number(tr), write_number(td)) for tr, td in windows]
    _check_printed([text for pair in texts for text in pair])
    notes = tuple(
        note
        for times, pair in zip(windows, texts, strict=True)
        for note in _note_roundings(times, pair)
    )
    # The verdict comes first.
    comment_lines = (*write_comments(remarks), *notes, *_write_warnings(ids, printing))
    spans = ", ".join(f"{float(tr):.6g} to {float(td):.6g}" for tr, td in texts)
    lines = [
        *write_comments([f"Rigid from {spans}; written by d2rpick {__version__}"]),
        *comment_lines,
    ]
    lines = [f"$ {line}" for line in lines]
    part_sets = number_sets(
        (ids, *group_by_lead(ids, printing).values()), printing.swset[0]
    )
    for members, number in part_sets.items():
        lines += write_part_set(members, number)
    for pair, numbers in zip(texts, sets, strict=True):
        lines += _write_window(pair, numbers, ids, printing, part_sets)
    text = "\n".join(lines) + "\n"
    return PrintedCard(
        text,
        tuple((float(tr), float(td)) for tr, td in texts),
        {_FILE: text},
        (*notes, *_note_other_lead(ids, printing.merge)),
    )


def _write_window(
    texts: tuple[str, str],
    sets: tuple[int, int],
    ids: Sequence[int],
    printing: Printing,
    part_sets: PartSets,
) -> Iterator[str]:
    """Yield the lines of the two switch sets for one window."""
    cap = printing.step_cap or choose_step_cap(*map(float, texts))
    yield from write_set_pair(sets, texts, write_number(cap), ids, printing, part_sets)


def _print_ls_dyna_contact(
    windows: Sequence[Times], printing: Printing, remarks: Sequence[str] = ()
) -> PrintedCard:
    """Print a pair of sets that switch by the force of a contact (CODE 2 and 4) or a rigid wall (CODE 1 and 3).

    The windows of the card are those in which the pair makes the parts rigid according to the history.

    Raises
    ------
    DeckError
        In the cases of `_print_ls_dyna`, and if no TIME3 gives as many windows as planned.
    """
    # Imported here to keep start-up fast.
    from d2rpick.deck.contact_timing import find_pair_timing

    windows = printed_card.refuse_overlapping_windows(windows)
    ids = check_ids(printing.part)
    kind, number, pushes = _find_force(printing)
    free, forced = _CODES[kind]
    timing = find_pair_timing(windows, pushes)
    part_sets = number_sets(
        (ids, *group_by_lead(ids, printing).values()), printing.swset[0]
    )
    cap = printing.step_cap or min(choose_step_cap(*times) for times in timing.windows)
    waits = Waiting(free, number, latest=timing.latest)
    returns = Waiting(forced, number, timing.wait, offset=timing.offset)
    spans = ", ".join(f"{tr:.6g} to {td:.6g}" for tr, td in timing.windows)
    comment_lines = (
        *write_comments(
            [f"Rigid from {spans} in the history; written by d2rpick {__version__}"]
        ),
    )
    comment_lines += (
        *write_comments(remarks),
        *_write_warnings(ids, printing),
        *_BY_FORCE[:2],
        _OF_OFFSET,
    )
    lines = [f"$ {line}" for line in comment_lines]
    for members, name in part_sets.items():
        lines += write_part_set(members, name)
    lines += write_set_pair(
        printing.swset,
        (write_number(timing.earliest), "0.0"),
        write_number(cap),
        ids,
        printing,
        part_sets,
        (waits, returns),
    )
    text = "\n".join(lines) + "\n"
    return PrintedCard(text, timing.windows, {_FILE: text})


def _number_switch_sets(
    first: tuple[int, int], count: int
) -> Iterator[tuple[int, int]]:
    """Yield the ids of the two switch sets for each window; all ids are different."""
    if first[0] == first[1]:
        raise DeckError(f"both switch sets have id {first[0]}; give two different ids")
    above = max(first) + 1
    check_ids([*first, above + 2 * count])
    yield first
    yield from ((above + 2 * i, above + 2 * i + 1) for i in range(count - 1))


def _check_printed(texts: Sequence[str]) -> None:
    """Raise DeckError unless each printed time is later than the previous time."""
    for text, next_text in pairwise(texts):
        if float(text) >= float(next_text):
            problem = f"two switching times are both {text} in {LONGEST} characters"
            raise DeckError(f"{problem}; give different times")


def _note_roundings(times: Times, texts: tuple[str, str]) -> Iterator[str]:
    """Yield a note for each time that a card cannot represent with the six digits shown in all answers."""
    for name, value, text in zip(("tr", "td"), times, texts, strict=True):
        if f"{float(text):.6g}" != f"{value:.6g}":
            yield f"{name} = {value:.6g} is rounded to {text}, the nearest number in {LONGEST} characters."


def _note_other_lead(ids: Sequence[int], lead: int | None) -> tuple[str, ...]:
    """Return a note if the lead part is none of the switched parts, so that no card makes it rigid."""
    if lead is None or lead in ids:
        return ()
    return (
        (
            f"the lead part {lead} of `merge` is not among the switched {name_units(ids)}: it must be rigid in the "
            f"deck already; otherwise give one of the switched parts, such as {ids[0]}"
        ),
    )


def _write_warnings(ids: Sequence[int], printing: Printing) -> Iterator[str]:
    """Yield the comment lines of an LS-DYNA card."""
    deleted = (
        *(_NODAL_BODIES_DELETED if printing.delete_nodal_bodies else ()),
        *(_NODE_SETS_DELETED if printing.delete_node_sets else ()),
    )
    yield from (
        *write_comments([*write_joint_remarks(printing)]),
        *PHYSICS,
        *(deleted or _LEFT_ACTIVE),
        "Springs and dampers are not switched.",
        *write_comments([_explain_step_limit(printing)]),
    )
    if printing.merge is None and printing.bodies:
        yield from (
            f"{len(body)} parts are one rigid body in the deck, with lead part {body[0]} (LRB)."
            for body in printing.bodies
            if len(body) > 1
        )
        if any(len(body) > 1 for body in printing.bodies):
            yield from _FAILED_JOINTS
    elif printing.merge is None and len(ids) > 1:
        yield from _SEPARATE
    elif printing.merge is not None and printing.merge not in ids:
        yield f"Part {printing.merge} is the lead: it must be rigid already."


def _explain_step_limit(printing: Printing) -> str:
    """Return the origin of the time-step limit on the cards, and the reason for it."""
    if printing.step_cap is None:
        source = f"1/{CAP_SHARE} of the rigid time (--step-cap sets another limit)"
    else:
        source = "the given --step-cap"
    return f"DTMAX is {source}: without it, the time step grows if no deformable part is left."


def _print_radioss(
    windows: Sequence[Times], printing: Printing, remarks: Sequence[str] = ()
) -> PrintedCard:
    """Print engine files: one engine run up to each switch, and one up to the end of the run.

    The main nodes are those of /RBODY in the starter deck, for bodies without sensor. If no limit is given, the time
    step is at most 1/1000 of the rigid window while the bodies are rigid.

    Raises
    ------
    DeckError
        If windows overlap or are not in order, an id does not fit, or the run does not end after the last window.
    """
    windows, ids, end = _check_run(windows, printing)
    files = {
        f"{printing.name}_{leg.number:04d}.rad": "\n".join(
            write_engine_lines(leg, printing.name, ids, printing.off)
        )
        + "\n"
        for leg in plan_legs(windows, end, printing.step_cap)
    }
    return _combine_card(windows, printing, (*remarks, *_OF_RADIOSS), files)


def _print_radioss_sensors(
    windows: Sequence[Times], printing: Printing, remarks: Sequence[str] = ()
) -> PrintedCard:
    """Print time sensors that switch the bodies with these main nodes, and one engine file for the whole run.

    The time-step limit applies to the whole run, so it is the smallest limit of all windows.

    Raises
    ------
    DeckError
        In the cases of `_print_radioss`.
    """
    # Imported here to keep start-up fast.
    from d2rpick.deck.radioss_sensors import invert_spans

    windows, _, _ = _check_run(windows, printing)
    return _print_sensors(
        windows,
        printing,
        _write_sensors(invert_spans(windows), printing.sensor),
        remarks,
    )


def _print_radioss_contact(
    windows: Sequence[Times], printing: Printing, remarks: Sequence[str] = ()
) -> PrintedCard:
    """Print a force sensor of a contact or rigid wall that makes the bodies deformable during contacts.

    The windows of the card are those in which the sensor makes the parts rigid according to the history.

    Raises
    ------
    DeckError
        In the cases of `_print_radioss`, and if no Tdelay gives as many windows as planned.
    """
    from d2rpick.deck.contact_timing import find_sensor_timing

    windows, _, _ = _check_run(windows, printing)
    kind, number, pushes = _find_force(printing)
    timing = find_sensor_timing(windows, pushes)
    spans = [(0.0, timing.earliest)] * (timing.earliest > 0) + [
        (timing.latest, math.inf)
    ]
    explanation = (
        f"Deformable while /{kind} {number} has a force and {timing.wait:.6g} longer (Tdelay).",
        *_BY_FORCE,
    )
    force = (kind, number, timing.wait)
    sensors = _write_sensors(spans, printing.sensor, force)
    return _print_sensors(timing.windows, printing, sensors, (*remarks, *explanation))


def _find_force(printing: Printing) -> tuple[str, int, Pushes]:
    """Return the kind, id and contact times of the contact or wall whose force switches the bodies.

    Raises
    ------
    DeckError
        If not exactly one contact or wall is given, or if the history does not show when its force acts.
    """
    from d2rpick.deck.contact_timing import Pushes

    if (printing.contact is None) == (printing.wall is None):
        raise DeckError(
            "a card for switches by force needs one `contact`, or one rigid `wall`, by its id"
        )
    if not printing.pushed:
        raise DeckError(
            "a card for switches by force needs a history with the force of that contact or wall, or with momenta of"
            " the parts"
        )
    pushes = Pushes(printing.pushed, printing.speed)
    if printing.contact is not None:
        return "INTER", printing.contact, pushes
    return "RWALL", printing.wall or 0, pushes


def _print_sensors(
    windows: Sequence[Times],
    printing: Printing,
    sensors: tuple[str, int],
    remarks: Sequence[str],
) -> PrintedCard:
    """Print sensors that switch the bodies, and one engine file for the whole run."""
    from d2rpick.deck.radioss_sensors import STOPS_SINCE

    texts, last = sensors
    ids = check_ids(printing.node)
    end = printing.end or 0.0
    cap = min(
        leg.cap
        for leg in plan_legs(windows, end, printing.step_cap)
        if leg.cap is not None
    )
    fewest_cycles = round(end / cap)
    step_warning = (
        f"The largest step, {cap:.4g}, holds for the whole run, which takes {fewest_cycles} cycles at least;"
        " if it takes fewer without switching, set --step-cap to at least the deformable time step."
    )
    # The note is also written to the file, because the file may be used without the card.
    comments = [f"# {line}" for line in write_comments([step_warning])]
    lines = (
        f"/RUN/{printing.name}/1",
        RUN.write(Tstop=end),
        *write_bodies_off(printing.off),
        *comments,
        *write_step_limit(cap),
    )
    files = {f"{printing.name}_0001.rad": "\n".join(lines) + "\n"}
    nodes = ", ".join(map(str, ids))
    instructions = (
        f"Each /RBODY with main node {nodes} takes sensor {last}: sens_ID, columns 11 to 20 below its title.",
        f"/BEGIN needs version {STOPS_SINCE} or later: earlier versions have no Tstop of sensors.",
    )
    card = _combine_card(
        tuple(windows),
        printing,
        (*remarks, *_OF_SENSORS, *instructions),
        files,
        texts,
    )
    return replace(
        card,
        sensors=dict.fromkeys(ids, last),
        notes=(*card.notes, step_warning),
        fewest_cycles=fewest_cycles,
    )


def _write_sensors(
    spans: Sequence[Times], first: int, force: tuple[str, int, float] | None = None
) -> tuple[str, int]:
    """Return the text of sensors with ids from ``first`` on, and the id of the sensor that combines them all.

    The combining sensor is active in each of ``spans``, and while a ``force`` acts, which is described by the arguments
    of `write_force_sensor`.
    """
    from d2rpick.deck.sensor_cards import (
        write_any_of,
        write_force_sensor,
        write_time_sensor,
    )

    texts = [
        write_time_sensor(number, "deformable", start, stop)
        for number, (start, stop) in enumerate(spans, start=first)
    ]
    if force:
        texts.append(write_force_sensor(first + len(spans), *force))
    combined, last = write_any_of(range(first, first + len(texts)), "deformable")
    return "".join([*texts, combined]), last


def _check_run(
    windows: Sequence[Times], printing: Printing
) -> tuple[tuple[Times, ...], list[int], float]:
    """Return the windows, the main nodes and the end of a run.

    Raises
    ------
    DeckError
        If a window, a main node, the name or the end is missing or wrong.
    """
    windows = printed_card.refuse_overlapping_windows(windows)
    ids = check_ids(printing.node)
    if not _RUN_NAME.fullmatch(printing.name):
        raise DeckError(
            f"the name of the run is {printing.name!r} (expected letters, digits, '.', '_' and '-')"
        )
    if printing.end is None or not windows[-1][1] < printing.end < math.inf:
        if printing.end is None:
            problem = "the end of the run is not given"
        else:
            problem = f"the run ends at {printing.end:g}"
        raise DeckError(
            f"{problem}, but a time after td = {windows[-1][1]:g} was expected; give it as `end`"
        )
    return windows, ids, printing.end


def _combine_card(
    windows: tuple[Times, ...],
    printing: Printing,
    remarks: Sequence[str],
    files: Mapping[str, str],
    further_cards: str = "",
) -> PrintedCard:
    """Combine comments, cards for the starter deck and engine files into a card."""
    spans = ", ".join(f"{tr:.6g} to {td:.6g}" for tr, td in windows)
    head = write_comments(
        [f"Rigid from {spans}; written by d2rpick {__version__}", *remarks, *PHYSICS]
    )
    text = "".join(f"# {line}\n" for line in head)
    starter = printing.starter + further_cards
    text += (
        f"# ---- into {printing.name}_0000.rad, before /END\n{starter}"
        if starter
        else ""
    )
    text += "".join(f"# ---- {file}\n{content}" for file, content in files.items())
    return PrintedCard(text, windows, files, starter=starter)


SOLVERS: Final[Mapping[str, CardSolver]] = {
    "ls-dyna": CardSolver(
        "LS-DYNA",
        ("glstat", "matsum", "binout"),
        "part",
        ("merge", "swset", "step_cap"),
        _print_ls_dyna,
    ),
    "radioss": CardSolver(
        "Radioss", ("radioss-th",), "node", ("step_cap", "end", "name"), _print_radioss
    ),
    "radioss-sensors": CardSolver(
        "Radioss", (), "node", ("step_cap", "end", "name"), _print_radioss_sensors
    ),
    "ls-dyna-contact": CardSolver(
        "LS-DYNA",
        (),
        "part",
        ("merge", "swset", "step_cap", "contact", "wall"),
        _print_ls_dyna_contact,
    ),
    "radioss-contact": CardSolver(
        "Radioss",
        (),
        "node",
        ("step_cap", "end", "name", "contact", "wall"),
        _print_radioss_contact,
    ),
}


def names_solver(history_format: str) -> bool:
    """Return True if a format of a history belongs to a solver; a table may come from any of them.

    Examples
    --------
    >>> names_solver("glstat + matsum"), names_solver("csv")
    (True, False)
    """
    formats = set(history_format.split(" + "))
    return any(formats & {*solver.histories} for solver in SOLVERS.values())


def find_solver(history_format: str) -> str:
    """Return the solver that wrote a history in this format; several formats are joined by ``+``.

    Examples
    --------
    >>> find_solver("radioss-th"), find_solver("glstat + matsum"), find_solver("csv")
    ('radioss', 'ls-dyna', 'ls-dyna')
    """
    formats = set(history_format.split(" + "))
    return next(
        (name for name, solver in SOLVERS.items() if formats & {*solver.histories}),
        DEFAULT,
    )


def print_cards(
    windows: Sequence[Times],
    printing: Printing,
    remarks: Sequence[str] = (),
) -> PrintedCard:
    """Print the card for rigid windows.

    Parameters
    ----------
    windows : sequence of (float, float)
        tr and td of each window [time of the model] with 0 <= tr < td, in ascending order.
    printing : Printing
        Solver, parts or bodies to switch, and further options.
    remarks : sequence of str
        Further comment lines.

    Raises
    ------
    DeckError
        If windows overlap or are not in order, or an option does not fit the solver's input.

    Examples
    --------
    >>> from d2rpick.deck.printed_card import Printing
    >>> card = print_cards([(0.02, 0.09), (0.2, 0.3)], Printing(part=(11,)))
    >>> card.windows
    ((0.02, 0.09), (0.2, 0.3))
    """
    return SOLVERS[printing.solver or DEFAULT].cards(windows, printing, remarks)
