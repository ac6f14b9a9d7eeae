"""Build the interactive part of a page. It updates everything that depends on td when the user changes td.

Python computes all numbers and texts; the script in ``explorer.js`` only looks them up.  ``explorer.html`` contains
the elements that every page has.
"""

from __future__ import annotations

import json
import re
from string import Template
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from d2rpick.choice.pair.decision import format_bounds
from d2rpick.histories.samples import draw_outline
from d2rpick.report.decision import format_saved_share, is_refused
from d2rpick.report.page import (
    CLASSES,
    Explorer,
    Markup,
    join,
    make_element,
    name_section,
    read_resource,
)
from d2rpick.report.situation import label_deformation, label_energy
from d2rpick.report.suggestion import describe_acceptable_windows
from d2rpick.report.tables import (
    fill_table,
    format_if_known,
    format_measure,
    format_short,
    quote_shell_line,
)
from d2rpick.report.view import (
    View,
    compute_locked_in_deformation,
    compute_response,
    make_scale_of_flight,
    make_view_of_situation,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from d2rpick.choice.answers import AcceptableWindow, PairVerdict
    from d2rpick.choice.pair.candidates import Candidate
    from d2rpick.choice.pair.decision import Decision
    from d2rpick.choice.pair.situation import Situation
    from d2rpick.choice.td.trade_off import Offer, TradeOff
    from d2rpick.histories.history import Samples


# Number of intervals of a curve in the view and in the overview; in each, the lowest and highest energy are drawn.
_STRETCHES: Final = 600
_OVERVIEW: Final = 200
# Separator of the three parts of ``explorer.html``: the section, the motion chart and the values of a pair.
_NEXT: Final = "<!-- next -->"

# Labels of the values that are shown for a pair, by value name and in display order.
_VALUES: Final[Mapping[str, str]] = {
    "why": "why",
    "cure": "to improve",
    "compared": "change",
    "residual": "residual",
    "after": "mean energy after td",
    "level_error": "level error",
    "kinetic": "kinetic fraction",
    "rigid": "rigid for",
    "run_time": "saves",
    "level": "energy at td",
    "tolerance": "timing tolerance",
    "windows": "admissible tr",
    "reason": "no tr",
}
# Title of the values, and name of the level in the legend, on the page of a verified pair.
_BESIDE_VERIFIED: Final = "For comparison: the best pair for this td"
_LEVEL_OF_BEST: Final = "the best pair for this td: level at td; dashed: tr"
# Number of columns of the view that show windows of acceptable tr; the number must be a multiple of 8.
_COLUMNS: Final = 480
# Number of significant digits of a displayed difference.
_READ: Final = 3
# A difference of the rigid time is named from this fraction of the simulated time on [-].
_VISIBLE_SHARE: Final = 5e-4
# Title of the interactive section.
_TITLE: Final = "What another td would cost"


def read_styles() -> tuple[Markup, ...]:
    """Return the style sheets of the interactive part."""
    return read_resource("uplot/uPlot.min.css"), read_resource("explorer.css")


def read_scripts() -> tuple[Markup, ...]:
    """Return the scripts in loading order; the uPlot script includes its licence."""
    licence = join([Markup("/*!\n"), read_resource("uplot/LICENSE"), Markup("*/\n")])
    return Markup(licence + read_resource("uplot/uPlot.iife.min.js")), read_resource(
        "explorer.js"
    )


def build_explorer(
    explored: Explorer | None, judged: PairVerdict | None = None
) -> Markup:
    """Return the interactive section and its data; empty if there is nothing to explore.

    The section is hidden until its script has checked that it can run.  Charts and values stand in two columns; on a
    narrow page the style sheet puts them below each other in another order.  A pair that was ``judged`` is marked
    beside the best pair for each td, with its finished switched run.
    """
    if explored is None:
        return Markup()
    verified_times = (
        () if judged is None else (judged.candidate.tr, judged.situation.td)
    )
    flights = [
        _describe_flight(trade_off, *verified_times)
        for trade_off in explored.trade_offs
    ]
    known_values = {
        name for flight in flights for name in flight["texts"]
    }  # Values that are unknown for all pairs are omitted.
    listed = (
        make_element(
            "div", make_element("dt", name), make_element("dd", data_value=key)
        )
        for key, name in _VALUES.items()
        if key in known_values
    )
    section, motion, values = _strip_whitespace(read_resource("explorer.html")).split(
        _NEXT
    )
    title = "The best pair for this td" if judged is None else _BESIDE_VERIFIED
    values = Template(values).substitute(listed=join(listed), title=title)
    if any(flight["motion"] for flight in flights):
        below = (motion, values)
    else:
        below = (values, "")
    options = (
        make_element("option", f"flight {i + 1}", value=str(i))
        for i in range(len(flights))
    )
    unit = explored.trade_offs[0].situation.history.time_unit
    section = Template(section).substitute(
        heading=_TITLE,
        kind="explorer" if judged is None else "explorer judged",
        level="level at td; dashed: tr" if judged is None else _LEVEL_OF_BEST,
        judged=_build_keys_of_judged(judged),
        chooser=make_element(
            "label", "flight", make_element("select", *options, id="explorer-flight")
        )
        if len(flights) > 1
        else "",
        unit=join([f" [{unit}]"] if unit else []),
        windows=make_element("li", make_element("i", class_="windows"), "admissible tr")
        if "windows" in known_values
        else "",
        below_energy=below[0],
        below_trade=below[1],
    )
    command_start, command_end = (quote_shell_line(words) for words in explored.command)
    data = {
        "flight": 0,
        "flights": flights,
        "command": [f"{command_start} ", f" {command_end}"],
        **_list_marks_of_judged(judged, flights),
    }
    content = join([Markup(section), _build_data_element("explorer-data", data)])
    return name_section(content, _TITLE, "explorer", needs_script=True)


def _build_keys_of_judged(judged: PairVerdict | None) -> Markup:
    """Return the legend entries of the verified pair and of its finished switched run."""
    names = [] if judged is None else ["the judged pair: tr and td"]
    if judged and judged.computed:
        names.append("switched run, as computed")
    return join(
        make_element("li", make_element("i", class_="verified"), name) for name in names
    )


def _list_marks_of_judged(
    judged: PairVerdict | None, flights: Sequence[Mapping[str, Any]]
) -> dict[str, Any]:
    """Return the times of the verified pair and the energy of its finished switched run, as far as it is visible."""
    if judged is None:
        return {}
    marks: dict[str, Any] = {
        "verified": {"tr": judged.candidate.tr, "td": judged.situation.td}
    }
    if judged.computed:
        start = min(flight["view"][0] for flight in flights)
        end = max(flight["view"][1] for flight in flights)
        visible = judged.computed.between(start, end)
        outline = draw_outline(*visible, stretches=_STRETCHES)
        marks["computed"] = [_round_curve(column) for column in outline]
    return marks


def _strip_whitespace(text: str) -> str:
    """Remove whitespace between elements, and reduce whitespace within strings to single spaces."""
    return re.sub(r"\s*\n\s*", " ", re.sub(r"\s*\n\s*(?=<|$)|(?<=>)\s*\n\s*", "", text))


def _build_data_element(name: str, content: Any) -> Markup:
    """Return an HTML element that holds data for a script, as JSON without anything that could be read as markup."""
    text = json.dumps(content, allow_nan=False, separators=(",", ":"))
    for letter in "<>&":
        text = text.replace(letter, f"\\u{ord(letter):04x}")
    return make_element("script", Markup(text), type="application/json", id=name)


def _describe_flight(trade_off: TradeOff, *times: float) -> dict[str, Any]:
    """Return the curves, marks and texts of one flight; ``times`` [time] of a verified pair are visible, too."""
    situation = trade_off.situation
    history = situation.history
    flight = situation.flight
    first = (
        trade_off.requested
        or trade_off.recommended
        or trade_off.start
        or trade_off.offers[-1]
    )
    view = make_view_of_situation(situation, trade_off.offers[-1].td, *times)
    levels = [offer.energy_td for offer in trade_off.offers]
    scale = make_scale_of_flight(situation, view, levels)
    whole = draw_outline(history.time, history.energy, _OVERVIEW)
    inner = history.between(view.start, view.end)
    time, energy = draw_outline(*inner, stretches=_STRETCHES)
    unit = history.time_unit
    above = [
        f"the {peak_name}, up to {energy:.4g}"
        for peak_name, energy in view.above
        if energy > scale.high
    ]
    cut = f"; cut at the top: {' and '.join(above)}" if above else ""
    if situation.at_rest:
        cut = ", on the scale of the whole run, because nothing vibrates in the flight"
    return {
        "caption": f"Internal energy in the flight{cut}",
        "time": f"time [{unit}]" if unit else "time (unit of the run)",
        "energy_label": label_energy(history.energy_unit),
        "deformation_label": label_deformation(history.energy_unit),
        "error": _name_error(trade_off.offers),
        "saved": _name_saving(trade_off.offers),
        "view": [view.start, view.end],
        "flight": [
            view.start if flight.start is None else flight.start,
            view.end if flight.end is None else flight.end,
        ],
        "heights": [scale.low, scale.high],
        "log": scale.logarithmic,
        "energy": [
            _round_curve(time),
            _round_curve(
                np.maximum(energy, scale.low) if scale.logarithmic else energy
            ),
        ],
        "whole": [_round_curve(column) for column in whole],
        "motion": _list_motion_curves(situation),
        "start": trade_off.offers.index(first),
        **_build_offer_table(trade_off, first, view),
    }


def _list_motion_curves(situation: Situation) -> dict[str, Any] | None:
    """Return the curves from which the script computes the deformation; None if no oscillator is known."""
    motion = compute_response(situation)
    if motion is None:
        return None
    columns = {
        "time": motion.time,
        "reference": motion.reference,
        "release": motion.release,
    }
    return {
        **{name: _round_curve(column) for name, column in columns.items()},
        "preload": motion.preload,
    }


def _round_curve(values: Samples) -> list[float]:
    """Round the values of a curve to six significant digits."""
    return [float(f"{value:.6g}") for value in values.tolist()]


def _build_offer_table(trade_off: TradeOff, first: Offer, view: View) -> dict[str, Any]:
    """Return a row per td and a common header; ``numbers`` are drawn as curves, ``texts`` are shown next to them.

    ``first`` is the offer whose td is shown first; the others are compared with it.
    """
    situation, unit = trade_off.situation, trade_off.situation.history.time_unit
    columns: dict[str, Callable[[Offer], Any]] = {
        "td": lambda offer: offer.td,
        "tr": lambda offer: _round_number(offer.tr),
        "level": lambda offer: _round_number(offer.energy_td),
        "locked": lambda offer: _round_number(
            offer.best.energy if offer.best else None
        ),
        "deformation": lambda offer: _round_number(
            compute_locked_in_deformation(situation, offer.tr)
            if offer.basis == "oscillator"
            else None
        ),
        "saved": lambda offer: _round_number(_compute_saved_percentage(offer)),
        "error": lambda offer: _round_number(offer.error),
        "windows": lambda offer: _mark_columns(
            _list_usable_windows(offer, trade_off.decide_on(offer)), view
        ),
        "peak": lambda offer: int(offer.peak),
        "unbeaten": lambda offer: int(offer.unbeaten),
    }
    names, numbers = fill_table(columns, trade_off.offers)
    texts = [
        _list_texts(
            offer, trade_off.decide_on(offer), first, f" {unit}" if unit else ""
        )
        for offer in trade_off.offers
    ]
    text_names = list(
        dict.fromkeys(name for row in texts for name, text in row.items() if text)
    )
    rows = [
        [values, [row.get(name) or "" for name in text_names]]
        for values, row in zip(numbers, texts, strict=True)
    ]
    return {"numbers": names, "texts": text_names, "rows": rows}


def _compute_saved_percentage(offer: Offer) -> float | None:
    """Return the CPU time that a pair saves [%] or, if part costs are unknown, the rigid fraction of the run [%]."""
    share = offer.saving
    if offer.best and share is None:
        share = offer.best.rigid_fraction
    return None if share is None else 100 * share


def _mark_columns(windows: Sequence[AcceptableWindow], view: View) -> str:
    """Mark the columns of the view that windows touch, as a bit mask in hexadecimal digits; empty without windows.

    The mask has the same length for any number of windows, of which noise makes many, and is finer than a screen.
    """
    ends = np.array([(window.start, window.end) for window in windows]).reshape(-1, 2)
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


def _round_number(value: float | None) -> float | None:
    """Round a number that is drawn rather than printed."""
    return None if value is None else float(f"{value:.6g}")


def _name_error(offers: Sequence[Offer]) -> str:
    """Return the name of the error by which the proposed pairs are compared."""
    if all(offer.basis == "energy" for offer in offers):
        return "level shortfall"
    return "residual"


def _name_saving(offers: Sequence[Offer]) -> str:
    """Return the label of the saving: CPU time or, if the costs of the parts are unknown, rigid time."""
    is_cost_known = any(offer.saving is not None for offer in offers)
    if is_cost_known:
        return "saved, % of the CPU time"
    return "rigid, % of the simulated time"


def _list_texts(
    offer: Offer, decision: Decision | None, start: Offer, unit: str
) -> dict[str, str | None]:
    """Return all texts that are shown for a td, in the words of ``suggest --td``; None for unknown values."""
    best = offer.best
    return {
        "td": format_short(offer.td),
        "tr": format_short(best.tr) if best else "none",
        "exact_td": repr(offer.td),
        "exact_tr": repr(best.tr) if best else "none",
        "level": format_short(offer.energy_td),
        "kinetic": format_if_known(offer.kinetic_share, ".3f"),
        "verdict": decision and decision.verdict,
        "why": decision and decision.reason,
        "badge": decision and CLASSES[decision.verdict],
        "cure": decision and decision.cure,
        "reason": offer.answer.why_none,
        **(_list_texts_of_best(offer, decision, best, unit) if best else {}),
        "compared": _compare_offers(offer, start, unit),
        "said": _format_for_screen_reader(offer),
    }


def _list_usable_windows(
    offer: Offer, decision: Decision | None
) -> Sequence[AcceptableWindow]:
    """Return the windows of admissible tr; none if the verdict forbids them."""
    return () if is_refused(decision) else offer.answer.windows or ()


def _list_texts_of_best(
    offer: Offer, decision: Decision | None, best: Candidate, unit: str
) -> dict[str, str | None]:
    """Return the texts about the recommended tr of a td."""
    kept_share = offer.answer.mean_energy_bounds
    windows = _list_usable_windows(offer, decision)
    return {
        "residual": format_if_known(best.residual, ".3f"),
        "after": None
        if kept_share is None
        else f"{format_bounds(kept_share)} of the reference's",
        "level_error": format_if_known(
            best.level_error if best.residual is None else None, ".3f"
        ),
        "rigid": f"{format_short(best.rigid_time)}{unit}, {best.rigid_fraction:.1%} of the simulated time",
        "run_time": None
        if best.run_time_share is None
        else format_saved_share(best.run_time_share),
        "tolerance": None
        if best.timing_tolerance is None
        else f"±{best.timing_tolerance:.1e}{unit}",
        "windows": describe_acceptable_windows(windows, best.tr) if windows else None,
    }


def _format_for_screen_reader(offer: Offer) -> str:
    """Return the grade of a pair as a sentence for screen readers."""
    best = offer.best
    if best is None:
        return "no admissible tr"
    if best.residual is not None:
        return f"residual {format_measure(best.residual)}"
    return offer.decision.verdict if offer.decision else ""


def _compare_offers(offer: Offer, start: Offer, unit: str) -> str:
    """Describe the advantages and disadvantages of a proposed pair relative to the pair shown first."""
    if offer is start:
        return ""
    apart = offer.td - start.td
    comparisons = [
        f"{abs(apart):.{_READ}g}{unit} {'later' if apart > 0 else 'earlier'} than {format_short(start.td)}{unit}"
    ]
    if offer.best and start.best:
        longer = offer.best.rigid_time - start.best.rigid_time
        share = abs(offer.best.rigid_fraction - start.best.rigid_fraction)
        if share >= _VISIBLE_SHARE:
            comparisons.append(
                f"rigid for {abs(longer):.{_READ}g}{unit} {'longer' if longer > 0 else 'less'}, "
                f"{share:.1%} of the simulated time"
            )
    if offer.saving is not None and start.saving is not None:
        comparisons.append(
            f"saves {offer.saving:.1%} of the CPU time instead of {start.saving:.1%}"
        )
    if (
        offer.error is not None
        and start.error is not None
        and (offer.basis == "energy") == (start.basis == "energy")
    ):
        error, start_error = format_measure(offer.error), format_measure(start.error)
        other = "" if error == start_error else f" instead of {start_error}"
        comparisons.append(f"{_name_error([offer])} {error}{other}")
    return ", ".join(comparisons)
