"""Sensors of times: when they are active over the legs of a Radioss run.

A rigid body with a sensor is deformable while that is active and rigid while it is not, whatever /RBODY/ON and OFF say.
Source: Altair's public help for /SENSOR and /RBODY, the published source of OpenRadioss at bd4557ba7 (sensor_time.F,
sensor_init.F, rbyonf.F), and runs computed with it: Tstop has a line of its own, and is read in every version of the
format; the delay of a sensor of others has no effect.
"""

from __future__ import annotations

import math
from types import MappingProxyType
from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.base.graph import reached
from d2rpick.deck.card import Row
from d2rpick.deck.radioss_deck import Starter, below_title, reals

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    Spans = tuple[tuple[float, float], ...]  # of time
    # When the force of an interface or rigid wall acts, by its kind and number; None where that is not known.
    Forces = Callable[[str, int], Spans | None]

STOPS_SINCE: Final = (
    2023  # version of the format in whose description a sensor of time has an end
)
NEVER: Final = 1e20
# Sensors of forces, and what histories call that of which they are.
_OF_FORCES: Final = {"INTER": "interface", "RWALL": "rigid wall"}
# Ties, fluids, and parts of other contacts: they push nothing that flies.
WITHOUT_FORCE: Final = {"TYPE1", "TYPE2", "TYPE9", "TYPE12", "TYPE18", "SUB"}
_WIDTH: Final = 10
_SINGLE: Final = 1e-6  # times of a T01 have seven digits


class Course(NamedTuple):
    """What is known of a run: when sensors are reset for the first time, by number, and when something pushes [time].

    ``contacts`` are spans of the only contact or rigid wall of the deck; None where no history shows them.  ``forces``
    gives those of each by what the solver wrote of its force; these come first.
    """

    resets: Mapping[int, float] = MappingProxyType({})
    contacts: Spans | None = None
    forces: Forces | None = None

    def find_contacts(self, kind: str, number: int) -> Spans | None:
        """Find when an interface or rigid wall pushes [time]; None where no history shows it."""
        written = self.forces(kind, number) if self.forces else None
        return self.contacts if written is None else written


_UNKNOWN: Final = Course()


def active_spans(
    starter: Starter,
    number: int,
    course: Course = _UNKNOWN,
    above: tuple[int, ...] = (),
) -> Spans | str:
    """Find when a sensor is active: spans (from, to) in order, or what cannot be followed, in words.

    ``above`` are sensors that ask for this one.  A sensor of time that is reset is active for one more cycle at most:
    its Tstop is lost.
    """
    card = starter.sensors.get(number)
    if card is None or number in above:
        return f"sensor {number}, which {'asks for itself' if card else 'the deck has not'}"
    rows, kind = below_title(card), card.words[1]
    if kind in _OF_FORCES:
        return _while_pushed(starter, number, rows, course)
    if kind not in ("TIME", "OR", "AND", "NOT"):
        return f"sensor {number} (/SENSOR/{kind}), which is not a time sensor"
    if kind == "TIME":
        delay = reals(rows[0], 1)[0] if rows else 0.0
        stop = reals(rows[1], 1)[0] if len(rows) > 1 else 0.0
        if math.isnan(delay) or math.isnan(stop):
            return f"sensor {number}, whose time is no number"
        stop = min(
            stop if 0 < stop < NEVER else math.inf, course.resets.get(number, math.inf)
        )
        return ((max(delay, 0.0), stop),) if delay < stop else ()
    if len(rows) < 2:
        return f"sensor {number}, which names no other"
    asked = [card.integer(rows[1], at).value for at in range(1 if kind == "NOT" else 2)]
    found = [active_spans(starter, one, course, (*above, number)) for one in asked]
    for one in found:
        if isinstance(one, str):
            return f"sensor {number}, of {one}"
    known = [one for one in found if not isinstance(one, str)]
    if kind == "OR":
        return either(known)
    return inactive(
        either([inactive(one) for one in known]) if kind == "AND" else known[0]
    )


def _while_pushed(
    starter: Starter, number: int, rows: Sequence[Row], course: Course
) -> Spans | str:
    """Follow a sensor of any force: active from the force on, or Tmin later, to Tdelay after it."""
    keyword = starter.sensors[number].words[1]
    name = f"sensor {number} (/SENSOR/{keyword}), which waits for a force"
    if len(rows) < 2:
        return name
    entity = starter.sensors[number].integer(rows[1], 0).value
    contacts = course.find_contacts(_OF_FORCES[keyword], entity)
    if contacts is None:
        return name
    lowest, highest, needed = reals(
        Row(rows[1].block, rows[1].distance, rows[1].text[2 * _WIDTH :], _WIDTH), 3
    )
    wait = reals(rows[0], 1)[0]
    if not (lowest < 0 and highest == 0) or math.isnan(wait + needed):
        return f"{name} of a size that is not followed"
    if number in course.resets:
        return f"{name} and is reset"
    return either(
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
    """Find when those forces act for which a sensor, or one that it asks for, waits [time].

    None where it waits for none, or where no history shows it.
    """
    known = []
    for other in reached([number], lambda asking: _asked(starter, asking)):
        card = starter.sensors.get(other)
        rows = below_title(card) if card and card.words[1] in _OF_FORCES else ()
        if card and len(rows) > 1:
            kind, entity = _OF_FORCES[card.words[1]], card.integer(rows[1], 0).value
            known.append(course.find_contacts(kind, entity))
    spans = [contacts for contacts in known if contacts is not None]
    return either(spans) if spans else None


def _asked(starter: Starter, number: int) -> Sequence[int]:
    """Sensors that another one asks for."""
    card = starter.sensors.get(number)
    rows = below_title(card) if card and card.words[1] in ("OR", "AND", "NOT") else ()
    return (
        [card.integer(rows[1], at).value for at in range(2)]
        if card and len(rows) > 1
        else []
    )


def only_force(starter: Starter) -> bool:
    """Whether a deck has one contact or rigid wall that pushes: then what pushes by the momenta is that."""
    contacts = [
        card
        for card in starter.named("INTER")
        if card.words[1:] and card.words[1] not in WITHOUT_FORCE
    ]
    return len(contacts) + len(starter.named("RWALL")) == 1


def either(several: Sequence[Spans]) -> Spans:
    """Spans in which one of several is active."""
    joined: list[tuple[float, float]] = []
    for start, stop in sorted(one for spans in several for one in spans):
        if joined and start <= joined[-1][1]:
            start, stop = joined[-1][0], max(stop, joined.pop()[1])
        joined.append((start, stop))
    return tuple(joined)


def inactive(spans: Spans) -> Spans:
    """Spans between those in which a sensor is active."""
    ends = [0.0, *(end for span in spans for end in span), math.inf]
    pairs = zip(ends[::2], ends[1::2], strict=True)
    return tuple((start, stop) for start, stop in pairs if start < stop)
