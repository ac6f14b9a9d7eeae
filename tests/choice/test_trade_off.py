"""A trade-off gives every td the same answer as ``suggest``, and marks exactly the Pareto-optimal offers."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from d2rpick.choice.answers import suggest_at, suggest_in_history, suggest_in_run
from d2rpick.choice.pair.quality import rank_candidates
from d2rpick.choice.pair.situation import examine_td
from d2rpick.choice.question import Settings
from d2rpick.choice.td.flights import find_flights
from d2rpick.choice.td.trade_off import Offer, TradeOff, explore_run
from d2rpick.histories.digits import round_as_read
from d2rpick.histories.history import History
from d2rpick.histories.names import Selection
from tests.command import ROOT
from tests.drops import drop, write_run_files
from tests.energies import forget, make_energy_history, make_reference, require
from tests.reading import read

SAMPLES = {"energy.csv": Selection(), "rollover_box.matsum": Selection(parts=("box",))}


def check(
    exploration: TradeOff,
    history: History,
    settings_asked: Settings,
    offers: list[Offer],
) -> None:
    """Compare offers with the answers of ``suggest`` for each single td."""
    for offer in offers:
        alone = suggest_at(examine_td(forget(history), offer.td, settings_asked))
        assert offer.best == alone.chosen
        assert (offer.basis, offer.energy_td, offer.kinetic_share) == (
            alone.situation.basis, alone.situation.energy_td, alone.situation.kinetic_share,
        )  # fmt: skip
        assert offer.answer.windows == alone.windows
        assert offer.answer.expected == alone.expected
        assert offer.quality == alone.quality
        assert offer.answer.why_none == "; ".join(
            it.message for it in alone.cautions if it.code == "no-candidate"
        )
    assert all(low.td < high.td for low, high in pairwise(exploration.offers))
    check_unbeaten(exploration)


def check_unbeaten(exploration: TradeOff) -> None:
    """Compare the Pareto marks with all other offers."""
    for is_vibration_known in (True, False):
        pairs = [
            (
                offer.unbeaten,
                round(offer.error, 3),
                round_as_read(offer.best.rigid_time),
            )
            for offer in exploration.offers
            if offer.best
            and offer.error is not None
            and not offer.best.same_swing
            and (offer.basis != "energy") == is_vibration_known
        ]
        for marked, error, rigid in pairs:
            beaten = any(
                (e < error and r >= rigid) or (e <= error and r > rigid)
                for _, e, r in pairs
            )
            assert marked != beaten


@pytest.mark.parametrize("name", SAMPLES)
def test_every_td_of_a_sample_is_answered_as_suggest_answers_it(name: str) -> None:
    run = read([str(ROOT / "sample_data" / name)], SAMPLES[name])
    exploration = explore_run(run, Settings(), steps=4)
    low, high = exploration.td_window
    cells = np.searchsorted(
        np.linspace(low, high, 5)[1:],
        [offer.td - 1e-12 for offer in exploration.offers],
    )
    assert set(cells.tolist()) == set(range(4))
    assert sum(offer.recommended for offer in exploration.offers) == 1
    check(
        exploration,
        run.history,
        Settings(),
        [*exploration.offers][:: len(exploration.offers) // 2],
    )


def test_a_td_without_a_pair_tells_which_of_its_candidates_was_nearest() -> None:
    """An offer does not keep its candidates, so they must be found again."""
    run = read(["sample_data/energy.csv"])
    exploration = explore_run(run, Settings(), (0.001, 0.07), steps=10)
    without = [offer_row for offer_row in exploration.offers if offer_row.pair is None]
    assert any("the best of " in offer_row.answer.why_none for offer_row in without)
    check(exploration, run.history, Settings(), without)


@st.composite
def histories(draw: st.DrawFn) -> History:
    """Draw the energy of some modes after a load, with or without noise, damping, ringing and a final contact."""
    states = draw(st.integers(60, 250))
    time = np.linspace(0.0, 1.0, states)
    energy = np.zeros(states)
    for _ in range(draw(st.integers(1, 4))):
        rate, share, phase = (
            draw(st.floats(1.5, 12.0)),
            draw(st.floats(0.2, 1.0)),
            draw(st.floats(0.0, 3.1)),
        )
        energy += share * np.sin(2 * np.pi * rate * time + phase) ** 2
    energy *= np.exp(-draw(st.floats(0.0, 1.5)) * time)
    energy[time < draw(st.floats(0.0, 0.3))] += draw(st.floats(0.0, 5.0))
    energy[time > draw(st.floats(0.8, 1.2))] += draw(st.floats(0.0, 5.0))
    noise = np.random.default_rng(draw(st.integers(0, 99))).standard_normal(states)
    share = draw(st.sampled_from([0.0, 0.003, 0.1]))
    return make_energy_history(energy + share * noise, time)


@pytest.mark.parametrize(
    "seed", [9, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 6, 10))]
)
def test_no_td_beats_the_one_that_is_chosen_by_the_level_alone(seed: int) -> None:
    """For forty modes, the oscillator is not tried at every td."""
    rng, time = np.random.default_rng(seed), np.linspace(0, 1, 900)
    energy = sum(
        rng.uniform(0.3, 1) * np.sin(2 * np.pi * cycles * time + rng.uniform(0, 3)) ** 2
        for cycles in rng.uniform(6, 30, 40)
    )
    energy = energy * np.exp(-0.8 * time) + 60 * np.exp(-(((time - 0.06) / 0.01) ** 2))
    exploration = explore_run(
        make_reference(make_energy_history(energy, time)), Settings(), None, steps=40
    )
    assert (
        require(exploration.recommended).basis,
        exploration.suggestion.situation.flight.source,
    ) == ("energy", "energy")
    assert require(exploration.recommended).unbeaten


def test_equal_pairs_do_not_beat_each_other_by_rounding() -> None:
    """From peak to peak of one oscillator, the rigid time is the same except for its last digits."""
    exploration = explore_run(
        read(["sample_data/energy.csv"]), Settings(), None, steps=20
    )
    check_unbeaten(exploration)
    peaks = [
        offer_row
        for offer_row in exploration.offers
        if offer_row.peak and offer_row.best
    ]
    rigid_times = [
        round_as_read(offer_row.best.rigid_time)
        for offer_row in peaks
        if offer_row.best is not None
    ]
    alike = [
        offer_row
        for offer_row, rigid_time in zip(peaks, rigid_times, strict=True)
        if rigid_time == rigid_times[-1]
    ]
    assert len(alike) > 1
    assert {offer_row.unbeaten for offer_row in alike} == {True}


@pytest.mark.slow
@settings(max_examples=2, deadline=None)
@given(histories(), st.floats(0.3, 0.7), st.sampled_from([None, 0.1]))
def test_every_td_of_any_record_is_answered_as_suggest_answers_it(
    history: History, td: float, load_end: float | None
) -> None:
    settings_asked = Settings(after=load_end)
    exploration = explore_run(
        make_reference(history), settings_asked, (td - 0.15, td + 0.15), td=td, steps=6
    )
    assert require(exploration.requested).td == td
    check(
        exploration,
        history,
        settings_asked,
        [require(exploration.requested), *exploration.offers[::6]],
    )


@pytest.mark.slow
@settings(max_examples=10, deadline=None)
@given(histories(), st.floats(0.5, 0.9), st.floats(0.1, 0.45), st.booleans())
def test_candidates_before_the_flight_never_change_what_is_best(
    history: History, td: float, load_end: float, replay: bool
) -> None:
    situation = examine_td(history, td, Settings(after=load_end, replay=replay))
    all_candidates, flying = (
        next(rank_candidates([situation], in_flight=in_flight))
        for in_flight in (False, True)
    )
    assert flying.chosen == all_candidates.chosen
    if situation.basis == "energy":
        assert sorted(flying.tr) == sorted(
            all_candidates.tr[all_candidates.tr >= load_end]
        )


def test_the_flight_beside_a_td_is_the_one_that_suggest_names() -> None:
    """The energy alone shows a different flight for each td; that of the start of the range must not be shown."""
    time = np.linspace(0.0, 1.0, 2001)
    energy = (
        np.exp(-6 * time) * np.sin(250 * time) ** 2
        + 0.4 * np.exp(-3 * time) * np.sin(611 * time) ** 2
    )
    history = make_energy_history(
        energy + 5 * np.exp(-(((time - 0.01) / 0.006) ** 2)), time
    )
    settings_asked = Settings(replay=False)
    alone = suggest_in_history(history, 0.37, settings_asked).situation.flight
    assert alone.source == "energy"
    exploration = explore_run(
        make_reference(history), settings_asked, (0.27, 1.0), td=0.37, steps=4
    )
    assert exploration.situation.flight == alone
    assert (
        explore_run(
            make_reference(history), settings_asked, (0.27, 1.0), steps=4
        ).situation.flight
        != alone
    )


@pytest.mark.slow
def test_the_basis_is_that_of_the_recommended_pair() -> None:
    """The first td of the flight has only one state before it, which must not make a basis unusable."""
    reference = read(["sample_data/rollover_box.matsum"], Selection(parts=("box",)))
    exploration = explore_run(reference, Settings(), steps=20)
    refused = [
        answer_part.situation.vibration.unknown
        for answer_part in (exploration, exploration.suggestion)
    ]
    assert all("deviates systematically" in require(why) for why in refused)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("file", "selection", "window", "steps"),
    [
        ("rollover.csv", Selection(energy=("boxIE_J",)), (0.2, 0.38), 200),
        ("rollover_box.matsum", Selection(parts=("box",)), None, 37),
        ("energy.csv", Selection(), (0.06, 0.07), 37),
    ],
)
def test_no_offer_beats_the_one_that_is_recommended(
    file: str, selection: Selection, window: tuple[float, float] | None, steps: int
) -> None:
    settings_asked = Settings(replay=file == "energy.csv")
    exploration = explore_run(
        read([f"sample_data/{file}"], selection), settings_asked, window, steps=steps
    )
    assert exploration.recommended is not None
    assert exploration.recommended.unbeaten
    if file == "rollover.csv":
        alone = suggest_in_run(
            read([f"sample_data/{file}"], selection), window, settings_asked
        )
        assert (exploration.recommended.tr, exploration.recommended.td) == require(
            alone.recommended
        )[:2]


@pytest.mark.slow
def test_a_level_that_stays_the_same_is_graded_alike_at_each_td() -> None:
    """Plastic energy with a vibration of 1e-4 of it, about half of which is kinetic on both sides of td."""
    time = np.linspace(0, 1, 2001)
    energy = 1000 + 0.05 * np.sin(400 * time) * np.sin(731 * time)
    exploration = explore_run(
        make_reference(make_energy_history(energy, time)),
        Settings(after=0.1, replay=False),
    )
    grades = {
        offer.quality.grade
        for offer in exploration.offers
        if offer.quality and offer.best and not offer.best.same_swing
    }
    assert grades == {"poor"}  # no evidence of the deformation


@pytest.mark.slow
def test_a_td_is_compared_with_others_of_its_own_flight(tmp_path: Path) -> None:
    """Before, it was compared with the td of the longest flight."""
    box = read(write_run_files(drop(), tmp_path), Selection(parts=("box",)))
    plain = Settings(replay=False, min_quality="poor")
    flights = find_flights(box.history, plain)
    assert len(flights) > 1
    for flight in flights:
        start, end = flight.within(box.history.time)
        td = (start + end) / 2
        window = explore_run(box, plain, td=td, steps=10).td_window
        assert start <= window[0] < td < window[1] <= end
