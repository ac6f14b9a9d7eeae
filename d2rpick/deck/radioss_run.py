"""A Radioss run: when which part is rigid over its legs, or by sensors of times, and what stays rigid.

Source: Altair's public help for /RBODY in engine files: bodies are on by default in the first run, and stay as they
were in each later one unless it says otherwise.
"""

from __future__ import annotations

import math
import os
import re
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

from d2rpick.base.caching import cached_property
from d2rpick.base.errors import DeckError, are, in_rows, name_units
from d2rpick.deck.card import Field, Value
from d2rpick.deck.radioss_deck import (
    Leg,
    Starter,
    blocks,
    card_of,
    kept_off,
    keyword,
    read_legs,
)
from d2rpick.deck.radioss_files import ENGINE, HEAD, STARTER, recognises, run_files
from d2rpick.deck.radioss_sensors import Course, active_spans, inactive, only_force
from d2rpick.deck.reader import Deck, Unread, why_unread
from d2rpick.deck.source import SourceFile
from d2rpick.deck.switching import (
    Event,
    Switched,
    SwitchSet,
    Unit,
    Window,
    Windows,
    follow,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator, Mapping, Sequence

    from d2rpick.deck.card import Card
    from d2rpick.deck.radioss_rigid import Body
    from d2rpick.deck.radioss_sensors import Forces, Spans

    Contacts = Callable[[Collection[int]], Spans | None]


@dataclass(eq=False, repr=False)
class Run:
    """The starter deck, where it was found, and the legs in the order of their numbers; ``deck`` has the files."""

    deck: Deck
    starter: Starter | None = None
    legs: list[Leg] = field(default_factory=list)
    included: dict[str, SourceFile] = field(
        default_factory=dict
    )  # by path: one that is included twice is read once

    @cached_property
    def named(self) -> frozenset[int]:
        """Main nodes that the legs switch."""
        return frozenset(
            node.value
            for leg in self.legs
            for _, _, nodes in leg.switched
            for node in nodes
        )

    @cached_property
    def resets(self) -> Mapping[int, float]:
        """When each sensor is reset for the first time [time]: at the start of a leg with /SENS/RESET."""
        found: dict[int, float] = {}
        start = 0.0
        for leg in self.legs:
            for sensor in leg.resets:
                found.setdefault(sensor, start)
            start = leg.stop.value
        return found

    @property
    def pushed(self) -> bool:
        """Whether rigid walls, or velocities that are given to nodes, may do something to its bodies."""
        return bool(self.starter and self.starter.named("RWALL", "INIVEL")) or any(
            leg.starts for leg in self.legs
        )


def read_run(path: str, content: bytes | None = None) -> Run:
    """Read a run: of its files, or from ``content``.

    Raises
    ------
    DeckError
        If a file cannot be read, or holds neither a starter deck nor an engine file.
    """
    run = Run(Deck(path))
    files = run_files(path) if content is None else []
    for name in files or [path]:
        source = SourceFile(name, content)
        head = source.read(0, HEAD)
        if not recognises(head):
            raise DeckError(
                f"{name}: no /BEGIN or /RUN was found, a file of a Radioss run was expected"
            )
        run.deck.sources.append(source)
        if re.search(ENGINE, head):
            run.legs += read_legs(source)
        if re.search(STARTER, head):
            run.starter = run.starter or Starter()
            _read_starter(source, run, ())
        else:
            run.deck.ends += [
                (block, False) for block in blocks(source) if block.end is None
            ]
    run.legs.sort(key=lambda leg: leg.number)
    run.deck.cards += [leg.run for leg in run.legs]
    run.deck.cards += [card for leg in run.legs for card, _, _ in leg.switched]
    return run


def _read_starter(source: SourceFile, run: Run, chain: tuple[str, ...]) -> None:
    if run.starter is None:
        return
    run.starter.sources.append(source)
    for block in blocks(source):
        words = keyword(block)
        if block.end is None:
            run.deck.ends.append((block, not chain))
        if not words:
            _include(card_of(block), source, run, chain)
        else:
            run.starter.blocks.append(block)
            if words[0] == "RBODY":
                run.deck.cards.append(card_of(block))


def _include(card: Card, source: SourceFile, run: Run, chain: tuple[str, ...]) -> None:
    from pathlib import Path  # not above: start-up

    asked = card.block.head.split(maxsplit=1)[1:]
    name = asked[0].strip() if asked else ""
    folders = (Path(source.name).parent, Path(run.deck.path).parent)
    there = (str(folder / name) for folder in folders if os.path.isfile(folder / name))  # noqa: PTH113  long names
    path, chain = next(there, None), (*chain, os.path.realpath(source.name))
    if reason := why_unread(path, chain):
        run.deck.unread.append(Unread(card.here._replace(text=name), reason))
    elif path is not None:
        if path not in run.included:
            run.included[path] = SourceFile(path)
        run.deck.sources.append(run.included[path])
        _read_starter(run.included[path], run, chain)


@dataclass(eq=False, repr=False)
class LegSwitch(SwitchSet):
    """Bodies switched at the beginning of a leg, at ``at``; ``stop_field`` is where that time is written."""

    at: float = 0.0
    stop_field: Field | None = None

    @cached_property
    def time(self) -> float | None:
        """When it switches [time of the run]."""
        return self.at

    @property
    def time_field(self) -> Field:
        """The end of the leg before, or the keyword in the first leg."""
        return self.stop_field or self.card.here


@dataclass(eq=False, repr=False)
class RunWindows:
    """Windows of a run, the cards that make them, and the parts of the bodies by main node, where they are known."""

    windows: Windows
    sets: tuple[LegSwitch, ...]
    parts: dict[int, set[int]] = field(default_factory=dict)


def in_order(legs: list[Leg]) -> bool:
    """Whether the legs are all there, from the first on, and each ends at a known time, not before the one before."""
    if any(leg.sensor for leg in legs[:-1]):
        return False
    numbers = [leg.number for leg in legs]
    stops = [leg.stop for leg in legs]
    sorted_stops = all(one.value <= other.value for one, other in pairwise(stops))
    return (
        numbers == list(range(1, len(legs) + 1))
        and sorted_stops
        and not any(stop.problem for stop in stops)
    )


def find_run_windows(
    run: Run, contacts: Contacts | None = None, forces: Forces | None = None
) -> RunWindows:
    """Follow every body that a leg or a sensor switches through the run.

    A body whose parts are not known is one unit, named by its main node.  Legs that are not in order have no windows.
    For sensors of forces ``contacts`` gives when something pushes some parts, and ``forces`` when an interface or wall
    pushes anything; None where no history shows it.
    """
    sets = tuple(_switches(run.legs)) if in_order(run.legs) else ()
    starter = None if run.starter and run.starter.moved else run.starter
    bodies = {body.node.value: body for body in starter.bodies} if starter else {}
    lines = [line.part for one in sets for line in one.switched]
    switched = {part.value for part in lines if part.value and not part.problem}
    sensors = {
        node for node, body in bodies.items() if body.sensor
    }  # whatever the legs say of them
    groups = {
        node: bodies[node].group for node in (*switched, *sensors) if node in bodies
    }
    parts = rigid_parts(starter, groups) if starter and groups else {}
    windows: list[Window] = []
    for node in sorted(switched):
        if not bodies or (node in bodies and not bodies[node].sensor):
            for unit in _units(node, parts):
                windows += _follow(unit, node, sets, run.legs[0])
    for node in sorted(sensors):
        windows += _by_sensor(
            run,
            bodies[node],
            parts,
            find_course(run, parts.get(node, ()), contacts, forces),
        )
    for body in bodies.values():
        if body.part and not body.sensor and body.node.value not in switched:
            windows.append(_always(body))
    windows.sort(key=lambda window: (window.unit, window.tr))
    events = tuple(
        event for window in windows for event in (window.opened, window.closed) if event
    )
    return RunWindows(
        Windows(tuple(windows), (), events, frozenset(), frozenset()), sets, parts
    )


def _switches(legs: list[Leg]) -> Iterator[LegSwitch]:
    before: Leg | None = None
    for leg in legs:
        at, place = (before.stop.value, before.stop.field) if before else (0.0, None)
        for card, rigid, nodes in leg.switched:
            lines = tuple(Switched(node, False, rigid) for node in nodes)
            yield LegSwitch(card, "plain", None, lines, nodes, at=at, stop_field=place)
        before = leg


def _units(node: int, parts: dict[int, set[int]]) -> list[Unit]:
    return [Unit(part) for part in sorted(parts.get(node, ()))] or [
        Unit(node, is_body=True)
    ]


def _follow(
    unit: Unit, node: int, sets: tuple[LegSwitch, ...], first: Leg
) -> list[Window]:
    """Windows of a body: on from the start unless the first leg says otherwise."""
    start = LegSwitch(first.run, "plain", None, (), ())
    events = [
        (0.0, Event(unit, start, Switched(Value(node, first.run.here), False, True)))
    ]
    for one in sets:
        for line in [line for line in one.switched if line.part.value == node][:1]:
            if (
                one.at == events[-1][0] == 0
                and line.to_rigid
                and events[-1][1].line.to_rigid
            ):
                events.pop()  # it is this line that says it
            events.append((one.at or 0.0, Event(unit, one, line)))
    return [
        window
        for window in follow(unit, events)[0]
        if window.td is None or window.td > 0
    ]


def find_course(
    run: Run,
    parts: Collection[int],
    contacts: Contacts | None,
    forces: Forces | None = None,
) -> Course:
    """Give what is known of the course of a run for sensors that switch some parts."""
    known = (
        contacts is not None
        and parts
        and run.starter is not None
        and only_force(run.starter)
    )
    return Course(run.resets, contacts(parts) if known and contacts else None, forces)


def _by_sensor(
    run: Run, body: Body, parts: dict[int, set[int]], course: Course
) -> Iterator[Window]:
    """Windows of a body with a sensor: it is rigid while the sensor is not active."""
    active = active_spans(run.starter, body.sensor, course) if run.starter else ""
    if isinstance(active, str):
        return
    end = run.legs[-1].stop.value if run.legs and in_order(run.legs) else math.inf
    spans = [
        (start, stop if stop < end else math.inf)
        for start, stop in inactive(active)
        if start < end
    ]
    for unit in _units(body.node.value, parts):
        for span in spans:
            opened, closed = (
                Event(
                    unit,
                    LegSwitch(body.card, "plain", None, (), (), at=at),
                    Switched(body.node, False, rigid),
                )
                for at, rigid in zip(span, (True, False), strict=True)
            )
            ends = span[1] < math.inf
            yield Window(
                unit,
                span[0],
                span[1] if ends else None,
                opened,
                closed if ends else None,
            )


def _always(body: Body) -> Window:
    """Window of a part that the starter makes a rigid body (Irigid), and that nothing switches."""
    unit, by = Unit(body.part), LegSwitch(body.card, "plain", None, (), ())
    return Window(
        unit, 0.0, None, Event(unit, by, Switched(body.node, False, True)), None
    )


def rigid_parts(starter: Starter, bodies: Mapping[int, int]) -> dict[int, set[int]]:
    """Parts that lie whole in the group of each body: those that it names, and those all of whose nodes it has.

    Parameters
    ----------
    starter : Starter
        The deck.
    bodies : mapping
        Group of nodes by main node.

    Returns
    -------
    dict
        Parts by main node; empty where the members of the group are not known.
    """
    members = {node: starter.group_members(group) for node, group in bodies.items()}
    known = {node: found for node, found in members.items() if found}
    named = {node: {*known[node][1]} if node in known else set() for node in bodies}
    every = starter.parts.keys()
    # another part may lie in the nodes of those that are named, as a skin does
    asked = {node: found for node, found in known.items() if every - found[1]}
    if asked:
        from d2rpick.deck.mesh import parts_within  # loads numpy

        for node, parts in parts_within(starter, asked).items():
            named[node] |= parts
    return named


def parts_off(run: Run) -> tuple[int, ...]:
    """Parts of the bodies that the first leg puts off, ascending; none without a starter deck."""
    nodes, bodies = kept_off(run.legs[:1]), run.starter.bodies if run.starter else ()
    groups = {
        body.node.value: body.group for body in bodies if body.node.value in nodes
    }
    held = rigid_parts(run.starter, groups) if run.starter and groups else {}
    return tuple(sorted(set().union(*held.values())))


def find_parts_of_fixed_bodies(run: Run) -> set[int]:
    """Parts of the bodies that are on from the start to the end, since no leg and no sensor switches them.

    Without engine files all bodies of /RBODY may be switched; those of parts with Irigid are rigid all the same.
    """
    bodies = run.starter.bodies if run.starter and not run.starter.moved else ()
    fixed = [
        body for body in bodies
        if not body.sensor and body.node.value not in run.named and (run.legs or body.part)
    ]  # fmt: skip
    held = (
        rigid_parts(run.starter, {body.node.value: body.group for body in fixed})
        if run.starter and fixed
        else {}
    )
    return set().union(*held.values())


def find_sensors_of_parts(starter: Starter) -> dict[int, int]:
    """Give the sensors that switch the rigid bodies of parts, by part."""
    sensors = {
        body.node.value: body
        for body in starter.bodies
        if body.sensor and not starter.moved
    }
    held = (
        rigid_parts(starter, {node: body.group for node, body in sensors.items()})
        if sensors
        else {}
    )
    return {
        part: sensors[node].sensor for node, parts in held.items() for part in parts
    }


class LeftRigid(NamedTuple):
    """Parts that lie whole in such bodies, where to put them off, what is wrong, and how it is mended."""

    parts: tuple[int, ...]
    place: Field
    found: str
    way_out: str


def left_rigid(run: Run, windows: Sequence[Window]) -> LeftRigid | None:
    """Find the bodies that no leg names, of a run with ``windows``, where they hold whole parts."""
    if run.starter is None or run.starter.moved or not windows:
        return None
    bodies = [
        body
        for body in run.starter.bodies
        if not body.sensor and body.node.value not in run.named
    ]
    parts = (
        rigid_parts(run.starter, {body.node.value: body.group for body in bodies})
        if bodies
        else {}
    )
    bodies = [body for body in bodies if parts.get(body.node.value)]
    held = sorted({part for body in bodies for part in parts[body.node.value]})
    if not held:
        return None
    places = [card.here for card, _, _ in run.legs[0].switched]
    mains = in_rows(body.node.value for body in bodies)
    found = f"no leg switches {_names(bodies)}, so {name_units(held)} {are(held)} rigid from time 0 to the end"
    way_out = f"name main node{'s' * (len(bodies) > 1)} {', '.join(mains)} in the /RBODY/OFF of every leg"
    if made := [
        body.node.value for body in bodies if body.node.field.text in ("", "0")
    ]:
        way_out += f" (the starter makes {name_units(made, 'node')}: see its listing)"
    return LeftRigid(
        tuple(held), places[0] if places else run.legs[0].run.here, found, way_out
    )


def _names(bodies: Sequence[Body]) -> str:
    """Name bodies: those of the deck by their ids, those of rigid parts by the parts."""
    ids = [body.id for body in bodies if body.id]
    parts = sorted(body.part for body in bodies if body.part)
    named = [f"/RBODY {', '.join(in_rows(ids))}"] * bool(ids)
    named += [
        f"the rigid {'bodies' if len(parts) > 1 else 'body'} of {name_units(parts)}"
    ] * bool(parts)
    return " and ".join(named)
