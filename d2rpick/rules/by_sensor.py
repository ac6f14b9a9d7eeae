"""Find when the *SENSOR_CONTROL of a CODE 5 switch set switches, from the times and forces in a history."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from d2rpick.deck.ls_dyna_sensors import Change, follow_control, read_controls
from d2rpick.deck.switching import BY_SENSOR, SwitchEvent, SwitchSet
from d2rpick.rules.by_force import find_spans_of_force

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.base.spans import Spans
    from d2rpick.deck.reader import Deck
    from d2rpick.deck.switching import SwitchHeader
    from d2rpick.rules.judgement import HistoryJudge


class Sensed(NamedTuple):
    """A CODE 5 switch set with the ``changes`` of its sensor control, or the reason why they are ``unknown``."""

    by: SwitchSet
    changes: tuple[Change, ...] = ()
    unknown: str = ""

    def events(
        self, events: Sequence[SwitchEvent]
    ) -> Iterator[tuple[float, SwitchEvent]]:
        """Yield the time and the event of each switch; the parts are rigid while the control is on."""
        set_events = [event for event in events if event.by is self.by]
        # If a control begins as OFF, the parts are deformable from the start, so its first OFF switches nothing.
        begins_off = self.changes[:1] == (Change(0.0, on=False),)
        for change in self.changes[begins_off:]:
            for event in set_events:
                to_rigid = event.line.to_rigid == change.on
                line = event.line._replace(to_rigid=to_rigid)
                yield change.time, event._replace(line=line)


def follow_sensed_switches(
    deck: Deck,
    headers: Sequence[tuple[SwitchSet, SwitchHeader]],
    judge: HistoryJudge | None,
    end: float,
) -> Iterator[Sensed]:
    """Yield the CODE 5 sets of an LS-DYNA deck with their controls; without a history, only times are evaluated."""
    controls = {control.switch_set: control for control in read_controls(deck)}

    def find_spans(kind: str, number: int, least: float) -> Spans | None:
        if judge is None:
            return None
        return find_spans_of_force(deck, judge, kind, number, least)

    for card, header in headers:
        control = controls.get(header.swset.value)
        if header.code.problem or header.code.value != BY_SENSOR or control is None:
            continue
        followed = follow_control(deck, control, find_spans, end)
        if isinstance(followed, str):
            yield Sensed(card, unknown=followed)
        else:
            yield Sensed(card, tuple(followed))
