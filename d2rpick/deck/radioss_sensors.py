"""Find when the sensors of a Radioss run are active.

A rigid body with a sensor is deformable while the sensor is active and rigid while it is not, regardless of /RBODY/ON
and /RBODY/OFF. Source: Altair's public help for /SENSOR and /RBODY, the published source of OpenRadioss at bd4557ba7
(sensor_time.F, sensor_init.F, rbyonf.F), and runs computed with it. In these runs, Tstop had a line of its own and was
read in every version of the format, and the delay of a sensor with other sensors as input had no effect.
"""

from __future__ import annotations

import math
from types import MappingProxyType
from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.base.errors import DeckError
from d2rpick.base.graph import find_reachable
from d2rpick.deck.radioss_columns import DELAY, FORCE_SENSOR, SENSOR_INPUTS, STOP
from d2rpick.deck.radioss_deck import (
    Starter,
    get_lines_below_title,
    get_number,
    read_reals,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from d2rpick.base.spans import Spans
    from d2rpick.deck.card import Row

    # A function that returns the time spans in which the force of an interface or rigid wall acts; None if unknown.
    Forces = Callable[[str, int], Spans | None]

# First input version in which a time sensor can end (Tstop).
STOPS_SINCE: Final = 2023
NEVER: Final = 1e20  # Times from this value on are treated as never reached.
# Kinds of force sensors, each with the name of the corresponding force in histories.
_OF_FORCES: Final = {"INTER": "interface", "RWALL": "rigid wall"}
# Types of /INTER that exert no contact force on a flying body, e.g. ties.
WITHOUT_FORCE: Final = {"TYPE1", "TYPE2", "TYPE9", "TYPE12", "TYPE18", "SUB"}
# Relative rounding error of times in a T01 file [-], which have seven digits.
_SINGLE: Final = 1e-6


class Course(NamedTuple):
    """Data that determine when the sensors of a run are active: their resets, and the times at which forces act.

    ``resets`` contains the time of the first reset of each sensor [time], keyed by its id.

    ``contacts`` contains the spans in which the only contact or rigid wall of the deck acts; None if no history shows
    them. ``forces`` returns the spans in which one contact or wall acts according to its written force, and is
    preferred.
    """

    resets: Mapping[int, float] = MappingProxyType({})
    contacts: Spans | None = None
    forces: Forces | None = None

    def find_contacts(self, kind: str, number: int) -> Spans | None:
        """Return the spans in which an interface or rigid wall exerts a force [time]; None if no history shows them."""
        written = self.forces(kind, number) if self.forces else None
        return self.contacts if written is None else written


_UNKNOWN: Final = Course()


def find_active_spans(
    starter: Starter,
    number: int,
    course: Course = _UNKNOWN,
    above: tuple[int, ...] = (),
) -> Spans | str:
    """Return the ordered time spans in which a sensor is active, or text that says what is unknown.

    ``above`` contains the sensors whose inputs lead to this sensor. A time sensor that is reset is active for at most
    one more cycle, because its Tstop is lost.
    """
    card = starter.sensors.get(number)
    if card is None or number in above:
        return f"sensor {number}, which {'asks for itself' if card else 'the deck has not'}"
    rows = get_lines_below_title(card)
    kind = card.words[1]
    if kind in _OF_FORCES:
        return _find_forced_spans(starter, number, rows, course)
    if kind not in ("TIME", "OR", "AND", "NOT"):
        return f"sensor {number} (/SENSOR/{kind}), which is not a time sensor"
    if kind == "TIME":
        delay = read_reals(rows[0], DELAY)[0] if rows else 0.0
        stop = read_reals(rows[1], STOP)[0] if len(rows) > 1 else 0.0
        if math.isnan(delay) or math.isnan(stop):
            return f"sensor {number}, whose time is no number"
        stop = min(
            stop if 0 < stop < NEVER else math.inf, course.resets.get(number, math.inf)
        )
        return ((max(delay, 0.0), stop),) if delay < stop else ()
    if len(rows) < 2:
        return f"sensor {number}, which names no other"
    input_ids = [value.value for value in card.numbers(rows[1], SENSOR_INPUTS)]
    if kind == "NOT":
        input_ids = input_ids[:1]
    spans_of_inputs = [
        find_active_spans(starter, sensor_input, course, (*above, number))
        for sensor_input in input_ids
    ]
    for sensor_input in spans_of_inputs:
        if isinstance(sensor_input, str):
            return f"sensor {number}, of {sensor_input}"
    known_spans = [
        sensor_input
        for sensor_input in spans_of_inputs
        if not isinstance(sensor_input, str)
    ]
    if kind == "OR":
        return join_spans(known_spans)
    return invert_spans(
        join_spans([invert_spans(sensor_input) for sensor_input in known_spans])
        if kind == "AND"
        else known_spans[0]
    )


def _find_forced_spans(
    starter: Starter, number: int, rows: Sequence[Row], course: Course
) -> Spans | str:
    """Find when a force sensor is active: from the start of a contact force, plus Tmin, until Tdelay after its end."""
    keyword = starter.sensors[number].words[1]
    name = f"sensor {number} (/SENSOR/{keyword}), which waits for a force"
    if len(rows) < 2:
        return name
    entity = starter.sensors[number].integer(rows[1], FORCE_SENSOR["ID"]).value
    contacts = course.find_contacts(_OF_FORCES[keyword], entity)
    if contacts is None:
        return name
    lowest, highest, needed = read_reals(
        rows[1], (FORCE_SENSOR[name] for name in ("Fmin", "Fmax", "Tmin"))
    )
    wait = read_reals(rows[0], DELAY)[0]
    if not (lowest < 0 and highest == 0) or math.isnan(wait + needed):
        return f"{name} of a size that is not followed"
    if number in course.resets:
        return f"{name} and is reset"
    return join_spans(
        [
            tuple(
                (start + needed, (end + wait) * (1 + _SINGLE))
                for start, end in contacts
                if end - start >= needed
            )
        ]
    )


def find_contacts_of_sensor(
    starter: Starter, number: int, course: Course
) -> Spans | None:
    """Return the time spans of the forces for which a sensor, directly or through its inputs, waits [time].

    The result is None if the sensor waits for no force, or if no history shows the force.
    """
    force_spans = []
    for sensor in find_reachable(
        [number], lambda asking: _list_inputs(starter, asking)
    ):
        card = starter.sensors.get(sensor)
        rows = (
            get_lines_below_title(card) if card and card.words[1] in _OF_FORCES else ()
        )
        if card and len(rows) > 1:
            kind = _OF_FORCES[card.words[1]]
            entity = card.integer(rows[1], FORCE_SENSOR["ID"]).value
            force_spans.append(course.find_contacts(kind, entity))
    spans = [contacts for contacts in force_spans if contacts is not None]
    return join_spans(spans) if spans else None


def _list_inputs(starter: Starter, number: int) -> Sequence[int]:
    """Return the sensors that serve as inputs of a sensor."""
    card = starter.sensors.get(number)
    rows = (
        get_lines_below_title(card)
        if card and card.words[1] in ("OR", "AND", "NOT")
        else ()
    )
    if card and len(rows) > 1:
        return [value.value for value in card.numbers(rows[1], SENSOR_INPUTS)]
    return []


def has_only_one_force(starter: Starter) -> bool:
    """Return True if a deck has only one contact or rigid wall, whose force then follows from the momenta."""
    return len(list_forces(starter)) == 1


def list_forces(starter: Starter) -> list[tuple[str, int]]:
    """Return the sensor kind and id of each contact and rigid wall that exerts a force on a flying body."""
    # The keyword is /INTER/TYPE7/id or /INTER/LAGMUL/TYPE7/id.
    contacts = [
        ("INTER", get_number(card, 2) or get_number(card, 3))
        for card in starter.named("INTER")
        if card.words[1:] and card.words[1] not in WITHOUT_FORCE
    ]
    walls = [("RWALL", get_number(card, -1)) for card in starter.named("RWALL")]
    return contacts + walls


def require_forces(path: str, starter: Starter) -> list[tuple[str, int]]:
    """Return the contacts and walls as `list_forces` does; raise DeckError if there are none."""
    forces = list_forces(starter)
    if not forces:
        raise DeckError(
            f"{path}: the deck has no contact and no rigid wall, so nothing would end a flight; add the /INTER or "
            "/RWALL that the parts hit, or compute a reference run and choose the times from it "
            "(d2rpick plan)"
        )
    return forces


def join_spans(several: Sequence[Spans]) -> Spans:
    """Return the spans in which at least one of several sensors is active."""
    joined: list[tuple[float, float]] = []
    for start, stop in sorted(span for spans in several for span in spans):
        if joined and start <= joined[-1][1]:
            start = joined[-1][0]
            stop = max(stop, joined.pop()[1])
        joined.append((start, stop))
    return tuple(joined)


def invert_spans(spans: Spans) -> Spans:
    """Return the spans in which a sensor is not active."""
    ends = [0.0, *(end for span in spans for end in span), math.inf]
    pairs = zip(ends[::2], ends[1::2], strict=True)
    return tuple((start, stop) for start, stop in pairs if start < stop)
