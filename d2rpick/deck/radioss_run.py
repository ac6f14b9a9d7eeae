"""Read when the engine runs or time sensors of a Radioss run make each part rigid, and which parts stay rigid.

Source: Altair's public help for /RBODY in engine files, according to which bodies are active by default in the first
run, and keep their state in later runs unless an engine file changes it.
"""

from __future__ import annotations

import math
import os
import re
from dataclasses import field
from itertools import pairwise
from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.base.caching import cached_property
from d2rpick.base.data_classes import dataclass
from d2rpick.base.errors import DeckError, choose_verb, format_ranges, name_units
from d2rpick.deck.card import CardField, Value
from d2rpick.deck.not_decks import (
    refuse_binary_history,
    refuse_packed,
    refuse_text_history,
)
from d2rpick.deck.radioss_columns import UNITS
from d2rpick.deck.radioss_deck import (
    RadiossLeg,
    Starter,
    find_bodies_kept_off,
    make_card,
    read_blocks,
    read_legs,
    split_keyword,
)
from d2rpick.deck.radioss_files import ENGINE, HEAD, STARTER, is_radioss, list_run_files
from d2rpick.deck.radioss_sensors import (
    Course,
    find_active_spans,
    has_only_one_force,
    invert_spans,
)
from d2rpick.deck.reader import Deck, Unread, explain_unread
from d2rpick.deck.source import SourceFile
from d2rpick.deck.switching import (
    Switched,
    SwitchEvent,
    SwitchSet,
    SwitchWindow,
    Unit,
    Windows,
    follow_unit,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator, Mapping, Sequence

    from d2rpick.base.spans import Spans
    from d2rpick.deck.card import Card
    from d2rpick.deck.radioss_rigid import Body
    from d2rpick.deck.radioss_sensors import Forces

    Contacts = Callable[[Collection[int]], Spans | None]
# Number of lines in /BEGIN: the run name, the version, and two lines of units.
_LINES_OF_BEGIN: Final = 4


@dataclass(eq=False, repr=False)
class RadiossRun:
    """A Radioss run: its starter deck (if there is one), and its engine runs in order of their numbers.

    ``deck`` contains the list of its files.
    """

    deck: Deck
    starter: Starter | None = None
    legs: list[RadiossLeg] = field(default_factory=list)
    # Include files by path, so that a file that is included twice is read only once.
    included: dict[str, SourceFile] = field(default_factory=dict)

    @cached_property
    def named(self) -> frozenset[int]:
        """Return the main nodes of the bodies switched by the engine runs."""
        main_nodes: set[int] = set()
        for leg in self.legs:
            for _, _, nodes in leg.switched:
                main_nodes.update(node.value for node in nodes)
        return frozenset(main_nodes)

    @cached_property
    def resets(self) -> Mapping[int, float]:
        """Return, by sensor id, the time of the first reset (/SENS/RESET) at the start of an engine run [time]."""
        first_resets: dict[int, float] = {}
        start = 0.0
        for leg in self.legs:
            for sensor in leg.resets:
                first_resets.setdefault(sensor, start)
            start = leg.stop.value
        return first_resets

    @property
    def pushed(self) -> bool:
        """Return True if the run has rigid walls or initial velocities that may affect its bodies."""
        return bool(self.starter and self.starter.named("RWALL", "INIVEL")) or any(
            leg.starts for leg in self.legs
        )


def read_run(path: str, content: bytes | None = None) -> RadiossRun:
    """Read a run from its files, or from ``content``.

    Raises
    ------
    DeckError
        If a file cannot be read, or is neither a starter deck nor an engine file.
    """
    run = RadiossRun(Deck(path))
    files = list_run_files(path) if content is None else []
    for name in files or [path]:
        source = SourceFile(name, content)
        head = source.read(0, HEAD)
        if not is_radioss(head):
            refuse_packed(name, head)
            refuse_binary_history(name, head)
            is_ls_dyna = re.search(rb"(?im)^\*KEYWORD", head) is not None
            found = (
                "this is an LS-DYNA deck"
                if is_ls_dyna
                else "no /BEGIN or /RUN was found"
            )
            if not is_ls_dyna:
                refuse_text_history(name, head)
            cure = "; for LS-DYNA see d2rpick first" if is_ls_dyna else ""
            raise DeckError(
                f"{name}: {found}, but a file of a Radioss run was expected{cure}"
            )
        run.deck.sources.append(source)
        if re.search(ENGINE, head):
            run.legs += read_legs(source)
        if re.search(STARTER, head):
            run.starter = run.starter or Starter()
            _read_starter(source, run, ())
        else:
            run.deck.ends += [
                (block, False) for block in read_blocks(source) if block.end is None
            ]
    run.legs.sort(key=lambda leg: leg.number)
    run.deck.cards += [leg.run for leg in run.legs]
    run.deck.cards += [card for leg in run.legs for card, _, _ in leg.switched]
    return run


def _read_starter(source: SourceFile, run: RadiossRun, chain: tuple[str, ...]) -> None:
    """Add a file of the starter deck and the files that it includes."""
    if run.starter is None:
        return
    run.starter.sources.append(source)
    for block in read_blocks(source):
        words = split_keyword(block)
        if block.end is None:
            run.deck.ends.append((block, not chain))
        if not words:
            _read_include(make_card(block), source, run, chain)
        else:
            run.starter.blocks.append(block)
            if words[0] == "RBODY":
                run.deck.cards.append(make_card(block))


def _read_include(
    card: Card, source: SourceFile, run: RadiossRun, chain: tuple[str, ...]
) -> None:
    """Add the file that an #include names, or record why it was not read."""
    from pathlib import Path  # Imported here to keep start-up fast.

    words = card.block.head.split(maxsplit=1)[1:]
    name = words[0].strip() if words else ""
    folders = (Path(source.name).parent, Path(run.deck.path).parent)
    paths = (str(folder / name) for folder in folders)
    candidates = (path for path in paths if os.path.isfile(path))  # noqa: PTH113  Path.is_file fails on names that are too long
    path, chain = next(candidates, None), (*chain, os.path.realpath(source.name))
    if reason := explain_unread(path, chain):
        run.deck.unread.append(Unread(card.here._replace(text=name), reason))
    elif path is not None:
        if path not in run.included:
            run.included[path] = SourceFile(path)
        run.deck.sources.append(run.included[path])
        _read_starter(run.included[path], run, chain)


@dataclass(eq=False, repr=False)
class LegSwitch(SwitchSet):
    """Bodies that an engine run switches when it begins, at the time ``at``; ``stop_field`` contains this time."""

    at: float = 0.0
    stop_field: CardField | None = None

    @cached_property
    def time(self) -> float | None:
        """Return the switching time [time of the run]."""
        return self.at

    @property
    def time_field(self) -> CardField:
        """Return the field with the end of the previous engine run; for the first engine run, return the keyword."""
        return self.stop_field or self.card.here


@dataclass(eq=False, repr=False)
class RunWindows:
    """Rigid windows of a run, the cards that cause them, and the parts of the bodies (if known) by main node."""

    windows: Windows
    sets: tuple[LegSwitch, ...]
    parts: dict[int, set[int]] = field(default_factory=dict)


def is_in_order(legs: list[RadiossLeg]) -> bool:
    """Return True if the engine runs are numbered without gaps and each ends at a known time.

    No engine run may end before the previous one.
    """
    if any(leg.sensor for leg in legs[:-1]):
        return False
    numbers = [leg.number for leg in legs]
    stops = [leg.stop for leg in legs]
    sorted_stops = all(
        stop.value <= next_stop.value for stop, next_stop in pairwise(stops)
    )
    return (
        numbers == list(range(1, len(legs) + 1))
        and sorted_stops
        and not any(stop.problem for stop in stops)
    )


def find_run_windows(
    run: RadiossRun, contacts: Contacts | None = None, forces: Forces | None = None
) -> RunWindows:
    """Return the windows of every body that an engine run or a sensor switches.

    A body with unknown parts is one unit, identified by its main node. If the engine runs are not in order, there are
    no windows. For force sensors, ``contacts`` returns the spans in which a contact force acts on given parts, and
    ``forces`` the spans in which an interface or wall exerts a force; both return None if no history shows them.
    """
    sets = tuple(_list_switches(run.legs)) if is_in_order(run.legs) else ()
    starter = None if run.starter and run.starter.moved else run.starter
    bodies = {body.node.value: body for body in starter.bodies} if starter else {}
    lines = [line.part for leg_switch in sets for line in leg_switch.switched]
    switched = {part.value for part in lines if part.value and not part.problem}
    # Bodies with a sensor are unaffected by /RBODY/ON and /RBODY/OFF.
    sensors = {node for node, body in bodies.items() if body.sensor}
    groups = {
        node: bodies[node].group for node in (*switched, *sensors) if node in bodies
    }
    parts = find_rigid_parts(starter, groups) if starter and groups else {}
    windows: list[SwitchWindow] = []
    for node in sorted(switched):
        if not bodies or (node in bodies and not bodies[node].sensor):
            for unit in _list_units(node, parts):
                windows += _follow_body(unit, node, sets, run.legs[0])
    for node in sorted(sensors):
        windows += _follow_sensor(
            run,
            bodies[node],
            parts,
            find_course(run, parts.get(node, ()), contacts, forces),
        )
    for body in bodies.values():
        if body.part and not body.sensor and body.node.value not in switched:
            windows.append(_make_window_of_rigid_part(body))
    windows.sort(key=lambda window: (window.unit, window.tr))
    events = tuple(
        event for window in windows for event in (window.opened, window.closed) if event
    )
    return RunWindows(
        Windows(tuple(windows), (), events, frozenset(), frozenset()), sets, parts
    )


def _list_switches(legs: list[RadiossLeg]) -> Iterator[LegSwitch]:
    """Yield the cards that switch bodies in all engine runs, with their times."""
    previous: RadiossLeg | None = None
    for leg in legs:
        if previous:
            time, stop_field = (previous.stop.value, previous.stop.field)
        else:
            time, stop_field = (0.0, None)
        for card, rigid, nodes in leg.switched:
            lines = tuple(Switched(node, False, rigid) for node in nodes)
            yield LegSwitch(
                card, "plain", None, lines, nodes, at=time, stop_field=stop_field
            )
        previous = leg


def _list_units(node: int, parts: dict[int, set[int]]) -> list[Unit]:
    """Return the units that a body switches: its parts, or the body itself if its parts are unknown."""
    return [Unit(part) for part in sorted(parts.get(node, ()))] or [
        Unit(node, is_body=True)
    ]


def _follow_body(
    unit: Unit, node: int, sets: tuple[LegSwitch, ...], first: RadiossLeg
) -> list[SwitchWindow]:
    """Return the windows of a part of a body, which is rigid from the start unless it is deactivated at time 0."""
    start = LegSwitch(first.run, "plain", None, (), ())
    events = [
        (
            0.0,
            SwitchEvent(
                unit, start, Switched(Value(node, first.run.here), False, True)
            ),
        )
    ]
    for leg_switch in sets:
        for line in [line for line in leg_switch.switched if line.part.value == node][
            :1
        ]:
            if (
                leg_switch.at == events[-1][0] == 0
                and line.to_rigid
                and events[-1][1].line.to_rigid
            ):
                events.pop()  # An /RBODY/ON at time 0 repeats the default.
            events.append((leg_switch.at or 0.0, SwitchEvent(unit, leg_switch, line)))
    return [
        window
        for window in follow_unit(unit, events)[0]
        if window.td is None or window.td > 0
    ]


def find_course(
    run: RadiossRun,
    parts: Collection[int],
    contacts: Contacts | None,
    forces: Forces | None = None,
) -> Course:
    """Return the data of a run that determine when the sensors of its bodies are active."""
    has_contacts = (
        contacts is not None
        and parts
        and run.starter is not None
        and has_only_one_force(run.starter)
    )
    spans = contacts(parts) if has_contacts and contacts else None
    return Course(run.resets, spans, forces)


def _follow_sensor(
    run: RadiossRun, body: Body, parts: dict[int, set[int]], course: Course
) -> Iterator[SwitchWindow]:
    """Yield the windows of a body with a sensor; such a body is rigid while its sensor is inactive."""
    active = find_active_spans(run.starter, body.sensor, course) if run.starter else ""
    if isinstance(active, str):
        return
    end = run.legs[-1].stop.value if run.legs and is_in_order(run.legs) else math.inf
    spans = [
        (start, stop if stop < end else math.inf)
        for start, stop in invert_spans(active)
        if start < end
    ]
    for unit in _list_units(body.node.value, parts):
        for span in spans:
            opened, closed = (
                SwitchEvent(
                    unit,
                    LegSwitch(body.card, "plain", None, (), (), at=at),
                    Switched(body.node, False, rigid),
                )
                for at, rigid in zip(span, (True, False), strict=True)
            )
            ends = span[1] < math.inf
            yield SwitchWindow(
                unit,
                span[0],
                span[1] if ends else None,
                opened,
                closed if ends else None,
            )


def _make_window_of_rigid_part(body: Body) -> SwitchWindow:
    """Return the window of a part that the starter makes rigid (Irigid) and nothing switches."""
    unit = Unit(body.part)
    by = LegSwitch(body.card, "plain", None, (), ())
    return SwitchWindow(
        unit, 0.0, None, SwitchEvent(unit, by, Switched(body.node, False, True)), None
    )


def find_rigid_parts(
    starter: Starter, bodies: Mapping[int, int]
) -> dict[int, set[int]]:
    """Return the parts of each rigid body: those that its group names, and those whose nodes all belong to the group.

    Parameters
    ----------
    starter : Starter
        The starter deck.
    bodies : mapping
        Node groups keyed by main node.

    Returns
    -------
    dict
        Parts keyed by main node; there are none if the members of the group are unknown.
    """
    members = {node: starter.group_members(group) for node, group in bodies.items()}
    known_members = {node: found for node, found in members.items() if found}
    whole_parts = {
        node: {*known_members[node][1]} if node in known_members else set()
        for node in bodies
    }
    all_parts = starter.parts.keys()
    # A body also contains parts whose nodes all belong to its named parts, e.g. a skin.
    incomplete = {
        node: found for node, found in known_members.items() if all_parts - found[1]
    }
    if incomplete:
        # Imported here to keep start-up fast.
        from d2rpick.deck.mesh import find_parts_within

        for node, parts in find_parts_within(starter, incomplete).items():
            whole_parts[node] |= parts
    return whole_parts


def find_time_units(run: RadiossRun) -> tuple[str, str]:
    """Return the time units that /BEGIN gives for the starter deck and the computation; empty if there are none."""
    cards = run.starter.named("BEGIN") if run.starter else ()
    rows = next((card.rows for card in cards), ())
    if len(rows) < _LINES_OF_BEGIN:
        return "", ""
    of_deck, of_run = (
        UNITS["Time"].cut(row.text).strip().lower().replace("mus", "us")
        for row in rows[2:_LINES_OF_BEGIN]
    )
    return of_deck, of_run


def find_parts_off(run: RadiossRun) -> tuple[int, ...]:
    """Return the parts of the bodies that the first engine run deactivates; empty if there is no starter deck."""
    nodes = find_bodies_kept_off(run.legs[:1])
    bodies = run.starter.bodies if run.starter else ()
    groups = {
        body.node.value: body.group for body in bodies if body.node.value in nodes
    }
    held = find_rigid_parts(run.starter, groups) if run.starter and groups else {}
    return tuple(sorted(set().union(*held.values())))


def find_parts_of_fixed_bodies(run: RadiossRun) -> set[int]:
    """Return the parts of the bodies that are always active because no engine run and no sensor switches them.

    If there are no engine files, all bodies of /RBODY may be switched, but bodies of parts with Irigid stay rigid.
    """
    bodies = run.starter.bodies if run.starter and not run.starter.moved else ()
    fixed = [
        body for body in bodies
        if not body.sensor and body.node.value not in run.named and (run.legs or body.part)
    ]  # fmt: skip
    if run.starter and fixed:
        held = find_rigid_parts(
            run.starter, {body.node.value: body.group for body in fixed}
        )
    else:
        held = {}
    return set().union(*held.values())


def find_sensors_of_parts(starter: Starter) -> dict[int, int]:
    """Return the sensor that switches the rigid body of each part, keyed by part id."""
    sensors = {
        body.node.value: body
        for body in starter.bodies
        if body.sensor and not starter.moved
    }
    if sensors:
        held = find_rigid_parts(
            starter, {node: body.group for node, body in sensors.items()}
        )
    else:
        held = {}
    return {
        part: sensors[node].sensor for node, parts in held.items() for part in parts
    }


class LeftRigid(NamedTuple):
    """Parts that stay rigid in a run that switches other parts, with the line to change, the problem and the remedy."""

    parts: tuple[int, ...]
    place: CardField
    found: str
    way_out: str


def find_left_rigid(
    run: RadiossRun, windows: Sequence[SwitchWindow]
) -> LeftRigid | None:
    """Return the bodies with complete parts that no engine run names although the run has rigid ``windows``.

    The result is None if there are no such bodies.
    """
    if run.starter is None or run.starter.moved or not windows:
        return None
    bodies = [
        body
        for body in run.starter.bodies
        if not body.sensor and body.node.value not in run.named
    ]
    if bodies:
        parts = find_rigid_parts(
            run.starter, {body.node.value: body.group for body in bodies}
        )
    else:
        parts = {}
    bodies = [body for body in bodies if parts.get(body.node.value)]
    rigid_parts_listed = sorted(
        {part for body in bodies for part in parts[body.node.value]}
    )
    if not rigid_parts_listed:
        return None
    switch_fields = [card.here for card, _, _ in run.legs[0].switched]
    mains = format_ranges(body.node.value for body in bodies)
    rigid = f"{name_units(rigid_parts_listed)} {choose_verb(rigid_parts_listed)} rigid"
    problem = f"no engine file switches {_list_body_names(bodies)}, so {rigid} from time 0 to the end"
    cure = f"list main node{'s' * (len(bodies) > 1)} {', '.join(mains)} in the /RBODY/OFF of every engine file"
    if new_nodes := [
        body.node.value for body in bodies if body.node.field.text in ("", "0")
    ]:
        cure += f" (the starter makes {name_units(new_nodes, 'node')}: see its listing)"
    return LeftRigid(
        tuple(rigid_parts_listed),
        switch_fields[0] if switch_fields else run.legs[0].run.here,
        problem,
        cure,
    )


def _list_body_names(bodies: Sequence[Body]) -> str:
    """Return the names of bodies with their ids, or the part id of a rigid part."""
    ids = [body.id for body in bodies if body.id]
    parts = sorted(body.part for body in bodies if body.part)
    names = [f"/RBODY {', '.join(format_ranges(ids))}"] * bool(ids)
    names += [
        f"the rigid {'bodies' if len(parts) > 1 else 'body'} of {name_units(parts)}"
    ] * bool(parts)
    return " and ".join(names)
