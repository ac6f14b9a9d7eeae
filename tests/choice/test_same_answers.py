"""Answers stay what they were: a table of old ones, to the digits people read, that work on speed must not change."""

import numpy as np
import pytest

from d2rpick.choice.answers import Suggestion, suggest, suggest_of
from d2rpick.choice.question import Settings, read
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
# Frequencies in the record and shares of their energies, and noise [of the highest energy].
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


def made(name: str) -> History:
    """Energy of the modes, damped, with white noise."""
    modes, noise = MADE[name]
    time = np.linspace(0.0, 1.0, STATES)
    energy = sum(
        (share * np.sin(2 * np.pi * rate * time + rate) ** 2 for rate, share in modes),
        np.zeros(STATES),
    )
    energy = np.exp(-0.8 * time) * energy
    energy += noise * energy.max() * np.random.default_rng(14).standard_normal(STATES)
    return History(time, energy, source=(name,), format="made", channel="E")


def answer(
    name: str, td: float | tuple[float, float], **arguments: float | bool
) -> Suggestion:
    """Answer for a sample or a made-up record; a window of td is given by its two ends."""
    settings = Settings(**arguments)  # type: ignore[arg-type]
    if name in SAMPLES:
        file, selection = SAMPLES[name]
        return suggest_of(
            read([str(ROOT / "sample_data" / file)], selection), td, settings
        )
    if name in COMPUTED:
        file, selection = COMPUTED[name]
        return suggest_of(read([locate_stored(file)], selection), td, settings)
    return (
        suggest_in_window(made(name), td, settings)
        if isinstance(td, tuple)
        else suggest(made(name), td, settings)
    )


def digest(found: Suggestion) -> str:
    """What is recommended, how sure it is, and the first of the ranks, to printed digits."""
    pair, better, best = found.recommended, found.better_pair, found.chosen
    parts = [found.situation.basis]
    parts += [
        f"{pair.tr:.6g} {pair.td:.6g} {_measure(pair.residual)}" if pair else "none"
    ]
    parts += [
        f"+-{(best.tr_high - best.tr_low) / 2:.1e}"
        if best and best.tr_high and best.tr_low
        else "-"
    ]
    parts += [
        f"{better.tr:.6g} {better.td:.6g} {_measure(better.residual)}"
        if better
        else "none"
    ]
    parts += [
        f"{len(found.candidates)}/{sum(one.acceptable for one in found.candidates)}"
    ]
    parts += [" ".join(f"{one.tr:.6g}" for one in found.candidates[1:4])]
    parts += [
        "; ".join(f"{one.start:.5g}-{one.end:.5g}" for one in (found.windows or ())[:3])
    ]
    return " | ".join(parts)


def _measure(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"


# fmt: off
OLD: list[tuple[str, float | tuple[float, float], dict[str, float | bool], str]] = [
    ("paper", 0.064, {},
     ("oscillator | 0.0128853 0.064 0.957 | +-1.0e-07 | 0.0135867 0.0687534 0.000 | "
     "10/4 | 0.0247264 0.0383104 0.0495088 | ")),
    ("paper", 0.1, {"margin": 0.005},
     ("oscillator | 0.0126389 0.1 0.990 | +-1.0e-07 | 0.013103 0.0938997 0.000 | "
     "15/7 | 0.0250568 0.0378429 0.050125 | ")),
    ("paper", (0.06, 0.07), {},
     ("oscillator | 0.0135867 0.0687534 0.000 | +-1.0e-07 | 0.0135867 0.0687534 0.000 | "
     "10/4 | 0.0238274 0.0397308 0.0477726 | ")),
    ("paper", 0.064, {"replay": False},
     ("energy | 0.000223445 0.064 - | +-6.4e-06 | 0.00101301 0.0562 - | "
     "10/10 | 0.0122694 0.0128831 0.0247289 | 0.00017669-0.00026935; 0.012206-0.012332; 0.012819-0.012945")),
    ("shell box", 0.37, {},
     ("energy | 0.182002 0.37 - | +-2.9e-04 | 0.181405 0.36901 - | "
     "286/186 | 0.18325 0.183505 0.18401 | 0.181-0.20282; 0.20312-0.21659; 0.21812-0.22551")),
    ("shell box", (0.25, 0.37), {},
     ("energy | 0.17834 0.360472 - | +-1.2e-04 | 0.186924 0.362505 - | "
      "207/142 | 0.178503 0.179208 0.179501 | 0.17783-0.18697; 0.18756-0.19383; 0.19542-0.20081")),
    ("time history", 0.37, {},
     ("modal | 0.158046 0.37 0.605 | +-3.2e-05 | 0.119338 0.372005 "
      "0.616 | 32/31 | 0.123033 0.12079 0.0928778 | ")),
    ("planar box", 0.3, {},
     "modal | 0.101608 0.3 0.739 | +-4.3e-04 | 0.094112 0.296 0.591 | 5/5 | 0.195026 0.155497 0.240945 | "),
    ("planar box", (0.2, 0.37), {"max_residual": 0.5},
     "modal | none | - | 0.0983731 0.197 0.497 | 6/6 | 0.123891 0.222688 0.278399 | "),
    ("one mode", 0.8, {},
     "oscillator | 0.0941268 0.8 0.705 | +-1.3e-04 | 0.104731 0.828681 0.000 | 13/6 | 0.168248 0.329018 0.398432 | "),
    ("one mode", (0.5, 0.9), {},
     ("oscillator | 0.104731 0.828681 0.000 | +-1.3e-04 | 0.104731 0.828681 0.000 | "
     "14/7 | 0.157443 0.34176 0.385479 | ")),
    ("two modes", 0.8, {},
     "modal | 0.0166974 0.8 1.005 | +-2.7e-03 | 0.0170545 0.79952 1.003 | 10/2 | 0.010989 0.45814 0.634973 | "),
    ("five modes", 0.8, {},
     ("modal | 0.00523426 0.8 0.995 | +-7.4e-04 | 0.367984 0.796719 "
      "0.908 | 22/3 | 0.367837 0.648681 0.45376 | ")),
    ("five modes", 0.8, {"after": 0.1},
     ("modal | 0.367833 0.8 0.981 | +-7.4e-04 | 0.368012 0.796719 0.908 "
      "| 19/2 | 0.648665 0.45374 0.707527 | ")),
    ("five modes", 0.77, {"after": 0.2, "strict": True},
     ("modal | 0.44908 0.77 0.790 | +-7.4e-04 | 0.449371 0.769108 0.799 "
      "| 14/2 | 0.384841 0.741723 0.35389 | ")),
    ("five modes", 0.8, {"max_kinetic_share": 0.3, "after": 0.1},
     "modal | none | - | 0.433002 0.726691 0.731 | 19/2 | 0.648665 0.45374 0.707527 | "),
    ("noise", 0.8, {},
     "modal | 0.628692 0.8 0.892 | +-4.8e-03 | 0.629077 0.79952 0.889 | 2/1 | 0.581965 | "),
    ("noise", (0.6, 0.9), {"replay": False, "after": 0.05},
     ("energy | 0.0508203 0.896759 - | +-1.6e-04 | 0.0508203 0.896759 - | "
      "1081/989 | 0.0523772 0.052421 0.0524464 | 0.050542-0.051014; 0.052089-0.052614; 0.053954-0.054064")),
    ("shell box, parts", 0.37, {},
     ("energy | 0.0924649 0.37 - | +-8.6e-05 | 0.093506 0.36901 - | "
      "286/280 | 0.093506 0.0940106 0.0973571 | 0.091005-0.10943; 0.10991-0.1309; 0.13182-0.17525")),
    ("planar box, glstat", 0.37, {},
     ("modal | 0.123654 0.37 0.623 | +-4.3e-04 | 0.123654 0.37 0.623 "
      "| 6/6 | 0.170694 0.222715 0.278342 | ")),
    ("planar box, matsum", 0.37, {},
     ("energy | 0.0970304 0.37 - | +-1.6e-04 | 0.0970304 0.37 - | "
      "35/31 | 0.099 0.100551 0.123 | 0.086-0.37")),
    ("chain", 0.13505, {},
     ("parts | 0.0808313 0.13505 0.065 | +-9.9e-05 | 0.0808327 0.135004 "
      "0.066 | 24/4 | 0.0790052 0.134987 0.135004 | ")),
    ("chain", (0.1, 0.2), {},
     ("parts | 0.0808327 0.135004 0.066 | +-9.9e-05 | 0.0808327 0.135004 "
      "0.066 | 22/2 | 0.0790052 0.0457062 0.0260541 | ")),
    ("oscillator", 0.064, {},
     ("oscillator | 0.0128856 0.064 0.957 | +-1.9e-05 | 0.0135875 0.068753 0.000 | "
      "10/4 | 0.0247256 0.0383106 0.0495077 | ")),
    ("oscillator S2", 0.055, {},
     ("oscillator | 0.00762042 0.055 0.394 | +-1.2e-06 | 0.00763041 0.0559095 0.000 | "
      "14/6 | 0.014814 0.0228 0.0295477 | ")),
    ("load L1", 0.084, {"after": 0.021},
     ("oscillator | 0.023572 0.084 0.886 | +-5.4e-07 | 0.0241592 0.0793252 0.000 | "
      "11/5 | 0.0351485 0.0491028 0.0597998 | ")),
    ("car", 0.1464, {},
     ("energy | 0.0385932 0.1464 - | +-1.6e-05 | 0.0386669 0.146717 - | "
      "404/288 | 0.0387039 0.0388894 0.0394147 | 0.03851-0.1464")),
    ("falling box", 0.414, {},
     ("energy | 0.344005 0.414 - | +-1.0e-04 | 0.344005 0.414006 - | "
      "116/87 | 0.353181 0.353204 0.353231 | 0.3396-0.33981; 0.34153-0.34913")),
    ("falling box", 0.27, {},
     "energy | 0 0.27 - | +-2.4e-05 | 0 0.270007 - | 1/1 |  | 0-0.27"),
]
# fmt: on


@pytest.mark.slow
@pytest.mark.parametrize(("name", "td", "arguments", "old"), OLD)
def test_an_old_answer_is_given_again(
    name: str,
    td: float | tuple[float, float],
    arguments: dict[str, float | bool],
    old: str,
) -> None:
    assert digest(answer(name, td, **arguments)) == old
