"""Write Radioss sensors that depend on time, on a contact force, or on other sensors."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.deck.printed_card import write_number
from d2rpick.deck.radioss_columns import DELAY, FORCE_SENSOR, SENSOR_INPUTS, STOP
from d2rpick.deck.radioss_sensors import NEVER

if TYPE_CHECKING:
    from collections.abc import Sequence


def write_time_sensor(
    number: int, title: str, start: float, stop: float | None = None
) -> str:
    """Return the card of a sensor that is active from ``start`` on, or only until ``stop`` if this is given [time]."""
    text = f"/SENSOR/TIME/{number}\n{title}\n{DELAY.write(Tdelay=write_number(start, 20))}\n"
    if stop is None:
        return text
    return f"{text}{STOP.write(Tstop=write_number(min(stop, NEVER), 20))}\n"


def write_force_sensor(number: int, kind: str, entity: int, wait: float) -> str:
    """Return the card of a sensor that is active while a contact or wall exerts a force, and ``wait`` longer [time]."""
    delay = DELAY.write(Tdelay=write_number(wait, 20))
    force = FORCE_SENSOR.write(ID=entity, Dir="NF", Fmin=-1.0)
    return f"/SENSOR/{kind}/{number}\nforce, or shortly after\n{delay}\n{force}\n"


def _write_sensor_of_sensors(kind: str, number: int, title: str, *inputs: int) -> str:
    """Return the card of an OR, AND or NOT sensor whose inputs are one or two other sensors."""
    names = ("sens_ID1", "sens_ID2")[: len(inputs)]
    row = SENSOR_INPUTS.write(**dict(zip(names, inputs, strict=True)))
    return f"/SENSOR/{kind}/{number}\n{title}\n{DELAY.write(Tdelay=0)}\n{row}\n"


def write_any_of(numbers: Sequence[int], title: str) -> tuple[str, int]:
    """Return the cards of sensors that combine sensors by OR, and the id of the last one, which gives the result."""
    texts: list[str] = []
    last, *others = numbers
    for number, other in enumerate(others, start=numbers[-1] + 1):
        texts.append(_write_sensor_of_sensors("OR", number, title, last, other))
        last = number
    return "".join(texts), last


def write_flight_sensors(
    contacts: Sequence[tuple[str, int]], wait: float, first_switch: float, first_id: int
) -> tuple[str, int, int]:
    """Write sensors that detect a contact and a flight; their ids begin with ``first_id``.

    Parameters
    ----------
    contacts : sequence of (str, int)
        Kind and id of each contact and rigid wall, as in `write_force_sensor`.
    wait, first_switch : float
        Force-free time after which a flight is detected, and the earliest time of a detection [time].

    Returns
    -------
    (str, int, int)
        The cards, the id of the sensor that is active during a contact and for the ``wait`` after it, and the id of the
        sensor that is active in a flight.
    """
    cards = [
        write_force_sensor(number, *contact, wait)
        for number, contact in enumerate(contacts, start=first_id)
    ]
    ids = range(first_id, first_id + len(contacts))
    combined, any_force = write_any_of(ids, "any force")
    no_force, late_enough, flight = range(any_force + 1, any_force + 4)
    cards += [
        combined,
        _write_sensor_of_sensors("NOT", no_force, "no force", any_force),
        write_time_sensor(late_enough, "from then on", first_switch),
        _write_sensor_of_sensors("AND", flight, "flight", no_force, late_enough),
    ]
    return "".join(cards), any_force, flight
