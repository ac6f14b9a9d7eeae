"""What is known of the vibration at one td: one protocol, and which of its four models can be relied on there.

The signs of parts are worth more than an oscillator that describes the record, that more than swings that were counted
unless it leaves much over, and these more than the energy alone.
A further kind of vibration is a module with these methods and a line in `model_at`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from d2rpick.vibration.identify import MAX_MISFIT, MIN_SAMPLES_PER_PERIOD
from d2rpick.vibration.moments import SUNK
from d2rpick.vibration.of_energy import OfEnergy
from d2rpick.vibration.of_modes import OfModes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.histories.history import History, Samples
    from d2rpick.vibration.identify import Identification
    from d2rpick.vibration.measures import Measured
    from d2rpick.vibration.modes import Mode, Modes
    from d2rpick.vibration.moments import Moment, Moments
    from d2rpick.vibration.part_signs import PartMatch, SignedParts, Unsigned
    from d2rpick.vibration.span import Span
    from d2rpick.vibration.swings import Swings


# Of the vibration energy: more of it in a further mode moves a residual by a quarter and more.
_HIDDEN = 0.02
_LEFT_OVER = "the oscillator leaves more over than the swings of the energy do, which were counted"


class Vibration(Protocol):
    """A vibration seen from one td."""

    @property
    def basis(self) -> str:
        """Name of the model: "parts", "oscillator", "swings" or "energy"."""

    @property
    def unknown(self) -> str | None:
        """Why no deformation with its sign is known; None where one is."""

    @property
    def undescribed(self) -> str:
        """Why a single tr has no measures although deformations are known."""

    @property
    def estimated(self) -> str | None:
        """Why the kinetic share is an estimate; None where it is none."""

    @property
    def doubts(self) -> tuple[str, ...]:
        """Why the level at td means nothing, so that no tr can be trusted."""

    @property
    def unsigned(self) -> tuple[Unsigned, ...]:
        """Parts that were left out, since their deformation has no sign."""

    @property
    def signed(self) -> tuple[str, ...]:
        """Names of the parts whose signs are known."""

    @property
    def mode(self) -> Mode | Modes | None:
        """Closed form of the whole energy, where there is one."""

    @property
    def kinetic_share(self) -> float | None:
        """K at td, None where it is not known [-]."""

    @property
    def has_matches(self) -> bool:
        """Whether there are closest matches beside crossings and extrema: of several deformations."""

    def energy(self, time: float) -> float:
        """E at a time: of the model where it describes the record, of the samples elsewhere [energy]."""

    def energies(self, times: Samples) -> Samples:
        """E at many times, of their shape [energy]."""

    def described(self, time: float) -> bool:
        """Whether the energy at a time is the model's own."""

    def peaks(self, start: float, end: float) -> tuple[float, ...]:
        """Times in (start, end], ascending, where the energy peaks [time]."""

    def moments(self, tolerance: float, since: float = -np.inf) -> Sequence[Moment]:
        """Times before td that may serve as tr; standstills only where their error is within the tolerance.

        Those before ``since`` [time] may be left out.
        """

    def measured(self, times: Samples) -> Sequence[Measured | None]:
        """Measures of each time as tr, None where its deformation cannot be compared with that at td."""

    def errors(self, times: Samples) -> Samples:
        """What a tolerance is held against, of the shape of ``times``; infinite where no tolerance would help [-]."""

    def knots(self) -> Samples:
        """Times before td between which the errors run monotone [time]."""

    def reach(self, moments: Moments) -> Samples:
        """How far the true time of each moment may lie away [time]."""

    def part_matches(self, tr: float) -> tuple[PartMatch, ...]:
        """What each part has of the mismatch; nothing where single parts are not known."""


class Evidence(NamedTuple):
    """What was found in a record, whatever it is worth at one td.

    ``fit`` is None only where no oscillator was looked for; ``span`` is the window in which it describes the record.
    ``given``: the oscillator was given; ``prescribed``: it, or the window to identify it in.  ``parts`` are the
    deformations of single parts, as far as they have a sign; ``swings`` were counted in the energy of the flight, where
    it comes down to a floor in each.
    """

    fit: Identification | None = None
    span: Span | None = None
    given: bool = False
    prescribed: bool = False
    parts: SignedParts | None = None
    swings: Swings | None = None

    @property
    def signed(self) -> SignedParts | None:
        """The parts, where enough of the energy has a sign."""
        return self.parts if self.parts and self.parts.signed else None

    @property
    def has_model(self) -> bool:
        """Whether at some td more than the samples of the energy may be relied on."""
        fit = self.fit
        return bool(self.signed or self.swings or (fit and fit.mode and self.span and not fit.reason))


def model_at(history: History, td: float, evidence: Evidence) -> Vibration:
    """Give the best model that can be relied on at ``td``."""
    whole, signed = energy_at(history, td, evidence), evidence.signed
    sunk = signed is not None and isinstance(whole, OfEnergy) and signed.sunk(td)  # a model of the whole tells more
    if signed and not sunk:
        from d2rpick.vibration.of_parts import OfParts  # not above: a table has no parts

        return OfParts(whole, signed)
    swings = evidence.swings
    if swings and not whole.doubts and doubtful(whole) and swings.known_at(td):
        from d2rpick.vibration.of_swings import OfSwings  # not above: an oscillator does without it

        if isinstance(whole, OfEnergy) or swings.unseen(whole.span.start, td)[0] < whole.fit.hidden_share:
            return OfSwings(OfEnergy(history, td, _LEFT_OVER) if isinstance(whole, OfModes) else whole, swings)
    if isinstance(whole, OfModes):
        return whole
    return whole.without_parts(evidence.parts, sunk=sunk)


def doubtful(whole: OfModes | OfEnergy) -> bool:
    """Whether no oscillator is known, or one that leaves so much over that its sign may be wrong."""
    return isinstance(whole, OfEnergy) or whole.fit.hidden_share > _HIDDEN


def energy_at(history: History, td: float, evidence: Evidence) -> OfModes | OfEnergy:
    """Give the model of the whole energy to be relied on at ``td``: an oscillator, else the samples."""
    fit = evidence.fit
    if fit is None:
        return OfEnergy(history, td, "identification was switched off")
    prescribed = ("the oscillator that was asked for does not describe the record at td",) * evidence.prescribed
    if fit.reason:
        what = "the given oscillator does not describe" if evidence.given else "no single oscillator describes"
        return OfEnergy(history, td, f"{what} the record: {fit.reason}", (*prescribed, *_aliased(history, fit)))
    model = describing(history, td, evidence)
    if not model.described(td):
        return OfEnergy(history, td, "the oscillator does not describe the record at td", prescribed)
    sunk = model.sunk
    return OfEnergy(history, td, sunk, (SUNK, *prescribed)) if sunk else model


def _aliased(history: History, fit: Identification) -> tuple[str, ...]:
    """Say so when the energy swings so fast that its states miss the level as they miss the vibration."""
    if fit.mode is None or fit.misfit is None or fit.misfit > MAX_MISFIT:
        return ()
    time, _ = history.between(fit.start, fit.end)
    # the interval that a moment lies in, on average: gaps count by their length
    interval = float(np.sum(np.diff(time) ** 2)) / (fit.end - fit.start)
    states = np.pi / (fit.mode.fastest * interval)
    if states >= MIN_SAMPLES_PER_PERIOD:
        return ()
    return (
        f"the energy has {states:.3g} states per period, fewer than the {MIN_SAMPLES_PER_PERIOD} that show a level",
    )


def describing(history: History, td: float, evidence: Evidence) -> OfModes | OfEnergy:
    """Give the model of the energy whatever it is worth at ``td``: an oscillator where it describes a window."""
    fit, span = evidence.fit, evidence.span
    if fit and fit.mode and span:
        return OfModes(history, td, fit, span)
    return OfEnergy(history, td, "no oscillator describes the record")
