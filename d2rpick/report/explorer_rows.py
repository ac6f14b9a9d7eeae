"""What the interactive part of a page says of each td: numbers for its curves, and every text as it is printed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from d2rpick.report.suggestion import acceptable
from d2rpick.report.tables import measure, short

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from d2rpick.choice.candidates import Candidate
    from d2rpick.choice.offer import Offer
    from d2rpick.choice.suggest import AcceptableWindow
    from d2rpick.choice.view import View

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
# Columns in which windows of acceptable tr are drawn, a multiple of eight.
COLUMNS: Final = 480
# Digits of a difference that people read.
_READ: Final = 3


class OfferRow(NamedTuple):
    """One td: ``numbers`` for the curves, and ``texts``, what stands beside them; both by name."""

    numbers: dict[str, Any]
    texts: dict[str, str]


def table_of(rows: Sequence[OfferRow]) -> dict[str, Any]:
    """Give rows with their names written once: ``numbers`` and ``texts``, and in ``rows`` the values of both."""
    texts = list(dict.fromkeys(name for row in rows for name, text in row.texts.items() if text))
    values = [[list(row.numbers.values()), [row.texts.get(name, "") for name in texts]] for row in rows]
    return {"numbers": list(rows[0].numbers), "texts": texts, "rows": values}


def row_of(offer: Offer, start: Offer, view: View, unit: str, deformation: float | None) -> OfferRow:
    """Give one td.

    Parameters
    ----------
    offer, start : Offer
        The td, and the one that is shown first, with which it is compared.
    view : View
        What is in sight.
    unit : str
        Of the time, where it is known.
    deformation : float or None
        What the recommended tr locks in [square root of energy].
    """
    best, saving = offer.best, offer.saving
    numbers = {
        "td": offer.td,
        "tr": None if best is None else _brief(best.tr),
        "level": _brief(offer.energy_td),
        "locked": _brief(best.energy) if best else None,
        "deformation": None if deformation is None else _brief(deformation),
        "saved": None if best is None else _brief(100 * (best.rigid_fraction if saving is None else saving)),
        "error": None if offer.error is None else _brief(offer.error),
        "windows": _columns(offer.windows or (), view),
        "peak": int(offer.peak),
        "unbeaten": int(offer.unbeaten),
    }
    return OfferRow(numbers, _texts(offer, start, f" {unit}" if unit else ""))


def _columns(windows: Sequence[AcceptableWindow], view: View) -> str:
    """Mark the columns of the view that windows touch, a bit each, in hexadecimal digits; empty without a window.

    However many windows noise makes, this is short, and finer than a screen shows.
    """
    ends = np.array([(one.start, one.end) for one in windows]).reshape(-1, 2)
    first, last = np.clip((ends - view.start) / (view.end - view.start) * COLUMNS, 0, COLUMNS - 1).astype(int).T
    marked = np.zeros(COLUMNS, dtype=bool)
    for low, high in zip(first.tolist(), last.tolist(), strict=True):
        marked[low : high + 1] = True
    return np.packbits(marked).tobytes().hex() if marked.any() else ""


def _brief(value: float) -> float:
    """Shorten a number that is drawn, not read."""
    return float(f"{value:.6g}")


def error_name(offers: Sequence[Offer]) -> str:
    """Name what offers are compared by."""
    return "shortfall of the level at td" if all(one.basis == "energy" for one in offers) else "residual"


def saved_name(offers: Sequence[Offer]) -> str:
    """Name what their errors are held against: the saving of run time, or the rigid time where no cost is known."""
    known = any(one.saving is not None for one in offers)
    return "saved, % of the run time" if known else "rigid, % of the record"


def _texts(offer: Offer, start: Offer, unit: str) -> dict[str, str]:
    """Everything that is said of a td, as ``suggest --td`` prints it; empty where it is not known."""
    best, quality = offer.best, offer.quality
    return {
        "td": short(offer.td),
        "tr": short(best.tr) if best else "none",
        "exact_td": repr(offer.td),
        "exact_tr": repr(best.tr) if best else "none",
        "level": short(offer.energy_td),
        "kinetic": "" if offer.kinetic_share is None else measure(offer.kinetic_share),
        "quality": quality.told if quality else "",
        "reason": offer.reason or "",
        **(_of_best(offer, best, unit) if best else {}),
        "compared": _compared(offer, start, unit),
        "said": _said(offer),
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
        return "nothing acceptable"
    if best.residual is not None:
        return f"residual {measure(best.residual)}"
    return offer.quality.grade if offer.quality else ""


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
    if offer.saving is not None and start.saving is not None:
        said.append(f"saves {offer.saving:.1%} of the run time instead of {start.saving:.1%}")
    if offer.error is not None and start.error is not None and (offer.basis == "energy") == (start.basis == "energy"):
        said.append(f"{error_name([offer])} {measure(offer.error)} instead of {measure(start.error)}")
    return ", ".join(said)
