"""The interactive part of a page: td can be dragged, typed and moved by keys, and all that depends on it follows.

Python computes and prints everything; the script in ``explorer.js`` looks it up.  What every page has stands in
``explorer.html``.
"""

from __future__ import annotations

import json
import re
from string import Template
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from d2rpick.choice.decision import span_of
from d2rpick.histories.samples import draw_outline
from d2rpick.report.decision import saved
from d2rpick.report.page import Explorer, Markup, join, resource, tag
from d2rpick.report.suggestion import acceptable
from d2rpick.report.tables import filled, measure, shell_line, short, shown
from d2rpick.report.view import View, locked_in, response, scale_in, view_of

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from d2rpick.choice.answers import AcceptableWindow
    from d2rpick.choice.candidates import Candidate
    from d2rpick.choice.situation import Situation
    from d2rpick.choice.trade_off import Offer, TradeOff
    from d2rpick.histories.history import Samples


# Stretches of the energy in sight, each with its lowest and highest value, and of the whole record in the overview.
_STRETCHES: Final = 600
_OVERVIEW: Final = 200
# Between the section, the chart of the motion and what is said of a pair.
_NEXT: Final = "<!-- next -->"


def styles() -> tuple[Markup, ...]:
    """Give the style sheets that the interactive part needs."""
    return resource("uplot/uPlot.min.css"), resource("explorer.css")


def scripts() -> tuple[Markup, ...]:
    """Give the scripts, in their order; that of uPlot with its licence."""
    licence = join([Markup("/*!\n"), resource("uplot/LICENSE"), Markup("*/\n")])
    return Markup(licence + resource("uplot/uPlot.iife.min.js")), resource(
        "explorer.js"
    )


def explorer(explored: Explorer | None) -> Markup:
    """Give the section, hidden until its script finds that it can run, and its data; nothing without any.

    Charts and values stand in two columns; on a narrow page the style puts them below each other in another order.
    """
    if explored is None:
        return Markup()
    flights = [_flight(one) for one in explored.trade_offs]
    known = {
        name for flight in flights for name in flight["texts"]
    }  # what no pair has is left out
    listed = (
        tag("div", tag("dt", name), tag("dd", data_value=key))
        for key, name in _VALUES.items()
        if key in known
    )
    section, motion, values = _closed_up(resource("explorer.html")).split(_NEXT)
    values = Template(values).substitute(listed=join(listed))
    below = (
        (motion, values)
        if any(flight["motion"] for flight in flights)
        else (values, "")
    )
    options = (
        tag("option", f"flight {i + 1}", value=str(i)) for i in range(len(flights))
    )
    unit = explored.trade_offs[0].situation.history.time_unit
    section = Template(section).substitute(
        chooser=tag("label", "flight", tag("select", *options, id="explorer-flight"))
        if len(flights) > 1
        else "",
        unit=join([f" [{unit}]"] if unit else []),
        windows=tag("li", tag("i", class_="windows"), "acceptable tr")
        if "windows" in known
        else "",
        below_energy=below[0],
        below_trade=below[1],
    )
    before, behind = (shell_line(words) for words in explored.command)
    found = {"flight": 0, "flights": flights, "command": [f"{before} ", f" {behind}"]}
    return join([Markup(section), _data("explorer-data", found)])


def _closed_up(text: str) -> str:
    """Leave out the blanks and line ends between elements, and make one blank of those within a text."""
    return re.sub(r"\s*\n\s*", " ", re.sub(r"\s*\n\s*(?=<|$)|(?<=>)\s*\n\s*", "", text))


def _data(name: str, content: Any) -> Markup:
    """Give data for a script: JSON in which nothing can be taken for markup."""
    text = json.dumps(content, allow_nan=False, separators=(",", ":"))
    for letter in "<>&":
        text = text.replace(letter, f"\\u{ord(letter):04x}")
    return tag("script", Markup(text), type="application/json", id=name)


def _flight(found: TradeOff) -> dict[str, Any]:
    """What is drawn and said of one flight."""
    situation = found.situation
    history, flight = situation.history, situation.flight
    first = found.asked or found.recommended or found.start or found.offers[-1]
    seen = view_of(situation, found.offers[-1].td)
    levels = [one.energy_td for one in found.offers]
    scale = scale_in(situation, seen, levels)
    whole = draw_outline(history.time, history.energy, _OVERVIEW)
    inner = history.between(seen.start, seen.end)
    time, energy = draw_outline(*inner, stretches=_STRETCHES)
    unit = history.time_unit
    above = [
        f"the {what}, up to {energy:.4g}"
        for what, energy in seen.above
        if energy > scale.high
    ]
    cut = f"; cut at the top: {' and '.join(above)}" if above else ""
    return {
        "caption": f"Internal energy in the flight{cut}",
        "time": f"time [{unit}]" if unit else "time",
        "error": _error_name(found.offers),
        "saved": _saved_name(found.offers),
        "view": [seen.start, seen.end],
        "flight": [
            seen.start if flight.start is None else flight.start,
            seen.end if flight.end is None else flight.end,
        ],
        "heights": [scale.low, scale.high],
        "log": scale.logarithmic,
        "energy": [
            _brief(time),
            _brief(np.maximum(energy, scale.low) if scale.logarithmic else energy),
        ],
        "whole": [_brief(column) for column in whole],
        "motion": _motion(situation),
        "start": found.offers.index(first),
        **_table(found, first, seen),
    }


def _motion(situation: Situation) -> dict[str, Any] | None:
    """Give the curves of which the script composes the deformation; None where no oscillator is known."""
    found = response(situation)
    if found is None:
        return None
    columns = {
        "time": found.time,
        "reference": found.reference,
        "release": found.release,
    }
    return {
        **{name: _brief(column) for name, column in columns.items()},
        "preload": found.preload,
    }


def _brief(values: Samples) -> list[float]:
    """Numbers for a curve, to six digits."""
    return [float(f"{value:.6g}") for value in values.tolist()]


# What is listed of a pair, by key, in this order.
_VALUES: Final[Mapping[str, str]] = {
    "verdict": "verdict",
    "why": "why",
    "cure": "to improve",
    "compared": "change",
    "residual": "residual",
    "after": "mean energy after td",
    "level_error": "level error",
    "kinetic": "kinetic fraction",
    "rigid": "rigid",
    "run_time": "saves",
    "level": "energy at td",
    "tolerance": "timing tolerance",
    "windows": "acceptable tr",
    "reason": "no tr",
}
# Columns in which windows of acceptable tr are drawn, a multiple of eight.
_COLUMNS: Final = 480
# Digits of a difference that people read.
_READ: Final = 3


def _table(found: TradeOff, first: Offer, seen: View) -> dict[str, Any]:
    """Give a row for each td, the names of its values once: ``numbers`` for curves, ``texts`` that stand beside them.

    ``first`` is the td that is shown first, with which others are compared.
    """
    situation, unit = found.situation, found.situation.history.time_unit
    columns: dict[str, Callable[[Offer], Any]] = {
        "td": lambda one: one.td,
        "tr": lambda one: _short(one.tr),
        "level": lambda one: _short(one.energy_td),
        "locked": lambda one: _short(one.best.energy if one.best else None),
        "deformation": lambda one: _short(
            locked_in(situation, one.tr) if one.basis == "oscillator" else None
        ),
        "saved": lambda one: _short(_saved(one)),
        "error": lambda one: _short(one.error),
        "windows": lambda one: _marked_columns(one.answer.windows or (), seen),
        "peak": lambda one: int(one.peak),
        "unbeaten": lambda one: int(one.unbeaten),
    }
    names, numbers = filled(columns, found.offers)
    texts = [_texts(one, first, f" {unit}" if unit else "") for one in found.offers]
    said = list(
        dict.fromkeys(name for row in texts for name, text in row.items() if text)
    )
    rows = [
        [values, [row.get(name) or "" for name in said]]
        for values, row in zip(numbers, texts, strict=True)
    ]
    return {"numbers": names, "texts": said, "rows": rows}


def _saved(offer: Offer) -> float | None:
    """What a pair saves [%]: of the run time, or of the record where no cost is known."""
    share = (
        offer.best.rigid_fraction
        if offer.best and offer.saving is None
        else offer.saving
    )
    return None if share is None else 100 * share


def _marked_columns(windows: Sequence[AcceptableWindow], view: View) -> str:
    """Mark the columns of the view that windows touch, a bit each, in hexadecimal digits; empty without a window.

    However many windows noise makes, this is short, and finer than a screen shows.
    """
    ends = np.array([(one.start, one.end) for one in windows]).reshape(-1, 2)
    first, last = (
        np.clip(
            (ends - view.start) / (view.end - view.start) * _COLUMNS, 0, _COLUMNS - 1
        )
        .astype(int)
        .T
    )
    marked = np.zeros(_COLUMNS, dtype=bool)
    for low, high in zip(first.tolist(), last.tolist(), strict=True):
        marked[low : high + 1] = True
    return np.packbits(marked).tobytes().hex() if marked.any() else ""


def _short(value: float | None) -> float | None:
    """Shorten a number that is drawn, not read."""
    return None if value is None else float(f"{value:.6g}")


def _error_name(offers: Sequence[Offer]) -> str:
    """Name what offers are compared by."""
    return (
        "shortfall of the level at td"
        if all(one.basis == "energy" for one in offers)
        else "residual"
    )


def _saved_name(offers: Sequence[Offer]) -> str:
    """Name what their errors are held against: the saving of run time, or the rigid time where no cost is known."""
    known = any(one.saving is not None for one in offers)
    return (
        "saved, % of the processor time" if known else "rigid, % of the simulated time"
    )


def _texts(offer: Offer, start: Offer, unit: str) -> dict[str, str | None]:
    """Everything that is said of a td, as ``suggest --td`` prints it; nothing where it is not known."""
    best, decision = offer.best, offer.decision
    return {
        "td": short(offer.td),
        "tr": short(best.tr) if best else "none",
        "exact_td": repr(offer.td),
        "exact_tr": repr(best.tr) if best else "none",
        "level": short(offer.energy_td),
        "kinetic": shown(offer.kinetic_share, ".3f"),
        "verdict": decision and decision.verdict,
        "why": decision and decision.reason,
        "cure": decision and decision.cure,
        "reason": offer.answer.why_none,
        **(_of_best(offer, best, unit) if best else {}),
        "compared": _compared(offer, start, unit),
        "said": _said(offer),
    }


def _of_best(offer: Offer, best: Candidate, unit: str) -> dict[str, str | None]:
    """What is said of the recommended tr."""
    kept, windows = offer.answer.kept, offer.answer.windows
    return {
        "residual": shown(best.residual, ".3f"),
        "after": None if kept is None else f"{span_of(kept)} of the reference's",
        "level_error": shown(
            best.level_error if best.residual is None else None, ".3f"
        ),
        "rigid": f"for {short(best.rigid_time)}{unit}, {best.rigid_fraction:.1%} of the simulated time",
        "run_time": None if best.run_time_share is None else saved(best.run_time_share),
        "tolerance": None
        if best.timing_tolerance is None
        else f"±{best.timing_tolerance:.1e}{unit}",
        "windows": acceptable(windows, best.tr) if windows else None,
    }


def _said(offer: Offer) -> str:
    """What is said of the quality to who listens."""
    best = offer.best
    if best is None:
        return "nothing acceptable"
    if best.residual is not None:
        return f"residual {measure(best.residual)}"
    return offer.decision.verdict if offer.decision else ""


def _compared(offer: Offer, start: Offer, unit: str) -> str:
    """What an offer costs and gives, against the one that is shown first."""
    if offer is start:
        return ""
    apart = offer.td - start.td
    said = [
        f"{abs(apart):.{_READ}g}{unit} {'later' if apart > 0 else 'earlier'} than {short(start.td)}{unit}"
    ]
    if offer.best and start.best:
        longer = offer.best.rigid_time - start.best.rigid_time
        share = offer.best.rigid_fraction - start.best.rigid_fraction
        said.append(
            f"rigid for {abs(longer):.{_READ}g}{unit} {'longer' if longer > 0 else 'less'}, "
            f"{share:+.1%} of the simulated time"
        )
    if offer.saving is not None and start.saving is not None:
        said.append(
            f"saves {offer.saving:.1%} of the processor time instead of {start.saving:.1%}"
        )
    if (
        offer.error is not None
        and start.error is not None
        and (offer.basis == "energy") == (start.basis == "energy")
    ):
        said.append(
            f"{_error_name([offer])} {measure(offer.error)} instead of {measure(start.error)}"
        )
    return ", ".join(said)
