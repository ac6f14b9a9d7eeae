"""Define the input of a rule, a case (a deck or a Radioss run), and its output, the findings."""

from __future__ import annotations

import math
from enum import StrEnum
from itertools import pairwise
from typing import TYPE_CHECKING, TypeVar

from d2rpick.base.caching import cached_property
from d2rpick.base.data_classes import dataclass
from d2rpick.base.errors import FORESEEN, INTERNAL_ERROR, format_in_one_line
from d2rpick.base.tuples import NamedTuple
from d2rpick.deck.card import CardField
from d2rpick.deck.ls_dyna_columns import DATABASE
from d2rpick.deck.ls_dyna_parts import (
    DELETING_FLAGS,
    Constraint,
    DeckParts,
    find_element_cards,
    find_tied_contacts,
    read_constraints,
    read_parts,
    read_sections,
)
from d2rpick.deck.switching import (
    BY_SENSOR,
    SwitchEvent,
    SwitchHeader,
    SwitchSet,
    SwitchWindow,
    Windows,
    find_windows,
    read_switching,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from d2rpick.deck.card import Card, Value
    from d2rpick.deck.radioss_files import Flaw
    from d2rpick.deck.radioss_rigid import Body
    from d2rpick.deck.radioss_run import RadiossRun, RunWindows
    from d2rpick.deck.radioss_sensors import Course
    from d2rpick.deck.reader import Deck, Unread
    from d2rpick.deck.unswitchable import Unswitchable
    from d2rpick.rules.by_force import Forced
    from d2rpick.rules.by_sensor import Sensed
    from d2rpick.rules.judgement import HistoryJudge, Judgement


LS_DYNA, RADIOSS = "ls-dyna", "radioss"
BOTH = (LS_DYNA, RADIOSS)

# Values of CODE with which a switch set waits for a contact or wall force.
_BY_FORCE = {1, 2, 3, 4}

K = TypeVar("K")
V = TypeVar("V")


def group_values(pairs: Iterable[tuple[K, V]]) -> dict[K, list[V]]:
    """Collect the values of each key, in the order in which the keys first occur."""
    groups: dict[K, list[V]] = {}
    for key, value in pairs:
        groups.setdefault(key, []).append(value)
    return groups


class Severity(StrEnum):
    """Severity of a finding; a finding with the severity ``error`` makes the check fail."""

    ERROR = "error"
    WARNING = "warning"
    INFO = "info"

    @property
    def rank(self) -> int:
        """Rank of the severity: 0 for error, 1 for warning, 2 for info."""
        return list(Severity).index(self)


ERROR, WARNING, INFO = Severity


class Finding(NamedTuple):
    """A problem found in a deck: ``deck`` is the deck that was checked, ``file`` the file with the problem."""

    rule: str
    severity: Severity
    message: str
    deck: str
    file: str
    line: int
    column: int


class Unreadable(NamedTuple):
    """A deck that could not be checked, with the error; ``files`` are the known files of the deck."""

    deck: str
    error: Exception
    files: tuple[str, ...] = ()

    @property
    def code(self) -> str:
        """Return the code of the warning that reports that this deck was not checked."""
        return "unreadable-deck" if isinstance(self.error, FORESEEN) else INTERNAL_ERROR

    @property
    def reason(self) -> str:
        """Return one line that names the deck and states the error."""
        if self.code == INTERNAL_ERROR:
            return f"{self.deck}: {format_in_one_line(self.error)}"
        return format_in_one_line(self.error)


@dataclass(eq=False, repr=False)
class Case:
    """A deck as the input of rules; ``judge`` is given if an energy history is available to judge the windows."""

    deck: Deck
    judge: HistoryJudge | None = None

    @property
    def solver(self) -> str:
        """Return the solver of the deck."""
        return LS_DYNA

    @cached_property
    def parts(self) -> DeckParts:
        """Return the parts, part sets and rigid materials of the deck."""
        return read_parts(self.deck)

    @cached_property
    def sets(self) -> tuple[SwitchSet, ...]:
        """Return all switching cards of the deck."""
        return read_switching(self.deck)

    @property
    def switching(self) -> int:
        """Return the number of switching cards."""
        return len(self.sets)

    @property
    def switches_itself(self) -> bool:
        """Return True if a force or a sensor of the run switches parts, at times that are not in the deck."""
        return any(
            not header.code.problem and header.code.value in (*_BY_FORCE, BY_SENSOR)
            for _, header in self.headers
        )

    @cached_property
    def headers(self) -> tuple[tuple[SwitchSet, SwitchHeader], ...]:
        """Return the switching cards that have header lines, each with its header."""
        return tuple(
            (card, card.header) for card in self.sets if card.header is not None
        )

    @cached_property
    def windows(self) -> Windows:
        """Return the rigid windows of all parts, including force-triggered windows if the history shows the force."""
        timed = find_windows(self.sets, self.parts)
        if self.sensed:
            by_sensor: list[tuple[float, SwitchEvent]] = []
            for sensed_set in self.sensed:
                by_sensor += sensed_set.events(timed.events)
            timed = find_windows(self.sets, self.parts, by_sensor)
        windows = [*timed.windows]
        for switch in self.forced:
            windows += switch.windows
        windows.sort(key=lambda window: (window.unit, window.tr))
        return timed._replace(windows=tuple(windows))

    @cached_property
    def judgements(self) -> tuple[tuple[SwitchWindow, Judgement], ...]:
        """Return the windows with their verdicts from the history; empty if there is no history."""
        if self.judge is None:
            return ()
        windows = self.windows.windows
        parts_by_times = group_values(
            ((window.tr, window.td), window.part)
            for window in windows
            if window.part is not None
        )
        by_condition = {
            window for switch in self.by_condition for window in switch.windows
        }
        return tuple(
            (
                window,
                self.judge.judge(
                    window,
                    parts_by_times.get((window.tr, window.td), ()),
                    by_force=window in by_condition,
                ),
            )
            for window in windows
        )

    @cached_property
    def forced(self) -> tuple[Forced, ...]:
        """Return the force-triggered switches with their times in the history; empty if there is no history."""
        if self.judge is None or not any(
            header.code.value in _BY_FORCE for _, header in self.headers
        ):
            return ()
        # Imported here to keep start-up fast.
        from d2rpick.rules.by_force import follow_forced_switches

        end = min(self.judge.end, self.end or self.judge.end)
        return tuple(
            follow_forced_switches(
                self.deck, find_windows(self.sets, self.parts).events, self.judge, end
            )
        )

    @cached_property
    def by_condition(self) -> tuple[Forced, ...]:
        """Return the switches that a force or a sensor triggers, with their windows."""
        if not self.sensed:
            return self.forced
        # Imported here to keep start-up fast.
        from d2rpick.rules.by_force import Forced

        switches = [*self.forced]
        for sensed_set in self.sensed:
            card = sensed_set.by.card
            windows = tuple(
                window
                for window in self.windows.windows
                if window.opened.by is sensed_set.by
            )
            if windows:
                switches.append(Forced(card, (card,), windows, (), "TIMWIN"))
        return tuple(switches)

    @cached_property
    def sensed(self) -> tuple[Sensed, ...]:
        """Return the CODE 5 sets with their sensor controls. Only controls that depend on a force need a history."""
        if not any(header.code.value == BY_SENSOR for _, header in self.headers):
            return ()
        # Imported here to keep start-up fast.
        from d2rpick.rules.by_sensor import follow_sensed_switches

        ends = (self.end, self.judge.end if self.judge else None)
        end = min((time for time in ends if time is not None), default=math.inf)
        return tuple(follow_sensed_switches(self.deck, self.headers, self.judge, end))

    @cached_property
    def constraints(self) -> Sequence[Constraint]:
        """Return the constraints of the deck that may belong to a switched part."""
        return [*read_constraints(self.deck, *DELETING_FLAGS)]

    @cached_property
    def parts_of_constrained_nodes(self) -> Mapping[int, set[int]]:
        """Return all parts whose elements contain a node of a constraint, keyed by node id."""
        cards = find_element_cards(self.deck, searched=True) if self.constraints else ()
        if not cards:
            return {}
        # Imported here to keep start-up fast.
        from d2rpick.deck.ls_dyna_inventory import find_parts_of_nodes

        nodes = (constraint.nodes for constraint in self.constraints)
        return find_parts_of_nodes(cards, frozenset[int]().union(*nodes))

    @cached_property
    def ties(self) -> Sequence[tuple[Card, frozenset[int]]]:
        """Return the tied contacts whose parts are known, each with these parts."""
        if not find_tied_contacts(self.deck):
            return ()
        # Imported here to keep start-up fast.
        from d2rpick.deck.ls_dyna_inventory import find_parts_of_nodes
        from d2rpick.deck.ls_dyna_loads import read_tied_contacts

        ties = [(card, joint) for card, joint in read_tied_contacts(self.deck) if joint]
        nodes = {node for _, joint in ties for node in joint.nodes.tolist()}
        cards = find_element_cards(self.deck, searched=True) if nodes else ()
        parts_of_nodes = find_parts_of_nodes(cards, nodes) if cards else {}
        return [
            (
                card,
                joint.parts.union(
                    *(parts_of_nodes.get(node, ()) for node in joint.nodes.tolist())
                ),
            )
            for card, joint in ties
        ]

    @cached_property
    def knows_all_connections(self) -> bool:
        """Return True if all elements, constraints and tied contacts that may connect parts can be read."""
        # Imported here to keep start-up fast.
        from d2rpick.deck.ls_dyna_loads import read_joints

        return (
            self.knows_all_parts
            and bool(find_element_cards(self.deck, searched=True))
            and not find_element_cards(self.deck, searched=False)
            and not read_joints(self.deck).unknown
        )

    def list_connected_parts(self, part: int) -> Iterable[int]:
        """Return the parts that share nodes with a part, or that a constraint or a tied contact connects to it."""
        return self._connected.get(part, set())

    @cached_property
    def _connected(self) -> Mapping[int, set[int]]:
        """Return the connected parts, keyed by part id."""
        # Imported here to keep start-up fast.
        from d2rpick.deck.ls_dyna_inventory import find_shared_nodes

        cards = find_element_cards(self.deck, searched=True)
        every_part = {part: part for part in self.parts.material_by_part}
        groups: list[Iterable[int]] = [*find_shared_nodes(cards, every_part)]
        groups += [parts for _, parts in self.ties]
        for constraint in self.constraints:
            parts_of_nodes = (
                self.parts_of_constrained_nodes.get(node, ())
                for node in constraint.nodes
            )
            own = {constraint.part} if constraint.part else set[int]()
            groups.append(own.union(*parts_of_nodes))
        connected: dict[int, set[int]] = {}
        for group in groups:
            members = {*group}
            for part in members:
                connected.setdefault(part, set()).update(members)
        return connected

    @cached_property
    def made_rigid(self) -> tuple[SwitchEvent, ...]:
        """Return the switches to rigid whose parts are known."""
        return tuple(
            event
            for event in self.windows.events
            if event.line.to_rigid and not event.unit.is_set
        )

    @property
    def knows_all_parts(self) -> bool:
        """Return True if all parts are known; a file of switching cards that another deck includes knows none."""
        return self.parts.all_known and bool(self.parts.material_by_part)

    @cached_property
    def end_time(self) -> Value[float] | None:
        """Return ENDTIM as written in the deck; the last of several definitions applies."""
        return next(
            (
                value
                for card, value in self.end_and_intervals
                if card.name == "CONTROL_TERMINATION"
            ),
            None,
        )

    @cached_property
    def end(self) -> float | None:
        """Return the end of the run [time of the deck]; None if it is missing or not positive."""
        if (
            self.end_time is None
            or self.end_time.problem
            or not self.end_time.value > 0
        ):
            return None
        factors = [
            card.transform.time for card in self.deck.named("CONTROL_TERMINATION")
        ]  # The list is empty for Radioss, because only LS-DYNA decks can scale ENDTIM.
        return self.end_time.value * (factors[-1] if factors else 1.0)

    @property
    def unread(self) -> Sequence[Unread]:
        """Return the include files that were not read and may contain switching cards."""
        return self.deck.unread

    @property
    def untimed(self) -> tuple[tuple[CardField, str], ...]:
        """Return the cards that do not switch by time, each with the event that triggers it."""
        return ()

    @cached_property
    def unturned(self) -> Mapping[int, str]:
        """Return the formulation of solid parts whose stresses do not rotate with a rigid body, by part id."""
        sections = read_sections(self.deck)
        part_sections = (
            (part, sections.get(number)) for part, number in self.parts.sections.items()
        )
        return {
            part: f"ELFORM {section.elform}, {section.unturned}"
            for part, section in part_sections
            if section and section.unturned
        }

    @cached_property
    def unswitchable(self) -> Mapping[int, Unswitchable]:
        """Return the parts that must not be switched, with the reasons, by part id."""
        # Imported here to keep start-up fast.
        from d2rpick.deck.unswitchable import find_unswitchable_in_ls_dyna

        return find_unswitchable_in_ls_dyna(self.deck, self.parts)

    @cached_property
    def end_and_intervals(self) -> tuple[tuple[Card, Value[float]], ...]:
        """Return ENDTIM and the DT of the energy databases, each with its card."""
        names = ("CONTROL_TERMINATION", "DATABASE_GLSTAT", "DATABASE_MATSUM")
        cards = [
            card for name in names for card in self.deck.named(name)[-1:] if card.rows
        ]
        # ENDTIM and DT occupy the same columns on their cards.
        return tuple((card, card.real(card.rows[0], DATABASE["DT"])) for card in cards)


@dataclass(eq=False, repr=False, kw_only=True)
class RunCase(Case):
    """A Radioss run as the input of rules: its starter deck, its engine files (``legs``), and the resulting windows."""

    run: RadiossRun

    @property
    def solver(self) -> str:
        """Return the solver of the deck."""
        return RADIOSS

    @cached_property
    def found(self) -> RunWindows:
        """Return the rigid windows of the run, and the parts of its rigid bodies."""
        # Imported here to keep start-up fast.
        from d2rpick.deck.radioss_run import find_run_windows

        if self.judge is None:
            return find_run_windows(self.run)
        return find_run_windows(
            self.run, self.judge.contacts, self.judge.find_force_spans
        )

    def _find_course(self, body: Body) -> Course:
        """Return the data of the run that determine when the sensor of a body is active."""
        # Imported here to keep start-up fast.
        from d2rpick.deck.radioss_run import find_course

        parts = self.found.parts.get(body.node.value, ())
        if self.judge is None:
            return find_course(self.run, parts, None)
        return find_course(
            self.run, parts, self.judge.contacts, self.judge.find_force_spans
        )

    @cached_property
    def parts(self) -> DeckParts:
        """Return the parts of the starter deck."""
        lines = self.run.starter.parts if self.run.starter else {}
        return DeckParts(
            dict.fromkeys(lines, ""), {part: line.title for part, line in lines.items()}
        )

    @cached_property
    def sets(self) -> tuple[SwitchSet, ...]:
        """Return the cards that switch rigid bodies."""
        return self.found.sets

    @cached_property
    def windows(self) -> Windows:
        """Return the rigid windows of all parts, or of bodies whose parts are unknown."""
        return self.found.windows

    @cached_property
    def forced(self) -> tuple[Forced, ...]:
        """Return the bodies that a force sensor switches, with their switching times in the history."""
        # Imported here to keep start-up fast.
        from d2rpick.deck.radioss_sensors import find_contacts_of_sensor
        from d2rpick.rules.by_force import Forced

        starter = self.run.starter
        forced = []
        for body in starter.bodies if starter and self.judge else ():
            body_windows = tuple(
                window
                for window in self.windows.windows
                if window.opened.by.card is body.card
            )
            if starter is None or not body.sensor or not body_windows:
                continue
            course = self._find_course(body)
            contacts = find_contacts_of_sensor(starter, body.sensor, course)
            if contacts is not None:
                wait = "Tdelay of the sensor"
                forced.append(
                    Forced(body.card, (body.card,), body_windows, contacts, wait)
                )
        return tuple(forced)

    @cached_property
    def end_time(self) -> Value[float] | None:
        """Return the end time of the last engine run, as written in its file."""
        return self.run.legs[-1].stop if self.run.legs else None

    @property
    def switching(self) -> int:
        """Return the number of all switching cards: those in engine runs, bodies with a sensor, and rigid parts."""
        bodies = self.run.starter.bodies if self.run.starter else ()
        return len(self.sets) + sum(bool(body.sensor or body.part) for body in bodies)

    @property
    def switches_itself(self) -> bool:
        """Return True if a sensor switches a body, or ends an engine run after which bodies are switched."""
        bodies = self.run.starter.bodies if self.run.starter else ()
        by_leg = any(
            leg.sensor and (leg.switched or following.switched)
            for leg, following in pairwise(self.run.legs)
        )
        return by_leg or any(body.sensor for body in bodies)

    @property
    def untimed(self) -> tuple[tuple[CardField, str], ...]:
        """Return the bodies that a sensor switches at unknown times, and the engine runs that a sensor ends."""
        # Imported here to keep start-up fast.
        from d2rpick.deck.radioss_sensors import find_active_spans

        starter = self.run.starter
        legs = [leg for leg in self.run.legs[:-1] if leg.sensor]
        sensed = [body for body in starter.bodies if body.sensor] if starter else []
        spans = [
            (body, find_active_spans(starter, body.sensor, self._find_course(body)))
            for body in sensed
            if starter
        ]
        untimed_bodies = [
            (body.node.field, f"{body.name} is switched by {spans_or_reason}")
            for body, spans_or_reason in spans
            if isinstance(spans_or_reason, str)
        ]
        return *untimed_bodies, *(
            (
                leg.run.here,
                f"engine file {leg.number} ends when sensor {leg.sensor} is active",
            )
            for leg in legs
        )

    @cached_property
    def unturned(self) -> Mapping[int, str]:
        """Return the formulation of each part whose elements have no co-rotational frame, keyed by part id."""
        return self.run.starter.unturned if self.run.starter else {}

    @cached_property
    def unswitchable(self) -> Mapping[int, Unswitchable]:
        """Return the parts that must not be switched, with the reasons, keyed by part id."""
        # Imported here to keep start-up fast.
        from d2rpick.deck.unswitchable import find_unswitchable_in_radioss

        if self.run.starter:
            return find_unswitchable_in_radioss(self.run.starter)
        return {}

    @cached_property
    def flaws(self) -> tuple[Flaw, ...]:
        """Return how cards of the starter deck harm nodes of the bodies that the engine files switch."""
        if not self.run.named or not self.run.pushed:
            return ()
        # Imported here to keep start-up fast.
        from d2rpick.deck.radioss_flaws import find_flaws

        return find_flaws(self.run, self.run.named)

    @cached_property
    def rigid_legs(self) -> list[tuple[int, list[SwitchWindow]]]:
        """Return the indices of the engine runs in which a part or body is rigid, each with its rigid windows."""
        rigid_legs, start = [], 0.0
        for index, leg in enumerate(self.run.legs):
            stop = leg.stop.value
            leg_windows = [
                w
                for w in self.windows.windows
                if w.tr < stop and (w.td is None or w.td > start)
            ]
            if leg_windows and stop > start:
                rigid_legs.append((index, leg_windows))
            start = stop
        return rigid_legs


PlacedMessage = tuple[CardField, str]
"""A field of the deck, and what is wrong there."""
