"""Answers stay the same: faster code must reproduce a table of frozen answers to the digits that users read."""

from typing import NamedTuple

import numpy as np
import pytest

from d2rpick.choice.answers import PairSuggestion, suggest_in_history, suggest_in_run
from d2rpick.choice.pair.candidates import Pair
from d2rpick.choice.question import Settings, read_reference
from d2rpick.histories.history import History
from d2rpick.histories.names import Selection
from tests.command import ROOT
from tests.computed import locate_stored
from tests.energies import suggest_in_window

SAMPLES = {
    "paper": ("energy.csv", Selection()),
    "shell box": ("rollover.csv", Selection(energy=("boxIE_J",))),
    "time history": ("rolloverT01.gz", Selection()),
    "planar box": ("rollover_box.csv", Selection(energy=("internal_energy",))),
    "shell box, parts": ("rolloverT01.gz", Selection(parts=("box",))),
    "planar box, glstat": ("rollover_box.glstat", Selection()),
    "planar box, matsum": ("rollover_box.matsum", Selection(parts=("box",))),
}
# Computed by a solver, in tests/data.
COMPUTED = {
    "chain": ("chain_referenceT01.gz", Selection(parts=("spring1", "spring2"))),
    "oscillator": ("oscillator_referenceT01.gz", Selection()),
    "oscillator S2": ("oscillator_S2_ref.csv.gz", Selection(energy=("IE_J",))),
    "load L1": ("load_L1_ref.csv.gz", Selection(energy=("IE_spring1_J",))),
    "car": ("carT01.gz", Selection(parts=("flying",))),
    "falling box": ("drop2T01.gz", Selection(parts=("flying",))),
}
# Frequencies in the record, their energy fractions, and noise [fraction of the highest energy].
MADE = {
    "one mode": (((4.3, 1.0),), 0.01),
    "two modes": (((3.1, 1.0), (5.7, 0.6)), 0.003),
    "five modes": (
        ((3.1, 1.0), (5.7, 0.7), (9.3, 0.5), (13.9, 0.4), (21.2, 0.3)),
        0.003,
    ),
    "noise": (((2.0, 0.3),), 0.3),
}
STATES = 2500


def make_record(name: str) -> History:
    """Return the damped energy of these modes with white noise."""
    modes, noise = MADE[name]
    time = np.linspace(0.0, 1.0, STATES)
    energy = sum(
        (share * np.sin(2 * np.pi * rate * time + rate) ** 2 for rate, share in modes),
        np.zeros(STATES),
    )
    energy = np.exp(-0.8 * time) * energy
    energy += noise * energy.max() * np.random.default_rng(14).standard_normal(STATES)
    return History(time, energy, source=(name,), format="made", channel="E")


def suggest_for(
    name: str, td: float | tuple[float, float], **arguments: float | bool
) -> PairSuggestion:
    """Choose a pair in a sample or a synthetic record, for one td or for a td range given by its two ends."""
    settings = Settings(**arguments)  # type: ignore[arg-type]
    if name in SAMPLES:
        file, selection = SAMPLES[name]
        return suggest_in_run(
            read_reference([str(ROOT / "sample_data" / file)], selection), td, settings
        )
    if name in COMPUTED:
        file, selection = COMPUTED[name]
        return suggest_in_run(
            read_reference([locate_stored(file)], selection), td, settings
        )
    return (
        suggest_in_window(make_record(name), td, settings)
        if isinstance(td, tuple)
        else suggest_in_history(make_record(name), td, settings)
    )


class RoundedPair(NamedTuple):
    """Times of a pair [s], to six digits, and its residual to three decimals; None if unknown."""

    tr: float
    td: float
    residual: float | None


class FrozenAnswer(NamedTuple):
    """Facts of an answer that users read, rounded as they are printed.

    ``tr_half_width`` is the half width of the interval of the chosen tr [s], None if unknown.  ``candidates`` and
    ``admissible`` are numbers of candidates; ``next_tr`` are the tr of ranks 2 to 4; ``windows`` are start and end of
    the first three windows of acceptable tr [s].
    """

    basis: str
    recommended: RoundedPair | None
    tr_half_width: float | None
    better_pair: RoundedPair | None
    candidates: int
    admissible: int
    next_tr: tuple[float, ...]
    windows: tuple[tuple[float, float], ...]


def summarize(suggestion: PairSuggestion) -> FrozenAnswer:
    """Return the facts of a suggestion that must not change."""
    chosen = suggestion.chosen
    tr_half_width = None
    if chosen and chosen.tr_high and chosen.tr_low:
        tr_half_width = float(f"{(chosen.tr_high - chosen.tr_low) / 2:.1e}")
    candidates = suggestion.candidates
    return FrozenAnswer(
        suggestion.situation.basis,
        _round_pair(suggestion.recommended),
        tr_half_width,
        _round_pair(suggestion.better_pair),
        len(candidates),
        sum(candidate.admissible for candidate in candidates),
        tuple(_round(candidate.tr, 6) for candidate in candidates[1:4]),
        tuple(
            (_round(window.start, 5), _round(window.end, 5))
            for window in (suggestion.windows or ())[:3]
        ),
    )


def _round_pair(pair: Pair | None) -> RoundedPair | None:
    if pair is None:
        return None
    residual = pair.residual
    if residual is not None:
        residual = float(f"{residual:.3f}")
    return RoundedPair(_round(pair.tr, 6), _round(pair.td, 6), residual)


def _round(number: float, digits: int) -> float:
    """Return a number rounded to so many significant digits."""
    return float(f"{number:.{digits}g}")


# fmt: off
FROZEN: list[tuple[str, float | tuple[float, float], dict[str, float | bool], FrozenAnswer]] = [
    (
        "paper", 0.064, {},
        FrozenAnswer(
            basis="oscillator", recommended=RoundedPair(tr=0.0128853, td=0.064, residual=0.957), tr_half_width=1e-07,
            better_pair=RoundedPair(tr=0.0135867, td=0.0687534, residual=0.0),
            candidates=10, admissible=4, next_tr=(0.0247264, 0.0383104, 0.0495088),
            windows=(),
        ),
    ),
    (
        "paper", 0.1, {"margin": 0.005},
        FrozenAnswer(
            basis="oscillator", recommended=RoundedPair(tr=0.0126389, td=0.1, residual=0.99), tr_half_width=1e-07,
            better_pair=RoundedPair(tr=0.013103, td=0.0938997, residual=0.0),
            candidates=15, admissible=7, next_tr=(0.0250568, 0.0378429, 0.050125),
            windows=(),
        ),
    ),
    (
        "paper", (0.06, 0.07), {},
        FrozenAnswer(
            basis="oscillator", recommended=RoundedPair(tr=0.0135867, td=0.0687534, residual=0.0), tr_half_width=1e-07,
            better_pair=RoundedPair(tr=0.0135867, td=0.0687534, residual=0.0),
            candidates=10, admissible=4, next_tr=(0.0238274, 0.0397308, 0.0477726),
            windows=(),
        ),
    ),
    (
        "paper", 0.064, {"replay": False},
        FrozenAnswer(
            basis="energy", recommended=RoundedPair(tr=0.000223445, td=0.064, residual=None), tr_half_width=6.4e-06,
            better_pair=RoundedPair(tr=0.00101301, td=0.0562, residual=None),
            candidates=10, admissible=10, next_tr=(0.0122694, 0.0128831, 0.0247289),
            windows=((0.00017669, 0.00026935), (0.012206, 0.012332), (0.012819, 0.012945)),
        ),
    ),
    (
        "shell box", 0.37, {},
        FrozenAnswer(
            basis="energy", recommended=RoundedPair(tr=0.182002, td=0.37, residual=None), tr_half_width=0.00029,
            better_pair=RoundedPair(tr=0.181405, td=0.36901, residual=None),
            candidates=286, admissible=186, next_tr=(0.18325, 0.183505, 0.18401),
            windows=((0.181, 0.20282), (0.20312, 0.21659), (0.21812, 0.22551)),
        ),
    ),
    (
        "shell box", (0.25, 0.37), {},
        FrozenAnswer(
            basis="energy", recommended=RoundedPair(tr=0.17834, td=0.360472, residual=None), tr_half_width=0.00012,
            better_pair=RoundedPair(tr=0.186924, td=0.362505, residual=None),
            candidates=207, admissible=142, next_tr=(0.178503, 0.179208, 0.179501),
            windows=((0.17783, 0.18697), (0.18756, 0.19383), (0.19542, 0.20081)),
        ),
    ),
    (
        "time history", 0.37, {},
        FrozenAnswer(
            basis="modal",
            recommended=RoundedPair(tr=0.158128, td=0.37, residual=0.618),
            tr_half_width=8e-06,
            better_pair=RoundedPair(tr=0.119306, td=0.372005, residual=0.621),
            candidates=33,
            admissible=32,
            next_tr=(0.122985, 0.120799, 0.121665),
            windows=(),
        ),
    ),
    (
        "planar box", 0.3, {},
        FrozenAnswer(
            basis="modal",
            recommended=RoundedPair(tr=0.19485, td=0.3, residual=0.798),
            tr_half_width=4.6e-05,
            better_pair=RoundedPair(tr=0.124237, td=0.369631, residual=0.629),
            candidates=7,
            admissible=7,
            next_tr=(0.15577, 0.103471, 0.092072),
            windows=(),
        ),
    ),
    (
        "planar box", (0.2, 0.37), {"max_residual": 0.5},
        FrozenAnswer(
            basis="modal",
            recommended=None,
            tr_half_width=None,
            better_pair=None,
            candidates=6,
            admissible=6,
            next_tr=(0.171881, 0.223537, 0.278472),
            windows=(),
        ),
    ),
    (
        "one mode", 0.8, {},
        FrozenAnswer(
            basis="oscillator",
            recommended=RoundedPair(tr=0.0941268, td=0.8, residual=0.705),
            tr_half_width=0.00013,
            better_pair=RoundedPair(tr=0.104731, td=0.828681, residual=0.0),
            candidates=13,
            admissible=6,
            next_tr=(0.168248, 0.329018, 0.398432),
            windows=(),
        ),
    ),
    (
        "one mode", (0.5, 0.9), {},
        FrozenAnswer(
            basis="oscillator",
            recommended=RoundedPair(tr=0.104731, td=0.828681, residual=0.0),
            tr_half_width=0.00013,
            better_pair=RoundedPair(tr=0.104731, td=0.828681, residual=0.0),
            candidates=14,
            admissible=7,
            next_tr=(0.157443, 0.34176, 0.385479),
            windows=(),
        ),
    ),
    (
        "two modes", 0.8, {},
        FrozenAnswer(
            basis="modal",
            recommended=RoundedPair(tr=0.0167014, td=0.8, residual=1.005),
            tr_half_width=0.00069,
            better_pair=RoundedPair(tr=0.0170581, td=0.79952, residual=1.003),
            candidates=10,
            admissible=2,
            next_tr=(0.010989, 0.458145, 0.634926),
            windows=(),
        ),
    ),
    (
        "five modes", 0.8, {},
        FrozenAnswer(
            basis="modal",
            recommended=RoundedPair(tr=0.00524873, td=0.8, residual=0.994),
            tr_half_width=0.00018,
            better_pair=RoundedPair(tr=0.367974, td=0.796719, residual=0.908),
            candidates=22,
            admissible=3,
            next_tr=(0.367824, 0.648679, 0.453742),
            windows=(),
        ),
    ),
    (
        "five modes", 0.8, {"after": 0.1},
        FrozenAnswer(
            basis="modal",
            recommended=RoundedPair(tr=0.367803, td=0.8, residual=0.981),
            tr_half_width=0.00018,
            better_pair=RoundedPair(tr=0.367986, td=0.796719, residual=0.909),
            candidates=19,
            admissible=2,
            next_tr=(0.64867, 0.453752, 0.707517),
            windows=(),
        ),
    ),
    (
        "five modes", 0.77, {"after": 0.2, "strict": True},
        FrozenAnswer(
            basis="modal",
            recommended=RoundedPair(tr=0.449093, td=0.77, residual=0.79),
            tr_half_width=0.00018,
            better_pair=RoundedPair(tr=0.449385, td=0.769108, residual=0.799),
            candidates=14,
            admissible=2,
            next_tr=(0.384841, 0.741731, 0.353862),
            windows=(),
        ),
    ),
    (
        "five modes", 0.8, {"max_kinetic_share": 0.3, "after": 0.1},
        FrozenAnswer(
            basis="modal",
            recommended=None,
            tr_half_width=None,
            better_pair=RoundedPair(tr=0.43301, td=0.726691, residual=0.732),
            candidates=19,
            admissible=2,
            next_tr=(0.64867, 0.453752, 0.707517),
            windows=(),
        ),
    ),
    (
        "noise", 0.8, {},
        FrozenAnswer(
            basis="modal",
            recommended=RoundedPair(tr=0.628818, td=0.8, residual=0.891),
            tr_half_width=0.0012,
            better_pair=RoundedPair(tr=0.629198, td=0.79952, residual=0.888),
            candidates=2,
            admissible=1,
            next_tr=(0.581965,),
            windows=(),
        ),
    ),
    (
        "noise", (0.6, 0.9), {"replay": False, "after": 0.05},
        FrozenAnswer(
            basis="energy", recommended=RoundedPair(tr=0.0508203, td=0.896759, residual=None), tr_half_width=0.00016,
            better_pair=RoundedPair(tr=0.0508203, td=0.896759, residual=None),
            candidates=1081, admissible=989, next_tr=(0.0523772, 0.052421, 0.0524464),
            windows=((0.050542, 0.051014), (0.052089, 0.052614), (0.053954, 0.054064)),
        ),
    ),
    (
        "shell box, parts", 0.37, {},
        FrozenAnswer(
            basis="energy", recommended=RoundedPair(tr=0.0924649, td=0.37, residual=None), tr_half_width=8.6e-05,
            better_pair=RoundedPair(tr=0.093506, td=0.36901, residual=None),
            candidates=286, admissible=280, next_tr=(0.093506, 0.0940106, 0.0973571),
            windows=((0.091005, 0.10943), (0.10991, 0.1309), (0.13182, 0.17525)),
        ),
    ),
    (
        "planar box, glstat", 0.37, {},
        FrozenAnswer(
            basis="modal",
            recommended=RoundedPair(tr=0.123679, td=0.37, residual=0.604),
            tr_half_width=6.3e-05,
            better_pair=RoundedPair(tr=0.123679, td=0.37, residual=0.604),
            candidates=6,
            admissible=6,
            next_tr=(0.170676, 0.222926, 0.27837),
            windows=(),
        ),
    ),
    (
        "planar box, matsum", 0.37, {},
        FrozenAnswer(
            basis="energy", recommended=RoundedPair(tr=0.0970304, td=0.37, residual=None), tr_half_width=0.00016,
            better_pair=RoundedPair(tr=0.0970304, td=0.37, residual=None),
            candidates=35, admissible=31, next_tr=(0.099, 0.100551, 0.123),
            windows=((0.086, 0.37),),
        ),
    ),
    (
        "chain", 0.13505, {},
        FrozenAnswer(
            basis="modal", recommended=RoundedPair(tr=0.0807725, td=0.13505, residual=0.08), tr_half_width=0.00011,
            better_pair=RoundedPair(tr=0.0807735, td=0.135004, residual=0.08),
            candidates=4, admissible=3, next_tr=(0.0457268, 0.0260327, 0.101451),
            windows=(),
        ),
    ),
    (
        "chain", (0.1, 0.2), {},
        FrozenAnswer(
            basis="modal", recommended=RoundedPair(tr=0.0807724, td=0.135054, residual=0.08), tr_half_width=0.00011,
            better_pair=RoundedPair(tr=0.0807735, td=0.135004, residual=0.08),
            candidates=4, admissible=3, next_tr=(0.0457269, 0.0260327, 0.101451),
            windows=(),
        ),
    ),
    (
        "oscillator", 0.064, {},
        FrozenAnswer(
            basis="oscillator", recommended=RoundedPair(tr=0.0128856, td=0.064, residual=0.957), tr_half_width=1.9e-05,
            better_pair=RoundedPair(tr=0.0135875, td=0.068753, residual=0.0),
            candidates=10, admissible=4, next_tr=(0.0247256, 0.0383106, 0.0495077),
            windows=(),
        ),
    ),
    (
        "oscillator S2", 0.055, {},
        FrozenAnswer(
            basis="oscillator", recommended=RoundedPair(tr=0.00762042, td=0.055, residual=0.394), tr_half_width=1.2e-06,
            better_pair=RoundedPair(tr=0.00763041, td=0.0559095, residual=0.0),
            candidates=14, admissible=6, next_tr=(0.014814, 0.0228, 0.0295477),
            windows=(),
        ),
    ),
    (
        "load L1", 0.084, {"after": 0.021},
        FrozenAnswer(
            basis="oscillator", recommended=RoundedPair(tr=0.023572, td=0.084, residual=0.886), tr_half_width=5.4e-07,
            better_pair=RoundedPair(tr=0.0241592, td=0.0793252, residual=0.0),
            candidates=11, admissible=5, next_tr=(0.0351485, 0.0491028, 0.0597998),
            windows=(),
        ),
    ),
    (
        "car", 0.1464, {},
        FrozenAnswer(
            basis="energy", recommended=RoundedPair(tr=0.0385932, td=0.1464, residual=None), tr_half_width=1.6e-05,
            better_pair=RoundedPair(tr=0.0386669, td=0.146717, residual=None),
            candidates=404, admissible=288, next_tr=(0.0387039, 0.0388894, 0.0394147),
            windows=((0.03851, 0.1464),),
        ),
    ),
    (
        "falling box", 0.414, {},
        FrozenAnswer(
            basis="modal",
            recommended=RoundedPair(tr=0.348078, td=0.414, residual=0.731),
            tr_half_width=2.4e-05,
            better_pair=RoundedPair(tr=0.348077, td=0.414006, residual=0.732),
            candidates=11,
            admissible=6,
            next_tr=(0.367969, 0.37957, 0.382922),
            windows=(),
        ),
    ),
    (
        "falling box", 0.27, {},
        FrozenAnswer(
            basis="energy", recommended=RoundedPair(tr=0, td=0.27, residual=None), tr_half_width=2.4e-05,
            better_pair=RoundedPair(tr=0, td=0.270007, residual=None),
            candidates=1, admissible=1, next_tr=(),
            windows=((0, 0.27),),
        ),
    ),
]
# fmt: on


@pytest.mark.slow
@pytest.mark.parametrize(("name", "td", "arguments", "expected"), FROZEN)
def test_an_old_answer_is_given_again(
    name: str,
    td: float | tuple[float, float],
    arguments: dict[str, float | bool],
    expected: FrozenAnswer,
) -> None:
    assert summarize(suggest_for(name, td, **arguments)) == expected
