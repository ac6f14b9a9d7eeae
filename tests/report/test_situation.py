"""Lines about the input that was read."""

import numpy as np

from d2rpick.histories.history import History
from d2rpick.histories.names import Part
from d2rpick.report.situation import describe_input

PARTS = tuple(Part(number, f"p{number}") for number in range(1, 9))


def describe_parts(parts: tuple[Part, ...], springs: tuple[Part, ...] = ()) -> History:
    channel = "internal energy of " + ", ".join(
        part.title for part in parts if part not in springs
    )
    time = np.linspace(0.0, 1.0, 5)
    return History(
        time, time, ("run",), "matsum", channel, parts=parts, springs=springs
    )


def test_of_many_parts_the_first_are_named() -> None:
    history = describe_parts(PARTS, springs=PARTS[1:2])
    assert history.energy_name == "internal energy of p1, p3, p4, p5, p6 and 2 more"
    assert (
        describe_input(history)
        == f"run: matsum, {history.energy_name}, 5 states, 0 to 1 (units of the run)"
    )


def test_few_parts_and_channels_are_named_as_they_are() -> None:
    few_text = describe_parts(PARTS[:6], springs=PARTS[:1])
    assert (
        few_text.energy_name
        == few_text.channel
        == "internal energy of p2, p3, p4, p5, p6"
    )
    whole = History(
        few_text.time, few_text.energy, ("run",), "glstat", "internal energy"
    )
    assert whole.energy_name == "internal energy"
