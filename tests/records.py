"""The paper's energy record as one mode, and records as files give them back."""

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

# y - z = -V0 exp(-alpha t/2) sin(omega t)/omega, eq. (7), with V0 = 6 m/s and k = 660e3 N/m
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


def vibration(parameters: Samples) -> Mode:
    """Mode without plastic work and preload, from omega, alpha, cosine and sine."""
    omega, alpha, cosine, sine = parameters.tolist()
    return Mode(omega, alpha, cosine, sine, 0.0)


def table(
    time: Samples, energy: Samples, *momenta: Momenta, balance: Balance | None = None
) -> History:
    """A record of an energy, with momenta and energies of the model where there are any."""
    return History(
        time, energy, ("made.csv",), "csv", "E", evidence=Given(momenta, balance)
    )


def until(history: History, time: float) -> History:
    """Give what a record was when the run had come to a time."""

    def cut(record: Record) -> Record:
        return select_states(record, record.time <= time)

    momenta, balance = (
        tuple(cut(one) for one in history.momenta),
        history.balance and cut(history.balance),
    )
    return replace(cut(history), evidence=Given(momenta, balance, history.masses))


def printed(values: Samples, digits: int = 6) -> Samples:
    """``values`` as they come back from a file with that many significant digits."""
    return np.array([float(f"{value:.{digits - 1}e}") for value in values])


def noisy(values: Samples, share: float, seed: int) -> Samples:
    """``values`` with white noise whose standard deviation is ``share`` of their maximum."""
    noise = np.random.default_rng(seed).standard_normal(values.size)
    return values + share * float(np.max(values)) * noise


def energy_of(modes: Sequence[Mode], time: Samples) -> Samples:
    """Internal energy that modes make together, each on its own, of the shape of ``time``."""
    return np.asarray(sum(mode.energy(time) for mode in modes))


def level_crossings(modes: Sequence[Mode], td: float, start: float) -> Samples:
    """Times in (start, td) where the energy of these modes passes its level at ``td``, shape (n,)."""
    per_period = 2000  # of the fastest mode: a straight line between such times is exact to 1e-7 of a period
    fastest = max(mode.omega for mode in modes)
    time = np.linspace(
        start, td, int((td - start) * fastest / (2 * np.pi) * per_period) + 2
    )
    crossings = find_crossings(
        time, energy_of(modes, time), float(energy_of(modes, np.array([td]))[0])
    )[0]
    return np.asarray(crossings[crossings < td])


def replayed_residual(
    modes: Mode | Sequence[Mode], tr: Samples, td: Samples | float
) -> Samples:
    """Replay each tr of shape (n,) up to ``td`` and give the residual there, of all modes together [-].

    ``td`` is one for all, or one for each.  Energy norm of what the switched run lacks at td, over that of the
    reference vibration.
    """
    lack, whole = np.zeros(tr.shape), np.zeros(tr.shape)
    for mode in [modes] if isinstance(modes, Mode) else modes:
        oscillator, at_td = make_from_mode(mode, td)
        at_tr = oscillator.free(
            at_td, tr - td
        )  # the closed form runs backwards as well
        lack += compute_lacking_energy(
            oscillator, at_td, oscillator.rigid(at_tr, td - tr)
        )
        whole += oscillator.vibration_energy(at_td)
    return np.sqrt(lack / whole)
