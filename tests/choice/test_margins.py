"""Margins of a box whose parts lie on a line and that tumbles after its first landing, with and without its deck."""

from collections.abc import Sequence

import numpy as np
import pytest

from d2rpick.choice.answers import suggest_in_history
from d2rpick.choice.parts.margins import find_margin
from d2rpick.choice.question import Settings, read_reference
from d2rpick.choice.td.flights import find_flights
from d2rpick.deck import read_inventory
from d2rpick.deck.geometry import Placement
from d2rpick.flight.flight import Flight
from d2rpick.histories.history import History
from d2rpick.histories.names import Selection
from tests.command import put
from tests.computed import locate_stored, read_starter


@pytest.fixture(scope="module")
def box() -> tuple[History, Sequence[Flight]]:
    reference = read_reference(
        [locate_stored("drop2T01.gz")], Selection(parts=("1-5",))
    )
    flights = find_flights(reference.history, Settings())
    return reference.history, [flight for flight in flights if flight.end]


@pytest.fixture(scope="module")
def placement(tmp_path_factory: pytest.TempPathFactory) -> Placement:
    deck = put(
        tmp_path_factory.mktemp("deck") / "DROP2_0000.rad", read_starter("DROP2")
    )
    return Placement(read_inventory(str(deck)))


def test_where_nothing_shows_how_a_box_tumbles_the_margin_allows_for_any_rotation(
    box: tuple[History, Sequence[Flight]], placement: Placement
) -> None:
    """The box falls from rest without rotation; its parts on a line, and no node, show how it tumbles."""
    history, (fall, *tumbling) = box
    with_deck = Settings(placement=placement)
    assert find_margin(history, fall, with_deck) == find_margin(
        history, fall, Settings()
    )
    longer = 0
    for flight in tumbling:
        without, bounded = (
            find_margin(history, flight, s) for s in (Settings(), with_deck)
        )
        assert without.rotation in ("unseen", None)
        assert bounded.time >= without.time
        longer += bounded.rotation == "any"
        assert (bounded.rotation == "any") == (bounded.time > without.time)
    assert longer >= 3


def test_the_warning_names_the_last_td_or_asks_for_the_deck(
    box: tuple[History, Sequence[Flight]], placement: Placement
) -> None:
    history, (_, flight, *_) = box
    td = float(np.mean(flight.within(history.time)))
    for settings, said in (
        (Settings(), "give the deck"),
        (Settings(placement=placement), "keep td before 0.303"),
    ):
        cautions = suggest_in_history(history, td, settings).cautions
        (message,) = [c.message for c in cautions if c.code == "rotation-unknown"]
        assert said in message
