"""What one td offers: the best tr for it, what that keeps and what it saves; in full what ``suggest`` says of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from d2rpick.choice.candidates import candidates_of
from d2rpick.choice.expectation import mean_in_flight, shortfall
from d2rpick.choice.suggest import suggest_at

if TYPE_CHECKING:
    from collections.abc import Container, Iterator, Sequence

    from d2rpick.choice.candidates import Candidate, Candidates
    from d2rpick.choice.expectation import Expectation
    from d2rpick.choice.quality import Quality
    from d2rpick.choice.situation import Situation
    from d2rpick.choice.suggest import AcceptableWindow, Suggestion


@dataclass(frozen=True)
class Offer:
    """A td [time] and the tr that is recommended for it, None where none is: then ``reason`` says why.

    ``peak``: the energy peaks at td.  ``error`` is what offers are compared by [-]: the residual, on basis "energy"
    how far the level at td stays below all vibration energy, 1 - sqrt(E(td)/(2 <E>)).  ``windows`` of acceptable tr
    and what is ``expected`` after td are known on basis "energy" only.  ``unbeaten``: no other offer has less error and
    saves as much, or saves more with no more error.  ``recommended``: it is that of ``suggest`` where td is chosen too.
    """

    td: float
    peak: bool
    basis: str
    energy_td: float
    kinetic_share: float | None
    best: Candidate | None
    error: float | None
    quality: Quality | None
    windows: tuple[AcceptableWindow, ...] | None
    expected: Expectation | None
    reason: str | None
    unbeaten: bool = False
    recommended: bool = False

    @property
    def tr(self) -> float | None:
        """The recommended tr [time]."""
        return self.best.tr if self.best else None

    @property
    def rigid_time(self) -> float | None:
        """How long the parts are rigid [time]."""
        return self.best.rigid_time if self.best else None

    @property
    def saving(self) -> float | None:
        """Share of the run time that is saved [-]; None where the cost of the parts is not known."""
        share = self.best.run_time_share if self.best else None
        return None if share is None else 1 - share


def offers_of(situations: Sequence[Situation], peaks: Container[float]) -> Iterator[Offer]:
    """Give what ``suggest`` says of each td; ``peaks`` are the times where the energy peaks."""
    found = candidates_of(situations, in_flight=True)
    yield from (_offer(one, candidates, one.td in peaks) for one, candidates in zip(situations, found, strict=True))


def _offer(situation: Situation, found: Candidates, peak: bool) -> Offer:
    answer = suggest_at(situation, with_better=False, found=found)
    if answer.chosen is None:  # the reason tells of all candidates
        answer = suggest_at(situation, with_better=False)
    best = answer.chosen
    return Offer(
        td=situation.td,
        peak=peak,
        basis=situation.basis,
        energy_td=situation.energy_td,
        kinetic_share=situation.kinetic_share,
        best=best,
        error=_error(situation, best),
        quality=answer.quality,
        windows=answer.windows,
        expected=answer.expected,
        reason=None if best else _reason(answer),
    )


def _error(situation: Situation, best: Candidate | None) -> float | None:
    """What offers are compared by; None where nothing is recommended, or the level is above all vibration energy."""
    if best is None:
        return None
    if situation.at_rest:
        return 0.0
    if best.residual is not None:
        return best.residual
    mean = mean_in_flight(situation)
    error = shortfall(situation.energy_td, mean) if mean is not None else float("inf")
    return error if error < float("inf") else None


def _reason(answer: Suggestion) -> str:
    return "; ".join(one.message for one in answer.cautions if one.code == "no-candidate")
