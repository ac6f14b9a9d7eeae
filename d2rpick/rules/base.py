"""What every rule of ``check`` looks at, a deck or a run as a case, and what it finds."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, TypeVar

from d2rpick.base.caching import cached_property
from d2rpick.base.errors import FORESEEN, INTERNAL_ERROR, one_line
from d2rpick.base.tuples import NamedTuple
from d2rpick.deck.ls_dyna_parts import (
    Constraint,
    Parts,
    read_constraints,
    read_parts,
    read_sections,
)
from d2rpick.deck.switching import (
    BY_SENSOR,
    Event,
    Header,
    SwitchSet,
    Window,
    Windows,
    find_windows,
    read_switching,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from d2rpick.deck.card import Card, Field, Value
    from d2rpick.deck.radioss_files import Flaw
    from d2rpick.deck.radioss_rigid import Body
    from d2rpick.deck.radioss_run import Run, RunWindows
    from d2rpick.deck.radioss_sensors import Course
    from d2rpick.deck.reader import Deck, Unread
    from d2rpick.deck.unswitchable import Unswitchable
    from d2rpick.rules.by_force import Forced
    from d2rpick.rules.by_sensor import Sensed
    from d2rpick.rules.judgement import HistoryJudge


LS_DYNA, RADIOSS = "ls-dyna", "radioss"
BOTH = (LS_DYNA, RADIOSS)

_BY_FORCE = {1, 2, 3, 4}  # CODE

K = TypeVar("K")
V = TypeVar("V")


def grouped(pairs: Iterable[tuple[K, V]]) -> dict[K, list[V]]:
    """Gather what has the same key, in the order of the keys."""
    found: dict[K, list[V]] = {}
    for key, value in pairs:
        found.setdefault(key, []).append(value)
    return found


class Severity(StrEnum):
    """How much a finding weighs; ``error`` is an objection."""

    ERROR = "error"
    WARNING = "warning"
    INFO = "info"

    @property
    def rank(self) -> int:
        """Return 0 for an error, more for less."""
        return list(Severity).index(self)


ERROR, WARNING, INFO = Severity


class Finding(NamedTuple):
    """One thing wrong with a deck: ``deck`` is the deck that was checked, ``file`` the file it stands in."""

    rule: str
    severity: Severity
    message: str
    deck: str
    file: str
    line: int
    column: int


class Unreadable(NamedTuple):
    """A deck that could not be checked, and why; ``files`` may belong to it all the same."""

    deck: str
    error: Exception
    files: tuple[str, ...] = ()

    @property
    def code(self) -> str:
        """That of the warning that tells it."""
        return "unreadable-deck" if isinstance(self.error, FORESEEN) else INTERNAL_ERROR

    @property
    def reason(self) -> str:
        """One line that names the deck."""
        return (
            f"{self.deck}: {one_line(self.error)}"
            if self.code == INTERNAL_ERROR
            else one_line(self.error)
        )


@dataclass(eq=False, repr=False)
class Case:
    """A deck as the rules see it; ``judge`` is given when there is an energy history to judge windows by."""

    deck: Deck
    judge: HistoryJudge | None = None

    @property
    def solver(self) -> str:
        """Whose deck it is."""
        return LS_DYNA

    @cached_property
    def parts(self) -> Parts:
        """Parts, part sets, rigid materials."""
        return read_parts(self.deck)

    @cached_property
    def sets(self) -> tuple[SwitchSet, ...]:
        """All switching cards."""
        return read_switching(self.deck)

    @property
    def switching(self) -> int:
        """Number of the cards that switch something."""
        return len(self.sets)

    @cached_property
    def headers(self) -> tuple[tuple[SwitchSet, Header], ...]:
        """Switching cards that have a header, with it."""
        return tuple(
            (card, card.header) for card in self.sets if card.header is not None
        )

    @cached_property
    def windows(self) -> Windows:
        """The switching windows of every part, with those of switches by force that the history shows."""
        if self.sensed:
            events = find_windows(self.sets, self.parts).events
            by_sensor = [each for set_ in self.sensed for each in set_.events(events)]
            timed = find_windows(self.sets, self.parts, by_sensor)
        else:
            timed = find_windows(self.sets, self.parts)
        by_force = [window for one in self.forced for window in one.windows]
        return timed._replace(
            windows=tuple(
                sorted((*timed.windows, *by_force), key=lambda one: (one.unit, one.tr))
            )
        )

    @cached_property
    def forced(self) -> tuple[Forced, ...]:
        """Switches by force, with what they do in the history; none without one."""
        if self.judge is None or not any(
            header.code.value in _BY_FORCE for _, header in self.headers
        ):
            return ()
        from d2rpick.rules.by_force import follow_forced_switches  # not above: start-up

        end = min(self.judge.end, self.end or self.judge.end)
        return tuple(
            follow_forced_switches(
                self.deck, find_windows(self.sets, self.parts).events, self.judge, end
            )
        )

    @cached_property
    def by_condition(self) -> tuple[Forced, ...]:
        """Switches by force and by sensor, with their windows."""
        if not self.sensed:
            return self.forced
        from d2rpick.rules.by_force import Forced  # not above: start-up

        windows = self.windows.windows
        by_sensor = [
            (set_, tuple(one for one in windows if one.opened.by is set_.by))
            for set_ in self.sensed
        ]
        return (
            *self.forced,
            *(
                Forced(set_.by.card, (set_.by.card,), own, (), "TIMWIN")
                for set_, own in by_sensor
                if own
            ),
        )

    @cached_property
    def sensed(self) -> tuple[Sensed, ...]:
        """Sets with CODE 5, with what their controls do: those of forces in the history, those of time without one."""
        if not any(header.code.value == BY_SENSOR for _, header in self.headers):
            return ()
        from d2rpick.rules.by_sensor import (
            follow_sensed_switches,  # not above: start-up
        )

        ends = (self.end, self.judge.end if self.judge else None)
        end = min((time for time in ends if time is not None), default=math.inf)
        return tuple(follow_sensed_switches(self.deck, self.headers, self.judge, end))

    @cached_property
    def constraints(self) -> Sequence[Constraint]:
        """What holds nodes together, and may lie in a part that is switched."""
        return [
            *read_constraints(self.deck, "nodal rigid body", "extra nodes", "joint")
        ]

    @cached_property
    def made_rigid(self) -> tuple[Event, ...]:
        """What makes a part rigid, where it is known which."""
        return tuple(
            event
            for event in self.windows.events
            if event.line.to_rigid and not event.unit.is_set
        )

    @property
    def whole(self) -> bool:
        """Whether all parts are known; a file with nothing but cards is for another deck to include."""
        return self.parts.all_known and bool(self.parts.materials)

    @cached_property
    def end_time(self) -> Value[float] | None:
        """ENDTIM as written; of several the last counts."""
        return next(
            (
                value
                for card, value in self.supporting
                if card.name == "CONTROL_TERMINATION"
            ),
            None,
        )

    @cached_property
    def end(self) -> float | None:
        """The end of the run [time of the deck], where it is known and positive."""
        if (
            self.end_time is None
            or self.end_time.problem
            or not self.end_time.value > 0
        ):
            return None
        factors = [
            card.transform.time for card in self.deck.named("CONTROL_TERMINATION")
        ]  # none in Radioss
        return self.end_time.value * (factors[-1] if factors else 1.0)

    @property
    def unread(self) -> Sequence[Unread]:
        """Includes that were not read and may hold what is switched."""
        return self.deck.unread

    @property
    def untimed(self) -> tuple[tuple[Field, str], ...]:
        """Cards that no clock switches, and what does."""
        return ()

    @cached_property
    def unturned(self) -> Mapping[int, str]:
        """Parts of solids whose stresses do not turn with a rigid body, and their formulation."""
        sections = read_sections(self.deck)
        found = (
            (part, sections.get(number)) for part, number in self.parts.sections.items()
        )
        return {
            part: f"ELFORM {one.elform}, {one.unturned}"
            for part, one in found
            if one and one.unturned
        }

    @cached_property
    def unswitchable(self) -> Mapping[int, Unswitchable]:
        """Parts that must not be switched."""
        from d2rpick.deck.unswitchable import (
            find_unswitchable_in_ls_dyna,
        )  # not above: start-up

        return find_unswitchable_in_ls_dyna(self.deck, self.parts)

    @cached_property
    def supporting(self) -> tuple[tuple[Card, Value[float]], ...]:
        """Numbers of other cards that the rules rely on: ENDTIM, and DT of the energy databases."""
        names = ("CONTROL_TERMINATION", "DATABASE_GLSTAT", "DATABASE_MATSUM")
        cards = [
            card for name in names for card in self.deck.named(name)[-1:] if card.rows
        ]
        return tuple((card, card.real(card.rows[0], 0)) for card in cards)


@dataclass(eq=False, repr=False, kw_only=True)
class RunCase(Case):
    """The starter deck and the legs, with the windows that they make."""

    run: Run

    @property
    def solver(self) -> str:
        """Whose deck it is."""
        return RADIOSS

    @cached_property
    def found(self) -> RunWindows:
        """Windows, and the parts of the bodies."""
        from d2rpick.deck.radioss_run import find_run_windows  # not above: start-up

        if self.judge is None:
            return find_run_windows(self.run)
        return find_run_windows(
            self.run, self.judge.contacts, self.judge.find_force_spans
        )

    def _find_course(self, body: Body) -> Course:
        """Give what is known of the course of the run for the sensor of a body."""
        from d2rpick.deck.radioss_run import find_course  # not above: start-up

        parts = self.found.parts.get(body.node.value, ())
        if self.judge is None:
            return find_course(self.run, parts, None)
        return find_course(
            self.run, parts, self.judge.contacts, self.judge.find_force_spans
        )

    @cached_property
    def parts(self) -> Parts:
        """Parts of the starter deck by id."""
        lines = self.run.starter.parts if self.run.starter else {}
        return Parts(
            dict.fromkeys(lines, ""), {part: line.title for part, line in lines.items()}
        )

    @cached_property
    def sets(self) -> tuple[SwitchSet, ...]:
        """What switches bodies."""
        return self.found.sets

    @cached_property
    def windows(self) -> Windows:
        """The rigid windows of every part, or of every body whose parts are not known."""
        return self.found.windows

    @cached_property
    def forced(self) -> tuple[Forced, ...]:
        """Bodies that a sensor of a force switches, with what it does in the history."""
        from d2rpick.deck.radioss_sensors import (
            find_contacts_of_sensor,
        )  # not above: start-up
        from d2rpick.rules.by_force import Forced

        starter, found = self.run.starter, []
        for body in starter.bodies if starter and self.judge else ():
            own = tuple(
                window
                for window in self.windows.windows
                if window.opened.by.card is body.card
            )
            if starter is None or not body.sensor or not own:
                continue
            course = self._find_course(body)
            contacts = find_contacts_of_sensor(starter, body.sensor, course)
            if contacts is not None:
                wait = "Tdelay of the sensor"
                found.append(Forced(body.card, (body.card,), own, contacts, wait))
        return tuple(found)

    @cached_property
    def end_time(self) -> Value[float] | None:
        """The end of the last leg as written."""
        return self.run.legs[-1].stop if self.run.legs else None

    @property
    def switching(self) -> int:
        """Number of cards that switch something: of the legs, and of bodies with a sensor or of rigid parts."""
        bodies = self.run.starter.bodies if self.run.starter else ()
        return len(self.sets) + sum(bool(body.sensor or body.part) for body in bodies)

    @property
    def untimed(self) -> tuple[tuple[Field, str], ...]:
        """Bodies that a sensor switches whose time is not known."""
        from d2rpick.deck.radioss_sensors import active_spans  # not above: start-up

        starter = self.run.starter
        legs = [leg for leg in self.run.legs[:-1] if leg.sensor]
        sensed = [body for body in starter.bodies if body.sensor] if starter else []
        spans = [
            (body, active_spans(starter, body.sensor, self._find_course(body)))
            for body in sensed
            if starter
        ]
        told = [
            (body.node.field, f"{body.name} is switched by {why}")
            for body, why in spans
            if isinstance(why, str)
        ]
        return *told, *(
            (leg.run.here, f"leg {leg.number} ends when sensor {leg.sensor} is active")
            for leg in legs
        )

    @cached_property
    def unturned(self) -> Mapping[int, str]:
        """Parts of elements without a co-rotating frame."""
        return self.run.starter.unturned if self.run.starter else {}

    @cached_property
    def unswitchable(self) -> Mapping[int, Unswitchable]:
        """Parts that must not be switched."""
        from d2rpick.deck.unswitchable import (
            find_unswitchable_in_radioss,
        )  # not above: start-up

        return (
            find_unswitchable_in_radioss(self.run.starter) if self.run.starter else {}
        )

    @cached_property
    def flaws(self) -> tuple[Flaw, ...]:
        """What the starter does to the nodes of the bodies that the legs switch."""
        if not self.run.named or not self.run.pushed:
            return ()
        from d2rpick.deck.radioss_flaws import flaws_of  # loads numpy

        return flaws_of(self.run, self.run.named)

    @cached_property
    def rigid_legs(self) -> list[tuple[int, list[Window]]]:
        """Index of every leg in which something becomes or stays rigid, with its windows."""
        found, start = [], 0.0
        for index, leg in enumerate(self.run.legs):
            stop = leg.stop.value
            held = [
                w
                for w in self.windows.windows
                if w.tr < stop and (w.td is None or w.td > start)
            ]
            if held and stop > start:
                found.append((index, held))
            start = stop
        return found


Objection = tuple["Field", str]
"""Where, and what is wrong there."""
