"""Identify the single vibration mode in an internal energy history, or find the reason why there is none."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.tuples import NamedTuple
from d2rpick.vibration import fitting
from d2rpick.vibration.fitting import MAX_MISFIT
from d2rpick.vibration.modes import (
    SOLVER_FLOOR,
    Mode,
    prepare_energy_and_jacobian,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from numpy.typing import NDArray

    from d2rpick.histories.history import Samples

# A fit to 400 samples is refused at once if it leaves more than this fraction of the variance unexplained [-].
HOPELESS: Final = 0.5**2
# A systematic misfit larger than this fraction of the fitted energy at the same time indicates a second mode [-].
MAX_LOCAL_STRUCTURE: Final = 0.1
# Smallest number of samples to which a mode is fitted, four for each parameter of the largest model.
MIN_SAMPLES: Final = 24
# Smallest number of samples per energy period pi / omega; with fewer, aliasing may make a fast mode look slow.
MIN_SAMPLES_PER_PERIOD: Final = 10
# Largest accepted growth exponent -alpha t over the record length t [-]; noise may cause an apparent growth.
MAX_GROWTH: Final = 0.3
# Most negative accepted plastic work, as a fraction of the energy range [-]; fitting errors may make it negative.
MIN_PLASTIC: Final = -0.05
# If a vibration without preload has a misfit of at most this, the misfit is attributed to a stiffening spring [-].
MAX_OF_SPRING: Final = 0.1
# Assumed hidden fraction of the vibration energy if a stiffening spring replaces a preload [-].
_OF_A_PRELOAD: Final = 0.03

# Number of parameters of each model, and number of periods needed to identify the model; the simplest comes first.
_MODELS: Final = (
    (fitting.VIBRATION, 1.25),
    (fitting.WITH_PLASTIC, 1.5),
    (fitting.WITH_PRELOAD, 2.0),
)


class Identification(NamedTuple):
    """A mode fitted to an energy history, and whether it describes the history.

    Parameters
    ----------
    mode : Mode or None
        The least-squares fit, even if it was refused; None if nothing could be fitted.
    describes_record : bool
        True when the fit was accepted.
    reason : str or None
        Reason why the fit was refused; None if it was accepted.
    misfit : float or None
        rms(E - fit) / std(E) over the window [-].
    rms : float
        rms(E - fit) [energy]; NaN if there is no mode.
    structure : float
        Part of ``rms`` that neighbouring samples share, beyond that of white noise [energy]; NaN if there is no mode.
    start, end : float
        Window of the fit [time].
    covariance : array of shape (p, p)
        Covariance of the parameters in the order of ``mode.energy_gradient``, for independent errors of the samples.
    vibration : float
        Root mean square of the vibration energy over the window [energy]; NaN if there is no mode.
    hidden_share : float
        Fraction of the vibration energy that a hidden further mode may have [-]; zero if no further mode was tested.
    deviation_times, deviations : array of shape (d,)
        Some times [time], and by how much the energy near them deviates from the fit beyond noise [energy]; empty if
        not measured.
    follows : bool
        True if the fit follows the samples, whether or not it is plausible.
    plausible : bool
        True if the fitted parameters are those of a free vibration, whether or not the fit follows the samples.
    """

    mode: Mode | None
    describes_record: bool
    reason: str | None
    misfit: float | None
    rms: float
    structure: float
    start: float
    end: float
    covariance: Samples
    vibration: float = np.nan
    hidden_share: float = 0.0
    deviation_times: Samples = np.zeros(0)
    deviations: Samples = np.zeros(0)
    follows: bool = False
    plausible: bool = False

    def energy_deviation(self, times: Samples | float) -> Samples:
        """Return the standard deviation of the fitted energy at ``times`` [energy]; NaN if there is no mode.

        It is computed to first order in the parameter errors, as the root of the diagonal of J C J^T.
        """
        t = np.atleast_1d(np.asarray(times, dtype=np.float64))
        if self.mode is None:
            return np.full(t.shape, np.nan)
        jacobian = self.mode.energy_gradient(t, len(self.covariance))
        variance: Samples = np.sum(jacobian * (self.covariance @ jacobian), axis=0)
        return np.sqrt(np.maximum(variance, 0.0))


def identify(
    time: Samples,
    energy: Samples,
    *,
    quick: bool = False,
    rates: NDArray[np.complex128] | None = None,
) -> Identification:
    """Fit a vibration to E(t), if necessary one with plastic work or, failing that, a preload, and judge the fit.

    Parameters
    ----------
    time : array of shape (n,)
        Strictly increasing, equidistant or not [time].
    energy : array of shape (n,)
        Internal energy [energy]; it may be zero or negative, because some solvers write such values.
    quick : bool
        Refuse the record as soon as a few samples show that no model follows it; no fit to all samples is then made.
    rates : array of shape (k,), optional
        The result of `find_rates` for these samples, if it is known.

    Returns
    -------
    Identification
        The accepted fit, or the reason why no model describes the record; no error is raised.

    Notes
    -----
    The energy is that of equations (1) and (7) of "Analysis of switched-rigid floating oscillator" (Shock and
    Vibration), E = k (y - z)**2 / 2, extended by plastic work and a preload. Overdamped motion has no oscillation rate
    and cannot be identified.

    Examples
    --------
    >>> t = np.linspace(0.0, 3.0, 121)
    >>> found = identify(t, (np.exp(-0.3 * t) * np.sin(5.0 * t)) ** 2)
    >>> found.describes_record, f"{found.mode.omega:.9f}", f"{found.mode.alpha:.9f}"
    (True, '5.000000000', '0.600000000')
    >>> identify(t, np.ones(121)).reason
    'the energy is constant, 1: nothing vibrates'
    """
    if lacking := _refuse_short_record(time, energy):
        return lacking
    record = _Record.scaled(time, energy)
    poles = find_rates(time, energy) if rates is None else rates
    if poles.size == 0:
        return _refuse_without_fit(
            time, "the energy does not oscillate: nothing vibrates, or it is overdamped"
        )
    worst = HOPELESS if quick else np.inf
    few_fits: dict[int, Samples | None] = {}
    if quick:
        # No other model leaves a smaller misfit than the largest model.
        largest = fitting.WITH_PRELOAD
        few_fits[largest] = fitting.fit_few(poles, record.s, record.e, largest, worst)
        if few_fits[largest] is None:
            return refuse_out_of_reach(time)
    attempts = _fit_models(poles, record, worst, few_fits)
    return _choose_first_to_follow(attempts, record)


def _fit_models(
    poles: NDArray[np.complex128],
    record: _Record,
    worst: float,
    few_fits: Mapping[int, Samples | None],
) -> Iterator[tuple[_Attempt, float]]:
    """Yield a fit of each model that is not hopeless, with the number of periods needed to identify the model.

    ``few_fits`` contains fits to a selection of samples that are already known, by the number of parameters.
    """
    for size, most_periods in _MODELS:
        if size in few_fits:
            few_fit = few_fits[size]
        else:
            few_fit = fitting.fit_few(poles, record.s, record.e, size, worst)
        parameters = fitting.fit(few_fit, record.s, record.e, size, worst)
        if parameters is not None:
            yield _evaluate_attempt(parameters, size, record), most_periods


def find_rates(time: Samples, energy: Samples) -> NDArray[np.complex128]:
    """Return the complex exponents of the exponentials that E may contain, times the record length, shape (k,).

    The result is empty if the record is too short to be judged.
    """
    if _refuse_short_record(time, energy):
        return np.zeros(0, np.complex128)
    record = _Record.scaled(time, energy)
    return fitting.Pencil.of(record.s, record.e).rates()


def _choose_first_to_follow(
    attempts: Iterable[tuple[_Attempt, float]], record: _Record
) -> Identification:
    """Judge the fits, simplest model first; return the first fit that follows the samples, otherwise the best fit.

    If a fit follows the samples, a model with more parameters would follow them too, without being more plausible.
    """
    refused: list[Identification] = []
    for attempt, least_periods in attempts:
        identification = _judge_attempt(attempt, least_periods, record)
        if identification.follows:
            plausible = [refusal for refusal in refused if refusal.plausible]
            return _prefer_through_zero(identification, plausible)
        refused.append(identification)
    if refused:
        return min(refused, key=lambda identification: identification.rms)
    return refuse_out_of_reach(np.array([record.start, record.end]))


def _prefer_through_zero(
    found: Identification, simple: list[Identification]
) -> Identification:
    """Replace a vibration about a preload with one through zero at half the frequency, if both fit almost equally well.

    The energy has one cycle per period of the vibration with a preload, but two per period of the one through zero,
    whose sign changes from one cycle to the next. If both fit almost equally well, their difference is as small as the
    effect of a stiffening spring. If there is a preload after all, the residuals are twice as large; this is treated
    like a hidden mode.
    """
    mode = found.mode
    near = [
        identification
        for identification in simple
        if identification.misfit is not None and identification.misfit < MAX_OF_SPRING
    ]
    if (
        not near
        or mode is None
        or mode.preload**2 <= float(mode.vibration_energy(found.start))
    ):
        return found
    best = min(near, key=lambda identification: identification.rms)
    return best._replace(
        describes_record=True, follows=True, reason=None, hidden_share=_OF_A_PRELOAD
    )


def refuse_out_of_reach(time: Samples) -> Identification:
    """Return the refusal of a record, with states at times (n,), that no oscillator nearly describes."""
    return _refuse_without_fit(
        time,
        f"no vibration comes near the energy: a few samples miss it by more than {MAX_MISFIT}",
    )


def judge_given(
    mode: Mode, time: Samples, energy: Samples, *, quick: bool = False
) -> Identification:
    """Compare a given mode with a record. The mode must follow the samples as closely as a fitted mode.

    The parameters and the result are those of ``identify``; the mode is not changed and has no covariance.
    """
    if lacking := _refuse_short_record(time, energy):
        return lacking
    every_so_many = slice(None, None, -(-time.size // fitting.COARSE))
    if quick and np.var(
        energy[every_so_many] - mode.energy(time[every_so_many])
    ) > HOPELESS * np.var(energy[every_so_many]):
        return refuse_out_of_reach(time)
    record = _Record.scaled(time, energy)
    start = record.start
    cosine = mode.deformation(start) - mode.preload
    sine = (mode.velocity(start) + mode.alpha / 2 * cosine) / mode.omega
    parameters = np.array(
        [mode.omega, mode.alpha, cosine, sine, mode.energy_plastic, mode.preload]
    )
    held = _judge_attempt(
        _evaluate_attempt(parameters / record.units, fitting.WITH_PRELOAD, record),
        0.0,
        record,
    )
    reason = None if held.follows else held.reason
    return held._replace(
        mode=mode,
        describes_record=held.follows,
        reason=reason,
        covariance=np.zeros((6, 6)),
    )


class _Record(NamedTuple):
    """A record in units of its length and energy range, which avoids overflow and underflow in any unit system."""

    s: Samples
    e: Samples
    start: float
    end: float
    scale: float

    @classmethod
    def scaled(cls, time: Samples, energy: Samples) -> _Record:
        start = float(time[0])
        end = float(time[-1])
        scale = float(np.ptp(energy))
        # When dividing very small numbers, older numpy versions warn of an overflow although the result is correct.
        with np.errstate(over="ignore"):
            scaled = energy / scale
        return cls((time - start) / (end - start), scaled, start, end, scale)

    @property
    def units(self) -> Samples:
        """Return the units of the fit parameters in terms of the units of the record."""
        rate = 1 / (self.end - self.start)
        root = self.scale**0.5
        return np.array([rate, rate, root, root, self.scale, root])


def _refuse_short_record(time: Samples, energy: Samples) -> Identification | None:
    """Return a refusal if the record is too short to be judged; otherwise None."""
    if time.size < MIN_SAMPLES:
        states_text = "1 state" if time.size == 1 else f"{time.size} states"
        return _refuse_without_fit(
            time,
            f"there are only {states_text} to fit, at least {MIN_SAMPLES} are needed",
        )
    if float(np.ptp(energy)) <= 1e-12 * float(
        np.max(np.abs(energy))
    ):  # The energy is constant except for rounding errors.
        return _refuse_without_fit(
            time, f"the energy is constant, {energy[0]:g}: nothing vibrates"
        )
    return None


class _Attempt(NamedTuple):
    """A fit, scaled and in units of the record, with scaled energies (n,) and J J^T (p, p) of their derivatives J."""

    scaled: Mode
    mode: Mode
    energy: Samples
    normal: Samples
    units: Samples


def _evaluate_attempt(parameters: Samples, size: int, record: _Record) -> _Attempt:
    """Evaluate the fit of one mode with its first ``size`` parameters free."""
    fitted, normal = fitting.evaluate_energies(
        parameters, partial(prepare_energy_and_jacobian, size=size), record.s
    )
    scaled = _make_mode(parameters, 0.0)
    mode = _make_mode(parameters * record.units, record.start)
    return _Attempt(scaled, mode, fitted, normal, record.units[:size])


def _judge_attempt(
    attempt: _Attempt, least_periods: float, record: _Record
) -> Identification:
    """Return the identified mode with the verdict on its fit."""
    s = record.s
    e = record.e
    density = count_samples_per_period(
        s, attempt.scaled
    )  # This number is computed first, because its computation needs as much memory as all later steps.
    remainder = e - attempt.energy
    rms = float(np.sqrt(np.mean(remainder**2)))
    spread = float(np.std(e))
    structure = fitting.measure_structure(remainder)
    local = attempt.scaled.vibration_energy(s)
    vibration = float(
        np.hypot.reduce(local) / np.sqrt(s.size)
    )  # Computing a norm avoids an overflow of squares.
    # If noise exceeds the vibration, a misfit does not prove that there is a further mode.
    np.maximum(local, max(rms, SOLVER_FLOOR * np.max(local)), out=local)
    local_structure = fitting.measure_structure(np.divide(remainder, local, out=local))
    loose = _explain_misfit(rms / spread, structure / spread, local_structure)
    objection = _explain_implausible(
        attempt.scaled, density, least_periods, record.end - record.start
    )
    reason = loose or objection
    return Identification(
        mode=attempt.mode,
        describes_record=reason is None,
        reason=reason,
        misfit=rms / spread,
        rms=rms * record.scale,
        structure=structure * record.scale,
        start=record.start,
        end=record.end,
        covariance=fitting.compute_covariance(attempt.normal, remainder)
        * attempt.units
        * attempt.units[:, None],
        vibration=vibration * record.scale,
        follows=loose is None,
        plausible=objection is None,
    )


def _explain_misfit(
    misfit: float, structure: float, local_structure: float
) -> str | None:
    """Return the reason why the fit does not follow the samples; None if it does."""
    if misfit > MAX_MISFIT:
        return f"one oscillator misses the energy by {misfit:.0%} of its standard deviation, more than {MAX_MISFIT:.0%}"
    if structure > fitting.MAX_STRUCTURE:
        deviation_text = (
            f"one oscillator deviates systematically by {structure:.2g} of the standard "
            "deviation of the energy"
        )
        return f"{deviation_text}, more than {fitting.MAX_STRUCTURE}"
    if local_structure > MAX_LOCAL_STRUCTURE:
        deviation_text = (
            f"one oscillator deviates systematically by {local_structure:.2g} of the "
            "vibration energy at the time"
        )
        return f"{deviation_text}, more than {MAX_LOCAL_STRUCTURE}"
    return None


def count_samples_per_period(time: Samples, mode: Mode) -> float:
    """Return the number of samples per energy period of the highest-frequency mode, with four digits.

    The energy has two periods per vibration period. The result is rounded because records often have a round number of
    states per period, and times rounded to single precision must not decide whether this number suffices.
    """
    # Each interval is weighted by its length, so that gaps have more effect.
    interval = float(np.sum(np.diff(time) ** 2)) / float(time[-1] - time[0])
    return float(f"{np.pi / mode.omega / interval:.4g}")


def _explain_implausible(
    mode: Mode, density: float, least_periods: float, span: float
) -> str | None:
    """Return the reason why a good fit does not show a single free vibration; None if it shows one."""
    periods = mode.omega / (2 * np.pi)
    if periods < least_periods:
        finding = f"the record shows {periods:.3g} vibration periods"
        return f"{finding}, fewer than the {least_periods} needed to tell a vibration from a drift"
    if mode.alpha < -MAX_GROWTH:
        finding = f"the vibration grows, alpha times the record's length is {mode.alpha:.2g}, below {-MAX_GROWTH}"
        return f"{finding}: something drives it"
    if mode.energy_plastic < MIN_PLASTIC:
        share = mode.energy_plastic
        return f"the plastic energy would be {share:.2g} of the energy's range, below {MIN_PLASTIC}"
    if density < MIN_SAMPLES_PER_PERIOD:
        # The interval is 10 % shorter than the limit, so that it suffices even after rounding to two digits.
        finer = np.pi * span / mode.omega / (1.1 * MIN_SAMPLES_PER_PERIOD)
        finding = f"the energy has {density:.2f} samples per period, fewer than {MIN_SAMPLES_PER_PERIOD}"
        return f"{finding}, and this mode may be aliased: write the output at intervals of {finer:.2g} or less"
    return None


def _make_mode(parameters: Samples, origin: float) -> Mode:
    """Return the mode with the given parameters."""
    omega, alpha, cosine, sine, plastic, preload = parameters.tolist()
    return Mode(omega, alpha, cosine, sine, origin, plastic, preload)


def _refuse_without_fit(time: Samples, reason: str) -> Identification:
    """Return the result that refuses a record to which nothing was fitted."""
    start = end = np.nan
    if time.size:
        start, end = float(time[0]), float(time[-1])
    return Identification(
        mode=None,
        describes_record=False,
        reason=reason,
        misfit=None,
        rms=np.nan,
        structure=np.nan,
        start=start,
        end=end,
        covariance=np.zeros((0, 0)),
    )
