"""What the interactive part of a page says of each td: numbers for its curves, and every text as it is printed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from d2rpick.report.suggestion import acceptable
from d2rpick.report.tables import measure, short

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from d2rpick.choice.candidates import Candidate
    from d2rpick.choice.offer import Offer

# What is listed of a pair, by key, in this order.
VALUES: Final[Mapping[str, str]] = {
    "quality": "quality",
    "compared": "change",
    "residual": "residual",
    "after": "mean energy after td",
    "level_error": "level error",
    "kinetic": "kinetic share",
    "rigid": "rigid",
    "run_time": "run time",
    "level": "energy at td",
    "tolerance": "tr may be off by",
    "windows": "acceptable tr",
    "reason": "no tr",
}
# Digits of a difference that people read.
_READ: Final = 3


def row_of(offer: Offer, start: Offer, unit: str, deformation: float | None) -> dict[str, Any]:
    """Give one td: numbers for the curves, and in ``text`` what stands beside them.

    Parameters
    ----------
    offer, start : Offer
        The td, and the one that is shown first, with which it is compared.
    unit : str
        Of the time, where it is known.
    deformation : float or None
        What the recommended tr locks in [square root of energy].
    """
    best = offer.best
    return {
        "td": offer.td,
        "tr": None if best is None else _brief(best.tr),
        "level": _brief(offer.energy_td),
        "locked": _brief(best.energy) if best else None,
        "deformation": None if deformation is None else _brief(deformation),
        "rigid": _brief(100 * best.rigid_fraction) if best else None,
        "error": None if offer.error is None else _brief(offer.error),
        "windows": [[_brief(one.start), _brief(one.end)] for one in offer.windows or ()],
        "peak": offer.peak,
        "unbeaten": offer.unbeaten,
        "text": {name: text for name, text in _texts(offer, start, f" {unit}" if unit else "").items() if text},
    }


def _brief(value: float) -> float:
    """Shorten a number that is drawn, not read."""
    return float(f"{value:.6g}")


def error_name(offers: Sequence[Offer]) -> str:
    """Name what offers are compared by."""
    return "error of the level at td" if all(one.basis == "energy" for one in offers) else "residual"


def _texts(offer: Offer, start: Offer, unit: str) -> dict[str, str]:
    """Everything that is said of a td, as ``suggest --td`` prints it; empty where it is not known."""
    best, td = offer.best, short(offer.td)
    tr = short(best.tr) if best else "none"
    quality = offer.quality
    return {
        "td": td,
        "tr": tr,
        "exact_td": repr(offer.td),
        "exact_tr": repr(best.tr) if best else "none",
        "level": short(offer.energy_td),
        "kinetic": "" if offer.kinetic_share is None else measure(offer.kinetic_share),
        "quality": f"{quality.grade}{': ' * bool(quality.reasons)}{'; '.join(quality.reasons)}" if quality else "",
        "reason": offer.reason or "",
        **(_of_best(offer, best, unit) if best else {}),
        "compared": _compared(offer, start, unit),
        "spoken": f"td {td}{unit}, tr {tr}{unit}{_said(offer)}",
    }


def _of_best(offer: Offer, best: Candidate, unit: str) -> dict[str, str]:
    """What is said of the recommended tr."""
    expected = offer.expected
    ratio = expected.ratio if expected else None
    return {
        "residual": "" if best.residual is None else measure(best.residual),
        "after": "" if ratio is None else f"about {ratio:.0%} of what the reference has",
        "level_error": "" if best.residual is not None or best.level_error is None else measure(best.level_error),
        "rigid": f"for {short(best.rigid_time)}{unit}, {best.rigid_fraction:.1%} of the record",
        "run_time": "" if best.run_time_share is None else f"about {best.run_time_share:.0%} of the reference's",
        "tolerance": "" if best.timing_tolerance is None else f"{best.timing_tolerance:.1e}{unit}",
        "windows": acceptable(offer.windows, best.tr) if offer.windows else "",
    }


def _said(offer: Offer) -> str:
    """What is said of the quality to who listens."""
    best = offer.best
    if best is None:
        return ", no acceptable tr"
    if best.residual is not None:
        return f", residual {measure(best.residual)}"
    return f", {offer.quality.grade}" if offer.quality else ""


def _compared(offer: Offer, start: Offer, unit: str) -> str:
    """What an offer costs and gives, against the one that is shown first."""
    if offer is start:
        return ""
    apart = offer.td - start.td
    said = [f"{abs(apart):.{_READ}g}{unit} {'later' if apart > 0 else 'earlier'} than {short(start.td)}{unit}"]
    if offer.best and start.best:
        longer = offer.best.rigid_time - start.best.rigid_time
        share = offer.best.rigid_fraction - start.best.rigid_fraction
        said.append(
            f"rigid for {abs(longer):.{_READ}g}{unit} {'longer' if longer > 0 else 'less'} ({share:+.1%} of the record)"
        )
    if offer.error is not None and start.error is not None and (offer.basis == "energy") == (start.basis == "energy"):
        said.append(f"{error_name([offer])} {measure(offer.error)} instead of {measure(start.error)}")
    return ", ".join(said)
