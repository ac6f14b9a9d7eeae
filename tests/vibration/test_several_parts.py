"""Structures of several parts, judged by the modes that their energies show together."""

import numpy as np
import pytest

from d2rpick.choice.answers import suggest_in_history
from d2rpick.choice.pair.candidates import Candidate, judge_times
from d2rpick.choice.pair.situation import examine_td
from d2rpick.choice.question import Settings
from d2rpick.cli import d2rpick  # noqa: F401  imported first, it sets the threads
from d2rpick.histories.history import History
from d2rpick.histories.opening import Selection, open_run
from tests import chain
from tests.benchmarks.promise_parts import Motion, make_history_of_parts
from tests.command import BOX
from tests.energies import require
from tests.reading import read_solved
from tests.records import add_noise

PLAIN = Settings()
NAMES = ("IE_spring1_J", "IE_spring2_J")
SPAN = np.arange(0, 0.4, 4e-4)
# Rounding of the table of switched runs.
ROUNDING = 1e-3


def is_in_band(true_residual: float, candidate: Candidate) -> bool:
    """Return True if a true residual lies in the band that a candidate states."""
    low = require(candidate.residual_low)
    high = require(candidate.residual_high)
    return low - ROUNDING <= true_residual <= high + ROUNDING


# ---- the chain of a real solver


@pytest.mark.slow
def test_the_residual_of_switched_runs_is_predicted() -> None:
    """All 102 computed pairs lie in their bands, and the worst stated residual is off by 0.015."""
    errors = []
    for td in (chain.TD_PEAK, chain.TD_LATE):
        situation = examine_td(chain.read_chain_history(), td, PLAIN)
        assert situation.basis == "modal"
        for run in chain.scan():
            if abs(run["td_s"] - td) > 1e-3:  # a time step of the solver late
                continue
            (candidate,) = judge_times(situation.at(run["td_s"]), [run["tr_s"]])
            errors.append(abs(require(candidate.residual) - run["R_sim"]))
            assert is_in_band(run["R_sim"], candidate)
    assert len(errors) == len(chain.scan())
    assert max(errors) < 0.025


def read_chain(source: str) -> History:
    """Read the reference run of the chain from its table or from the file of the solver."""
    if source == "csv":
        return chain.read_chain_history()
    return read_solved("chain_referenceT01.gz", "spring1,spring2").history


@pytest.mark.slow
@pytest.mark.parametrize("source", ["csv", "T01"])
def test_the_closest_match_is_recommended_although_the_total_energy_is_off(
    source: str,
) -> None:
    answer = suggest_in_history(read_chain(source), chain.TD_PEAK, PLAIN)
    best = answer.candidates[0]
    assert require(answer.recommended).tr == best.tr == pytest.approx(0.08084, abs=1e-4)
    assert (best.kind, best.sign_match, best.recommended) == ("match", True, True)
    assert is_in_band(0.0655, best)  # residual of the nearest switched run
    assert best.level_error == pytest.approx(0.055, abs=0.01)
    # near the peak itself the energy is right as well, and nothing would be saved
    assert all(c.same_swing for c in answer.candidates if c.tr > 0.13)


@pytest.mark.slow
@pytest.mark.parametrize("source", ["csv", "T01"])
def test_the_recommended_run_is_among_the_best_of_the_scan(source: str) -> None:
    answer = suggest_in_history(read_chain(source), chain.TD_LATE, PLAIN)
    tr = require(answer.recommended).tr
    runs = [run for run in chain.scan() if run["td_s"] > 0.2]
    nearest = min(runs, key=lambda run: abs(run["tr_s"] - tr))
    assert nearest["R_sim"] <= min(run["R_sim"] for run in runs) + 0.05


def test_a_tr_of_the_wrong_direction_is_refused_in_every_switched_run() -> None:
    """A pair with the wrong sign in both springs has a true residual above 1, and is never admissible."""
    upside_down = [run for run in chain.scan() if run["sign1"] < 0 and run["sign2"] < 0]
    assert upside_down
    for run in upside_down[::4]:
        situation = examine_td(chain.read_chain_history(), run["td_s"], PLAIN)
        (candidate,) = judge_times(situation, [run["tr_s"]])
        assert run["R_sim"] > 1
        assert require(candidate.residual) > 1
        assert not candidate.admissible


# ---- energies of parts


def test_several_energies_are_summed() -> None:
    history = chain.read_chain_history()
    table = np.stack([chain.read_chain_history(name).energy for name in NAMES], axis=1)
    np.testing.assert_array_equal(table.sum(axis=1), history.energy)


def test_the_rollover_is_judged_by_its_modes() -> None:
    selection = Selection(parts=("box,step",))
    run = open_run([BOX], selection)
    answer = suggest_in_history(run.history(selection), 0.37, PLAIN)
    assert answer.situation.basis == "modal"
    assert answer.candidates[0].sign_match


def make_motion_in_planes(share: float) -> Motion:
    """Return a part A that bends in two planes, the second with ``share`` of its energy, and a part B with one mode."""
    forms = np.array([np.diag([1 - share, share, 0.0]), np.diag([0.0, 0.0, 0.5])])
    return Motion(
        7.7,
        2 * np.pi * np.array([29.2, 70.1, 48.76]),
        np.array([2.95, 4.64, -0.82]),
        forms,
    )


def make_history_of_motion(motion: Motion, noise: float = 0.0) -> History:
    """Return the energies of the parts of a motion, with noise of this share of the highest energy."""
    rows = [add_noise(row, noise, seed=2) for row in motion.energies(SPAN).T]
    return make_history_of_parts(SPAN, np.maximum(np.stack(rows, axis=1), 0.0))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("share", "noise"),
    [(5e-4, 0.0), (0.003, 0.0), (0.03, 0.0), (0.03, 2e-3), (0.45, 2e-3)],
)
def test_of_a_part_that_bends_in_two_planes_the_residual_is_in_its_range(
    share: float, noise: float
) -> None:
    """The energy of a part is then not a square, but the modes of the whole structure give the residual."""
    truth, td = make_motion_in_planes(share), 0.31
    answer = suggest_in_history(
        make_history_of_motion(truth, noise), td, Settings(after=0.0)
    )
    assert answer.situation.basis == "modal"
    for candidate in answer.candidates[:6]:
        assert (
            require(candidate.residual_low) - 0.05
            <= truth.residual(candidate.tr, td)
            <= require(candidate.residual_high) + 0.05
        )


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_parts_of_a_larger_structure_promise_nothing(seed: int) -> None:
    """Their energies are not those of a whole structure: what is stated is right, or the pair is not to be used."""
    random = np.random.default_rng(seed)
    rows = random.uniform(-1, 1, (2, 3))
    forms = np.einsum("pi,pj->pij", rows, rows)
    rate = 2 * np.pi * random.uniform(20, 70, 3)
    truth = Motion(3.0, rate, random.uniform(0, 2 * np.pi, 3), forms)
    answer = suggest_in_history(
        make_history_of_motion(truth), 0.31, Settings(after=0.0)
    )
    for candidate in answer.candidates[:6]:
        is_stated = candidate.residual is not None and candidate.acceptable
        assert not is_stated or is_in_band(
            truth.residual(candidate.tr, 0.31), candidate
        )
