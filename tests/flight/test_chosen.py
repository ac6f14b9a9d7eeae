"""A flight given by the user is used, with a warning that names the contradicting evidence."""

import numpy as np
import pytest

from d2rpick.base.errors import RangeError
from d2rpick.choice.answers import suggest_in_history
from d2rpick.choice.pair.situation import examine_td
from d2rpick.choice.pair.warnings import warn_about_td
from d2rpick.choice.question import Settings
from d2rpick.choice.td.flights import find_flights, find_longest_flight
from d2rpick.histories.history import EXACT, Balance, History, Momenta, Precision
from tests.records import make_table

TIME = np.linspace(0.0, 1.0, 1001)


def make_braked_block(until: float = 1.0) -> History:
    """Return a vibrating block that slides with friction until ``until``."""
    values = np.zeros((TIME.size, 1, 3))
    values[:, 0, 0] = 500 - 40 * np.minimum(TIME, until)
    whole = Momenta(TIME, values, None, EXACT, (0,), masses=np.array([10.0]))
    return make_table(TIME, 5 + 5 * np.sin(30 * TIME) ** 2, whole)


def find_warnings(history: History, td: float, **options: float) -> dict[str, str]:
    return {
        caution.code: caution.message
        for caution in warn_about_td(examine_td(history, td, Settings(**options)))  # type: ignore[arg-type]
    }


def test_an_end_of_the_load_that_is_given_overrules_the_evidence_and_the_warning_names_it() -> (
    None
):
    refused = suggest_in_history(make_braked_block(), 0.8, Settings())
    assert refused.recommended is None
    answer = suggest_in_history(make_braked_block(), 0.8, Settings(after=0.3))
    assert (answer.flight.start, answer.flight.source) == (0.3, "given")
    assert answer.recommended
    assert answer.quality
    assert answer.quality.grade != "good"
    warnings = find_warnings(make_braked_block(), 0.8, after=0.3)
    assert (
        "the momentum shows no free flight at td = 0.8"
        in warnings["flight-sources-disagree"]
    )
    assert "no-free-flight" not in warnings


def test_an_end_of_the_load_before_that_of_the_evidence_is_used_with_a_warning() -> (
    None
):
    history = make_braked_block(until=0.4)
    assert examine_td(history, 0.8, Settings()).flight.start == pytest.approx(
        0.4, abs=0.005
    )
    for load_end, contradicted in ((0.2, True), (0.398, False), (0.5, False)):
        flight = examine_td(history, 0.8, Settings(after=load_end)).flight
        assert (flight.start, flight.source) == (load_end, "given")
        assert flight.certain is not contradicted
        assert bool(flight.doubts) is contradicted
    assert (
        "the momentum shows that the flight begins at 0.4"
        in find_warnings(history, 0.8, after=0.2)["flight-sources-disagree"]
    )


def test_a_landing_behind_a_contact_that_the_evidence_shows_is_used_with_a_warning() -> (
    None
):
    values = np.zeros((TIME.size, 1, 3))
    values[:, 0, 0] = 500 - 40 * np.maximum(TIME - 0.6, 0)
    whole = Momenta(TIME, values, None, EXACT, (0,), masses=np.array([10.0]))
    history = make_table(TIME, 5 + 5 * np.sin(30 * TIME) ** 2, whole)
    for td in (0.5, 0.7):
        flight = examine_td(history, td, Settings(landing=0.8)).flight
        assert flight.end == 0.8
        assert flight.refusal is None
        assert flight.doubts
    assert examine_td(history, 0.85, Settings(landing=0.8)).flight.refusal
    (flight,) = find_flights(history, Settings(landing=0.8))
    assert (flight.end, bool(flight.doubts)) == (0.8, True)


def test_flights_that_are_given_are_listed_and_td_is_chosen_in_them() -> None:
    assert not find_flights(make_braked_block(), Settings())
    (flight,) = find_flights(make_braked_block(), Settings(after=0.3, landing=0.9))
    assert (flight.start, flight.end, flight.source) == (0.3, 0.9, "given")
    assert find_longest_flight(
        make_braked_block(), Settings(after=0.3, landing=0.9)
    ) == (
        0.3,
        0.9,
    )


def test_no_end_of_the_load_is_asked_for_if_the_momentum_denies_every_flight() -> None:
    with pytest.raises(
        RangeError, match="no free flight that lasts at least 5% of the record"
    ) as denied:
        find_longest_flight(make_braked_block(), Settings())
    assert "`after`" not in str(denied.value)
    energy = 5 + 90 * TIME
    with pytest.raises(RangeError, match="end of the load, give it as `after`"):
        find_longest_flight(make_table(TIME, energy), Settings())


@pytest.mark.parametrize(
    ("given", "names"),
    [
        ({"after": 0.3}, "`after`"),
        ({"after": 0.3, "landing": 0.9}, "`after` and `landing`"),
    ],
)
def test_a_flight_that_only_the_user_states_is_the_reason_for_the_verdict(
    given: dict[str, float], names: str
) -> None:
    answer = suggest_in_history(make_braked_block(), 0.8, Settings(**given))  # type: ignore[arg-type]
    assert answer.decision
    assert answer.decision.verdict == "use with care"
    assert answer.decision.reason.startswith(
        f"the motion is good only if the parts fly as you stated with {names}: the flight is used as given, although "
        "the momentum shows no free flight at td = 0.8"
    )


def test_a_message_advises_nothing_that_was_given() -> None:
    """An internal energy that grows shows no flight, whatever the momentum is."""
    flown = np.full((TIME.size, 1, 3), 0.0)
    flown[:, 0, 0] = 50 * np.minimum(TIME, 0.1)
    whole = Momenta(TIME, flown, None, Precision(7), (0,))
    history = make_table(
        TIME,
        5 + 90 * TIME,
        whole,
        balance=Balance(TIME, 5 + 90 * TIME, 200 - 90 * TIME),
    )
    warnings = find_warnings(history, 0.8)
    assert (
        "the momentum is that of free flight at td = 0.8, but the internal energy is not that of a free vibration"
        in warnings["no-free-flight"]
    )
    warnings_with_load_end = find_warnings(history, 0.8, after=0.1)
    assert (
        "is not that of a free vibration"
        in warnings_with_load_end["flight-sources-disagree"]
    )
    assert not [
        message for message in warnings_with_load_end.values() if "`after`" in message
    ]
