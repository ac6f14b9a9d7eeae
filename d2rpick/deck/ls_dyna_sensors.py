"""Find when LS-DYNA sensors switch parts, for *SENSOR_CONTROL of type DEF2RIG and switch sets with CODE 5.

A control is on or off. Its switches act in turn: when the condition of a switch is met, the control changes its state,
and the next switch is evaluated. A switch compares the time, or the force of a contact or rigid wall, with its VALUE.

Source: the vendor's keyword data as published in its Python library. According to its description of CODE 5, a set
makes its parts rigid while its control is on, and deformable while the control is off. This was not tested with the
solver.
"""

from __future__ import annotations

import math
from itertools import count, repeat
from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.deck.ls_dyna_columns import (
    CONTROL_SWITCHES,
    SENSOR_CONTROL,
    SENSOR_FORCE,
    SENSOR_SWITCH,
)
from d2rpick.deck.radioss_sensors import invert_spans

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from d2rpick.base.spans import Spans
    from d2rpick.deck.card import Card, Row
    from d2rpick.deck.columns import CardColumn
    from d2rpick.deck.reader import Deck

    # A function that returns the time spans in which the force of a contact or wall exceeds a value; None if unknown.
    Forces = Callable[[str, int, float], Spans | None]


_OF_FORCES: Final = {"CONTACT": "contact", "RWALL": "rigid wall"}
_MAGNITUDE: Final = "M"
_ALWAYS: Final = ((0.0, math.inf),)


class Control(NamedTuple):
    """A *SENSOR_CONTROL for a switch set, with the ids of its *SENSOR_SWITCH cards in the order of their use.

    ``initial`` is its initial state, ON or OFF. ``rounds`` is the number of times that all switches act in turn; it may
    be infinite.
    """

    card: Card
    switch_set: int
    initial: str
    switches: tuple[int, ...]
    rounds: float


class Change(NamedTuple):
    """The state of a control, on or off, that begins at ``time`` [time of the deck]."""

    time: float
    on: bool


def read_controls(deck: Deck) -> Iterator[Control]:
    """Yield the controls of a deck that switch parts."""
    for card in deck.named("SENSOR_CONTROL"):
        for first, second in zip(card.data[::2], card.data[1::2], strict=False):
            if card.word(first, SENSOR_CONTROL["TYPE"]).value != "DEF2RIG":
                continue
            numbers = [
                card.integer(second, column).value
                for column in CONTROL_SWITCHES
                if column.kind is int
            ]
            repeats = card.integer(first, SENSOR_CONTROL["NREP"]).value
            yield Control(
                card,
                card.integer(first, SENSOR_CONTROL["TYPEID"]).value
                + card.transform.rest,
                card.word(second, CONTROL_SWITCHES["INITSTT"], "ON").value,
                tuple(number + card.transform.rest for number in numbers if number),
                math.inf if repeats < 0 else 1 + repeats,
            )


def follow_control(
    deck: Deck, control: Control, forces: Forces | None, end: float
) -> list[Change] | str:
    """Return the times at which a sensor control changes its state during a run, or the reason why they are unknown.

    Parameters
    ----------
    deck : Deck
        The deck with the switches and sensors of the control.
    control : Control
        The control to follow.
    forces : callable or None
        Function that returns the time spans in which the force of a contact or wall exceeds a value; None if there is
        no history.
    end : float
        End of the run [time].

    Returns
    -------
    list of Change or str
        The state of the control at the start and all changes in order, or the reason why they are unknown.
    """
    if control.initial not in ("ON", "OFF"):
        return f"a control whose INITSTT is {control.initial!r}, not ON or OFF"
    changes = [Change(0.0, control.initial == "ON")]
    if not control.switches:
        return changes
    conditions: list[Spans] = []
    for number in control.switches:
        spans = _find_spans_of_switch(deck, number, forces)
        if isinstance(spans, str):
            return spans
        conditions.append(spans)
    endless = math.isinf(control.rounds)
    for _ in count() if endless else repeat(None, int(control.rounds)):
        begins = changes[-1].time
        for spans in conditions:
            time = _find_first_time(spans, changes[-1].time)
            if time >= end:
                return changes
            changes.append(Change(time, not changes[-1].on))
        if endless and changes[-1].time == begins:
            return "switches whose conditions hold at the same time, for ever"
    return changes


def _find_first_time(spans: Spans, since: float) -> float:
    """Return the first time at or after ``since`` at which a condition is met; infinity if it never is."""
    return next((max(since, start) for start, end in spans if since < end), math.inf)


def _find_spans_of_switch(
    deck: Deck, number: int, forces: Forces | None
) -> Spans | str:
    """Return the spans in which the condition of a switch is met, or the reason why they are unknown."""
    card, row = _find_row(
        deck.named("SENSOR_SWITCH"), SENSOR_SWITCH["SWITID"], number
    ) or (None, None)
    if card is None or row is None:
        return f"switch {number}, which the deck has not"
    if card.name.removesuffix("_TITLE") != "SENSOR_SWITCH":
        return f"switch {number} (*{card.name}), which is not followed"
    factor = card.transform.time
    numbers = [
        card.real(row, SENSOR_SWITCH[name]) for name in ("VALUE", "TIMWIN", "TDELAY")
    ]
    if problems := [value.problem for value in numbers if value.problem]:
        return f"switch {number}: {problems[0]}"
    value, duration, delay = (number.value for number in numbers)
    above = card.word(row, SENSOR_SWITCH["LOGIC"], "LT").value == "GT"
    if card.word(row, SENSOR_SWITCH["TYPE"], "SENSOR").value == "TIME":
        limit = value * factor
        holds: Spans | str = ((limit, math.inf),) if above else ((0.0, limit),)
    elif card.integer(row, SENSOR_SWITCH["FILTRID"]).value:
        return f"switch {number}, whose FILTRID is not followed"
    else:
        sensor = card.integer(row, SENSOR_SWITCH["SENSID"]).value + card.transform.rest
        holds = _find_spans_of_sensor(deck, sensor, value, forces, above=above)
    if isinstance(holds, str):
        return holds
    wait = (duration + delay) * factor
    return tuple(
        (start + wait, stop + delay * factor)
        for start, stop in holds
        if stop - start > duration * factor
    )


def _find_spans_of_sensor(
    deck: Deck, number: int, value: float, forces: Forces | None, *, above: bool
) -> Spans | str:
    """Return the spans in which the force on a sensor is above or below a value, or why these spans are unknown."""
    card, row = _find_row(
        deck.named("SENSOR_DEFINE"), SENSOR_FORCE["SENSID"], number
    ) or (None, None)
    if card is None or row is None:
        return f"sensor {number}, which the deck has not"
    name = f"sensor {number} (*{card.name.removesuffix('_TITLE')}"
    kind = _OF_FORCES.get(card.word(row, SENSOR_FORCE["FTYPE"]).value)
    if not card.name.startswith("SENSOR_DEFINE_FORCE") or kind is None:
        return f"{name}), which is not followed"
    if (direction := card.word(row, SENSOR_FORCE["VID"]).value) != _MAGNITUDE:
        return f"{name} along {direction or 'no direction'}): only a magnitude (VID M) is followed"
    if card.transform.scaled:
        return f"{name}), which is in an include in other units"
    entity = card.integer(row, SENSOR_FORCE["TYPEID"]).value + card.transform.rest
    # The magnitude of a force is never negative.
    if value < 0 or (value == 0 and not above):
        return _ALWAYS if above else ()
    strong = forces(kind, entity, value) if forces else None
    if strong is None:
        return f"{name} of {kind} {entity}), whose force no history shows"
    return strong if above else invert_spans(strong)


def _find_row(
    cards: Sequence[Card], column: CardColumn, number: int
) -> tuple[Card, Row] | None:
    """Return the line with this id in a column, the id offset of its include file, and its card."""
    rows: Iterable[tuple[Card, Row]] = (
        (card, row) for card in cards for row in card.data
    )
    return next(
        (
            (card, row)
            for card, row in rows
            if card.integer(row, column).value + card.transform.rest == number
        ),
        None,
    )
