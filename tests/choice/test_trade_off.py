"""Every td of a trade-off is answered as ``suggest`` answers it, and what is marked as unbeaten is."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from d2rpick.choice.answers import suggest, suggest_at, suggest_of
from d2rpick.choice.quality import candidates_at
from d2rpick.choice.question import Settings
from d2rpick.choice.situation import examine
from d2rpick.choice.trade_off import Offer, TradeOff, explore_of
from d2rpick.histories.digits import round_as_read
from d2rpick.histories.history import History
from d2rpick.histories.names import Selection
from d2rpick.vibration.span import Fits
from tests.command import ROOT
from tests.energies import of, reference, sure
from tests.reading import read

SAMPLES = {"energy.csv": Selection(), "rollover_box.matsum": Selection(parts=("box",))}


def check(
    found: TradeOff, history: History, asked: Settings, offers: list[Offer]
) -> None:
    """Hold offers against what ``suggest`` says of their td, asked for it alone."""
    for one in offers:
        alone = suggest_at(examine(history, one.td, asked, Fits()))
        assert one.best == alone.chosen
        assert (one.basis, one.energy_td, one.kinetic_share) == (
            alone.situation.basis, alone.situation.energy_td, alone.situation.kinetic_share,
        )  # fmt: skip
        assert one.answer.windows == alone.windows
        assert one.answer.expected == alone.expected
        assert one.quality == alone.quality
        assert one.answer.why_none == "; ".join(
            it.message for it in alone.cautions if it.code == "no-candidate"
        )
    assert all(low.td < high.td for low, high in pairwise(found.offers))
    unbeaten(found)


def unbeaten(found: TradeOff) -> None:
    """Hold the marks against every other offer."""
    for known in (True, False):
        pairs = [
            (one.unbeaten, round(one.error, 3), round_as_read(one.best.rigid_time))
            for one in found.offers
            if one.best
            and one.error is not None
            and not one.best.same_swing
            and (one.basis != "energy") == known
        ]
        for marked, error, rigid in pairs:
            beaten = any(
                (e < error and r >= rigid) or (e <= error and r > rigid)
                for _, e, r in pairs
            )
            assert marked != beaten


@pytest.mark.parametrize("name", SAMPLES)
def test_every_td_of_a_sample_is_answered_as_suggest_answers_it(name: str) -> None:
    known = read([str(ROOT / "sample_data" / name)], SAMPLES[name])
    found = explore_of(known, Settings(), steps=4)
    low, high = found.td_window
    cells = np.searchsorted(
        np.linspace(low, high, 5)[1:], [one.td - 1e-12 for one in found.offers]
    )
    assert set(cells.tolist()) == set(range(4))
    assert sum(one.recommended for one in found.offers) == 1
    check(found, known.history, Settings(), [*found.offers][:: len(found.offers) // 2])


def test_a_td_without_a_pair_tells_which_of_its_candidates_was_nearest() -> None:
    """An offer holds none of them: they are looked for again."""
    known = read(["sample_data/energy.csv"])
    found = explore_of(known, Settings(), (0.001, 0.07), steps=10)
    without = [one for one in found.offers if one.pair is None]
    assert any("the nearest, tr = " in one.answer.why_none for one in without)
    check(found, known.history, Settings(), without)


@st.composite
def histories(draw: st.DrawFn) -> History:
    """Energy of some modes after a load that may ring, with or without noise, damping and a contact at the end."""
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
    return of(energy + share * noise, time)


@pytest.mark.parametrize(
    "seed", [9, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 6, 10))]
)
def test_no_td_beats_the_one_that_is_chosen_by_the_level_alone(seed: int) -> None:
    """Of forty modes, for whose td an oscillator is not sought everywhere."""
    rng, time = np.random.default_rng(seed), np.linspace(0, 1, 900)
    energy = sum(
        rng.uniform(0.3, 1) * np.sin(2 * np.pi * cycles * time + rng.uniform(0, 3)) ** 2
        for cycles in rng.uniform(6, 30, 40)
    )
    energy = energy * np.exp(-0.8 * time) + 60 * np.exp(-(((time - 0.06) / 0.01) ** 2))
    found = explore_of(reference(of(energy, time)), Settings(), None, steps=40)
    assert (
        sure(found.recommended).basis,
        found.suggestion.situation.flight.source,
    ) == ("energy", "energy")
    assert sure(found.recommended).unbeaten


def test_equal_pairs_do_not_beat_each_other_by_rounding() -> None:
    """From peak to peak of one oscillator the rigid time is the same, but for its last digits."""
    found = explore_of(read(["sample_data/energy.csv"]), Settings(), None, steps=20)
    unbeaten(found)
    peaks = [one for one in found.offers if one.peak and one.best]
    rigid_times = [
        round_as_read(one.best.rigid_time) for one in peaks if one.best is not None
    ]
    alike = [
        one
        for one, rigid_time in zip(peaks, rigid_times, strict=True)
        if rigid_time == rigid_times[-1]
    ]
    assert len(alike) > 1
    assert {one.unbeaten for one in alike} == {True}


@pytest.mark.slow
@settings(max_examples=2, deadline=None)
@given(histories(), st.floats(0.3, 0.7), st.sampled_from([None, 0.1]))
def test_every_td_of_any_record_is_answered_as_suggest_answers_it(
    history: History, td: float, after: float | None
) -> None:
    asked = Settings(after=after)
    found = explore_of(
        reference(history), asked, (td - 0.15, td + 0.15), td=td, steps=6
    )
    assert sure(found.asked).td == td
    check(found, history, asked, [sure(found.asked), *found.offers[::6]])


@pytest.mark.slow
@settings(max_examples=10, deadline=None)
@given(histories(), st.floats(0.5, 0.9), st.floats(0.1, 0.45), st.booleans())
def test_candidates_before_the_flight_never_change_what_is_best(
    history: History, td: float, after: float, replay: bool
) -> None:
    situation = examine(history, td, Settings(after=after, replay=replay))
    every, flying = (
        next(candidates_at([situation], in_flight=one)) for one in (False, True)
    )
    assert flying.chosen == every.chosen
    if situation.basis == "energy":
        assert sorted(flying.tr) == sorted(every.tr[every.tr >= after])


def test_the_flight_beside_a_td_is_the_one_that_suggest_names() -> None:
    """The energy alone shows another flight to each td; that of the window's start was shown."""
    time = np.linspace(0.0, 1.0, 2001)
    energy = (
        np.exp(-6 * time) * np.sin(250 * time) ** 2
        + 0.4 * np.exp(-3 * time) * np.sin(611 * time) ** 2
    )
    history = of(energy + 5 * np.exp(-(((time - 0.01) / 0.006) ** 2)), time)
    asked = Settings(replay=False)
    alone = suggest(history, 0.37, asked).situation.flight
    assert alone.source == "energy"
    found = explore_of(reference(history), asked, (0.27, 1.0), td=0.37, steps=4)
    assert found.situation.flight == alone
    assert (
        explore_of(reference(history), asked, (0.27, 1.0), steps=4).situation.flight
        != alone
    )


@pytest.mark.slow
def test_the_basis_is_that_of_the_recommended_pair() -> None:
    """The first td of the flight has a single state before it, which is no reason why a basis is refused."""
    reference = read(["sample_data/rollover_box.matsum"], Selection(parts=("box",)))
    found = explore_of(reference, Settings(), steps=20)
    refused = [of.situation.vibration.unknown for of in (found, found.suggestion)]
    assert all("deviates systematically" in sure(why) for why in refused)


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
    asked = Settings(replay=file == "energy.csv")
    found = explore_of(
        read([f"sample_data/{file}"], selection), asked, window, steps=steps
    )
    assert found.recommended is not None
    assert found.recommended.unbeaten
    if file == "rollover.csv":
        alone = suggest_of(read([f"sample_data/{file}"], selection), window, asked)
        assert (found.recommended.tr, found.recommended.td) == sure(alone.recommended)[
            :2
        ]


@pytest.mark.slow
def test_a_level_that_stays_the_same_is_graded_alike_at_each_td() -> None:
    """Plastic energy with a vibration of a ten-thousandth: about half of it is kinetic, whichever side of it td is."""
    time = np.linspace(0, 1, 2001)
    energy = 1000 + 0.05 * np.sin(400 * time) * np.sin(731 * time)
    found = explore_of(reference(of(energy, time)), Settings(after=0.1, replay=False))
    grades = {
        one.quality.grade
        for one in found.offers
        if one.quality and one.best and not one.best.same_swing
    }
    assert grades == {"poor"}  # nothing tells the deformation
