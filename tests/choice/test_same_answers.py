"""Answers stay what they were: a table of old ones, to the digits people read, that work on speed must not change."""

import numpy as np
import pytest

from d2rpick.choice.answers import Suggestion, suggest, suggest_of
from d2rpick.choice.question import Settings, read
from d2rpick.histories.history import History
from d2rpick.histories.names import Selection
from tests.command import ROOT
from tests.computed import stored
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
    "five modes": (((3.1, 1.0), (5.7, 0.7), (9.3, 0.5), (13.9, 0.4), (21.2, 0.3)), 0.003),
    "noise": (((2.0, 0.3),), 0.3),
}
STATES = 2500


def made(name: str) -> History:
    """Energy of the modes, damped, with white noise."""
    modes, noise = MADE[name]
    time = np.linspace(0.0, 1.0, STATES)
    energy = sum((share * np.sin(2 * np.pi * rate * time + rate) ** 2 for rate, share in modes), np.zeros(STATES))
    energy = np.exp(-0.8 * time) * energy
    energy += noise * energy.max() * np.random.default_rng(14).standard_normal(STATES)
    return History(time, energy, source=(name,), format="made", channel="E")


def answer(name: str, td: float | tuple[float, float], **asked: float | bool) -> Suggestion:
    """Answer for a sample or a made-up record; a window of td is given by its two ends."""
    settings = Settings(**asked)  # type: ignore[arg-type]
    if name in SAMPLES:
        file, selection = SAMPLES[name]
        return suggest_of(read([str(ROOT / "sample_data" / file)], selection), td, settings)
    if name in COMPUTED:
        file, selection = COMPUTED[name]
        return suggest_of(read([stored(file)], selection), td, settings)
    return suggest_in_window(made(name), td, settings) if isinstance(td, tuple) else suggest(made(name), td, settings)


def digest(found: Suggestion) -> str:
    """What is recommended, how sure it is, and the first of the ranks, to printed digits."""
    pair, better, best = found.recommended, found.better_pair, found.chosen
    parts = [found.situation.basis]
    parts += [f"{pair.tr:.6g} {pair.td:.6g} {_measure(pair.residual)}" if pair else "none"]
    parts += [f"+-{(best.tr_high - best.tr_low) / 2:.1e}" if best and best.tr_high and best.tr_low else "-"]
    parts += [f"{better.tr:.6g} {better.td:.6g} {_measure(better.residual)}" if better else "none"]
    parts += [f"{len(found.candidates)}/{sum(one.acceptable for one in found.candidates)}"]
    parts += [" ".join(f"{one.tr:.6g}" for one in found.candidates[1:4])]
    parts += ["; ".join(f"{one.start:.5g}-{one.end:.5g}" for one in (found.windows or ())[:3])]
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
     ("energy | 0.0960072 0.37 - | +-8.9e-05 | 0.0960072 0.372005 - | "
      "101/95 | 0.0970055 0.0975101 0.102359 | 0.091005-0.37")),
    ("planar box", 0.3, {},
     "energy | 0.0943632 0.3 - | +-4.0e-05 | 0.099 0.296 - | 41/34 | 0.099 0.103275 0.119325 | 0.087-0.3"),
    ("planar box", (0.2, 0.37), {"max_residual": 0.5},
     "energy | none | - | none | 35/30 | 0.099 0.10055 0.123 | "),
    ("one mode", 0.8, {},
     "oscillator | 0.0941268 0.8 0.705 | +-1.3e-04 | 0.104731 0.828681 0.000 | 13/6 | 0.168248 0.329018 0.398432 | "),
    ("one mode", (0.5, 0.9), {},
     ("oscillator | 0.104731 0.828681 0.000 | +-1.3e-04 | 0.104731 0.828681 0.000 | "
     "14/7 | 0.157443 0.34176 0.385479 | ")),
    ("two modes", 0.8, {},
     "oscillator | none | - | 0.0390059 0.750233 0.424 | 9/0 | 0.458137 0.634915 0.362027 | "),
    ("five modes", 0.8, {},
     ("energy | none | - | 0.654662 0.796719 - | "
     "45/0 | 0.646157 0.644658 0.645058 | ")),
    ("five modes", 0.8, {"after": 0.1},
     ("energy | 0.633516 0.8 - | +-2.4e-04 | 0.165315 0.796719 - | "
     "45/36 | 0.646157 0.644658 0.645058 | 0.16565-0.17229; 0.47747-0.48475; 0.62756-0.63922")),
    ("five modes", 0.77, {"after": 0.2, "strict": True},
     ("energy | 0.2027 0.77 - | +-1.0e-04 | 0.203302 0.769108 - | "
      "444/382 | 0.204482 0.204882 0.265566 | 0.2-0.21792; 0.26112-0.38986; 0.42332-0.45083")),
    ("five modes", 0.8, {"max_kinetic_share": 0.3, "after": 0.1},
     "energy | none | - | none | 45/36 | 0.646157 0.644658 0.645058 | "),
    ("noise", 0.8, {},
     "energy | none | - | none | 409/0 | 0.0332585 0.0363682 0.036477 | "),
    ("noise", (0.6, 0.9), {"replay": False, "after": 0.05},
     ("energy | 0.0508203 0.896759 - | +-1.6e-04 | 0.0508203 0.896759 - | "
      "1081/989 | 0.0523772 0.052421 0.0524464 | 0.050542-0.051014; 0.052089-0.052614; 0.053954-0.054064")),
    ("shell box, parts", 0.37, {},
     ("energy | 0.0924649 0.37 - | +-8.6e-05 | 0.093506 0.36901 - | "
      "286/280 | 0.093506 0.0940106 0.0973571 | 0.091005-0.10943; 0.10991-0.1309; 0.13182-0.17525")),
    ("planar box, glstat", 0.37, {},
     ("energy | 0.0960403 0.37 - | +-7.6e-05 | 0.0960403 0.37 - | "
      "39/34 | 0.099 0.101375 0.123 | 0.087-0.37")),
    ("planar box, matsum", 0.37, {},
     ("energy | 0.0970304 0.37 - | +-1.6e-04 | 0.0970304 0.37 - | "
      "35/31 | 0.099 0.100551 0.123 | 0.086-0.37")),
    ("chain", 0.13505, {},
     ("parts | 0.0808313 0.13505 0.065 | +-9.9e-05 | 0.0808313 0.135048 0.065 | "
      "17/4 | 0.0791032 0.135047 0.135048 | ")),
    ("chain", (0.1, 0.2), {},
     ("parts | 0.0808313 0.135048 0.065 | +-9.9e-05 | 0.0808313 0.135048 0.065 | "
      "15/2 | 0.0791032 0.045707 0.0260534 | ")),
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
@pytest.mark.parametrize(("name", "td", "asked", "old"), OLD)
def test_an_old_answer_is_given_again(
    name: str, td: float | tuple[float, float], asked: dict[str, float | bool], old: str
) -> None:
    assert digest(answer(name, td, **asked)) == old
