"""Vibration modes, the paper's energy history as one mode, and histories rounded as files store them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from hypothesis import strategies as st

from d2rpick.histories.history import (
    Balance,
    Given,
    History,
    Momenta,
    Record,
    Samples,
    select_states,
)
from d2rpick.histories.samples import find_crossings
from d2rpick.vibration.modes import Mode
from d2rpick.vibration.oscillator import compute_lacking_energy, make_from_mode
from tests import paper

# y - z = -V0 exp(-alpha t/2) sin(omega t)/omega, eq. (7), with V0 = 6 m/s and k = 660e3 N/m.
MODE = Mode(paper.OMEGA_2, 50.0, 0.0, -6.0 / paper.OMEGA_2 * (660e3 / 2) ** 0.5, 0.0)
MODES = st.builds(
    Mode,
    omega=st.floats(1, 50),
    alpha=st.floats(0, 2),
    cosine=st.floats(-2, 2),
    sine=st.floats(0.1, 2),
    origin=st.floats(-1, 1),
    preload=st.one_of(st.just(0.0), st.floats(-1, 1)),
)
TIME: Samples = np.linspace(0.0, 0.15, 1501)
ENERGY: Samples = MODE.energy(TIME)


def make_mode(parameters: Samples) -> Mode:
    """Return a mode without plastic work and preload, given omega, alpha and the cosine and sine amplitudes."""
    omega, alpha, cosine, sine = parameters.tolist()
    return Mode(omega, alpha, cosine, sine, 0.0)


def make_table(
    time: Samples, energy: Samples, *momenta: Momenta, balance: Balance | None = None
) -> History:
    """Return an energy history, with momenta and energies of the model if they are given."""
    return History(
        time, energy, ("made.csv",), "csv", "E", evidence=Given(momenta, balance)
    )


def cut_history(history: History, time: float) -> History:
    """Return the history as it was when the run had reached ``time``."""

    def cut(record: Record) -> Record:
        return select_states(record, record.time <= time)

    momenta, balance = (
        tuple(cut(momenta_of_all) for momenta_of_all in history.momenta),
        history.balance and cut(history.balance),
    )
    return replace(cut(history), evidence=Given(momenta, balance, history.masses))


def round_as_printed(values: Samples, digits: int = 6) -> Samples:
    """Return ``values`` rounded to this number of significant digits, as a file stores them."""
    return np.array([float(f"{value:.{digits - 1}e}") for value in values])


def add_noise(values: Samples, share: float, seed: int) -> Samples:
    """Return ``values`` with white noise whose standard deviation is the fraction ``share`` of their maximum."""
    noise = np.random.default_rng(seed).standard_normal(values.size)
    return values + share * float(np.max(values)) * noise


def sum_energies(modes: Sequence[Mode], time: Samples) -> Samples:
    """Return the sum of the internal energies of the modes, in the shape of ``time``."""
    return np.asarray(sum(mode.energy(time) for mode in modes))


def find_level_crossings(modes: Sequence[Mode], td: float, start: float) -> Samples:
    """Return the times in (start, td) at which the energy of these modes equals its level at ``td``, shape (n,)."""
    per_period = 2000  # samples per period of the fastest mode: linear interpolation is then exact to 1e-7 of a period
    fastest = max(mode.omega for mode in modes)
    time = np.linspace(
        start, td, int((td - start) * fastest / (2 * np.pi) * per_period) + 2
    )
    crossings = find_crossings(
        time, sum_energies(modes, time), float(sum_energies(modes, np.array([td]))[0])
    )[0]
    return np.asarray(crossings[crossings < td])


def compute_replayed_residual(
    modes: Mode | Sequence[Mode], tr: Samples, td: Samples | float
) -> Samples:
    """Replay each tr of shape (n,) up to ``td`` and return the residual of all modes together there [-].

    ``td`` is one for all, or one for each.  Energy norm of what the switched run lacks at td, over that of the
    reference vibration.
    """
    lack, whole = np.zeros(tr.shape), np.zeros(tr.shape)
    for mode in [modes] if isinstance(modes, Mode) else modes:
        oscillator, at_td = make_from_mode(mode, td)
        at_tr = oscillator.free(at_td, tr - td)  # the closed form runs backwards too
        lack += compute_lacking_energy(
            oscillator, at_td, oscillator.rigid(at_tr, td - tr)
        )
        whole += oscillator.vibration_energy(at_td)
    return np.sqrt(lack / whole)
