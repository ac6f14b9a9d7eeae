"""When which part is rigid over the legs of a Radioss run.

Source: Altair's public help for /RBODY in engine files: bodies are on by default in the first run, and stay as they
were in each later one unless it says otherwise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

from d2rpick.deck.radioss.starter import rigid_parts
from d2rpick.deck.rows import Value
from d2rpick.deck.switching import Switched, SwitchSet
from d2rpick.deck.windows import Event, Unit, Window, Windows

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.deck.radioss.engine import Leg
    from d2rpick.deck.radioss.files import Run
    from d2rpick.deck.radioss.starter import Body
    from d2rpick.deck.rows import Field


@dataclass(frozen=True, eq=False)
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


@dataclass(eq=False)
class RunWindows:
    """Windows of a run, the cards that make them, and the parts of the bodies by main node, where they are known."""

    windows: Windows
    sets: tuple[LegSwitch, ...]
    parts: dict[int, set[int]] = field(default_factory=dict)


def in_order(legs: list[Leg]) -> bool:
    """Whether the legs are all there, from the first on, and each ends no earlier than the one before."""
    numbers = [leg.number for leg in legs]
    stops = [leg.stop for leg in legs]
    sorted_stops = all(one.value <= other.value for one, other in pairwise(stops))
    return numbers == list(range(1, len(legs) + 1)) and sorted_stops and not any(stop.problem for stop in stops)


def find_run_windows(run: Run) -> RunWindows:
    """Follow every body that a leg or a sensor switches through the run.

    A body whose parts are not known is one unit, named by its main node.  Legs that are not in order have no windows.
    """
    sets = tuple(_switches(run.legs)) if in_order(run.legs) else ()
    starter = None if run.starter and run.starter.moved else run.starter
    bodies = {body.node.value: body for body in starter.bodies} if starter else {}
    switched = {value.value for one in sets for value in _nodes(one) if value.value}
    sensors = {node for node, body in bodies.items() if body.sensor and node not in switched}
    groups = {node: bodies[node].group for node in (*switched, *sensors) if node in bodies}
    parts = rigid_parts(starter, groups) if starter and groups else {}
    windows: list[Window] = []
    for node in sorted(switched):
        if not bodies or (node in bodies and not bodies[node].sensor):
            for unit in _units(node, parts):
                windows += _follow(unit, node, sets, run.legs[0])
    for node in sorted(sensors):
        windows += _by_sensor(run, bodies[node], parts)
    windows.sort(key=lambda window: (window.unit, window.tr))
    events = tuple(event for window in windows for event in (window.opened, window.closed) if event)
    return RunWindows(Windows(tuple(windows), (), events, frozenset(), frozenset()), sets, parts)


def _switches(legs: list[Leg]) -> Iterator[LegSwitch]:
    before: Leg | None = None
    for leg in legs:
        at, place = (before.stop.value, before.stop.field) if before else (0.0, None)
        for card, rigid, nodes in leg.switched:
            lines = tuple(Switched(node, False, rigid) for node in nodes)
            yield LegSwitch(card, "plain", None, lines, nodes, at=at, stop_field=place)
        before = leg


def _nodes(one: LegSwitch) -> Iterator[Value[int]]:
    return (line.part for line in one.switched if not line.part.problem)


def _units(node: int, parts: dict[int, set[int]]) -> list[Unit]:
    return [Unit(part) for part in sorted(parts.get(node, ()))] or [Unit(node, is_body=True)]


def _follow(unit: Unit, node: int, sets: tuple[LegSwitch, ...], first: Leg) -> Iterator[Window]:
    """Windows of a body: on from the start unless the first leg says otherwise."""
    start = LegSwitch(first.run, "plain", None, (), ())
    opened: Event | None = Event(unit, start, Switched(Value(node, first.run.here), False, True))
    for one in sets:
        line = next((line for line in one.switched if line.part.value == node), None)
        if line is None:
            continue
        event = Event(unit, one, line)
        if not line.to_rigid:
            if opened and one.at > 0:
                yield Window(unit, opened.by.time or 0.0, one.at, opened, event)
            opened = None
        elif opened is None or (opened.by.time == one.at == 0):
            opened = event
    if opened:
        yield Window(unit, opened.by.time or 0.0, None, opened, None)


def _by_sensor(run: Run, body: Body, parts: dict[int, set[int]]) -> Iterator[Window]:
    """Windows of a body with a time sensor: it is rigid while the sensor is not active."""
    if run.starter is None or body.sensor not in run.starter.timed:
        return
    start, stop = run.starter.timed[body.sensor]
    if math.isnan(start):
        return
    for unit in _units(body.node.value, parts):
        opened, closed = (
            Event(unit, LegSwitch(body.card, "plain", None, (), (), at=at), Switched(body.node, False, rigid))
            for at, rigid in ((0.0, True), (start, False))
        )
        if start > 0:
            yield Window(unit, 0.0, start, opened, closed)
        if stop < math.inf:
            again = Event(unit, LegSwitch(body.card, "plain", None, (), (), at=stop), Switched(body.node, False, True))
            yield Window(unit, stop, None, again, None)
