"""The interactive part of a page: td can be dragged, typed and moved by keys, and all that depends on it follows.

Python computes and prints everything; the script in ``explorer.js`` looks it up.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from statistics import median
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from d2rpick.choice.replayed import locked_in, response
from d2rpick.choice.view import scale_of, view_of
from d2rpick.histories.samples import outline
from d2rpick.report.explorer_rows import VALUES, error_name, row_of, saved_name, table_of
from d2rpick.report.html import Markup, join, resource, tag
from d2rpick.report.shell import shell_line

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from d2rpick.choice.offer import Offer
    from d2rpick.choice.situation import Situation
    from d2rpick.choice.trade_off import TradeOff
    from d2rpick.histories.history import Samples

# Stretches of the energy in sight, each with its lowest and highest value, and of the whole record in the overview.
_STRETCHES: Final = 600
_OVERVIEW: Final = 200
_HELP: Final = (
    "Drag the handle in the energy, type a td, or move it with the arrow keys; a click on a point of the trade-off "
    "selects it. Everything was computed for the td in a grid and at the peaks of the energy: the nearest one is shown."
)


@dataclass(frozen=True)
class Explorer:
    """What can be explored: the trade-offs of one or several flights.

    ``command`` is the command line that asks for the pair of a td, in front of td and behind it.
    """

    trade_offs: tuple[TradeOff, ...]
    command: tuple[Sequence[str], Sequence[str]]


def styles() -> tuple[Markup, ...]:
    """Give the style sheets that the interactive part needs."""
    return resource("uplot/uPlot.min.css"), resource("explorer.css")


def scripts() -> tuple[Markup, ...]:
    """Give the scripts, in their order; that of uPlot with its licence."""
    licence = join([Markup("/*!\n"), resource("uplot/LICENSE"), Markup("*/\n")])
    return Markup(licence + resource("uplot/uPlot.iife.min.js")), resource("explorer.js")


def explorer(shown: Explorer) -> Markup:
    """Give the section, hidden until its script finds that it can run, and its data."""
    flights = [_flight(one) for one in shown.trade_offs]
    before, behind = (shell_line(words) for words in shown.command)
    content = (
        tag("h2", "What another td would cost"),
        tag("p", _HELP, class_="soft"),
        _controls(shown.trade_offs),
        tag(
            "div",
            *_columns(flights, any("windows" in flight["texts"] for flight in flights)),
            class_="panels",
        ),
        tag("h3", "To repeat this"),
        tag("pre", class_="wrap", data_value="command", tabindex="0"),
    )
    found = {"flight": 0, "flights": flights, "command": [f"{before} ", f" {behind}"]}
    return join([tag("section", *content, class_="explorer", id="explorer", hidden=""), data("explorer-data", found)])


def data(name: str, content: Any) -> Markup:
    """Give data for a script: JSON in which nothing can be taken for markup."""
    text = json.dumps(content, allow_nan=False, separators=(",", ":"))
    for letter in "<>&":
        text = text.replace(letter, f"\\u{ord(letter):04x}")
    return tag("script", Markup(text), type="application/json", id=name)


_ENERGY: Final = (
    ("flight", "flight"), ("", "internal energy"), ("level", "level at td; dashed: tr"), ("windows", "acceptable tr"),
)  # fmt: skip
_MOTION: Final = (("", "without switching"), ("switched", "switched"))
_CAPTION: Final = "Error against saving"
_TRADE: Final = (("point", "no other td has less error and saves more"), ("beaten", "other td"))


def _controls(trade_offs: Sequence[TradeOff]) -> Markup:
    """What td is typed into, and buttons."""
    unit = trade_offs[0].situation.history.time_unit
    field = tag("input", id="explorer-td", inputmode="decimal", autocomplete="off", spellcheck="false")
    buttons = (("earlier", "Earlier peak"), ("later", "Later peak"), ("back", "Back"))
    flights = (tag("option", f"flight {i + 1}", value=str(i)) for i in range(len(trade_offs)))
    chooser = tag("label", "flight", tag("select", *flights, id="explorer-flight"))
    return tag(
        "div",
        *((chooser,) if len(trade_offs) > 1 else ()),
        tag("label", f"td{f' [{unit}]' if unit else ''}", field),
        *(tag("button", text, type="button", class_=name) for name, text in buttons),
        tag("p", class_="said", role="status"),
        class_="controls",
    )


def _values(flights: Sequence[Mapping[str, Any]]) -> Markup:
    """What is known of the pair in sight; what no pair has is left out."""
    known = {name for flight in flights for name in flight["texts"]}
    times = (tag("span", tag("i", name), tag("b", data_value=name)) for name in ("tr", "td"))
    full = (tag("span", f"{name} = ", tag("b", data_value=f"exact_{name}")) for name in ("tr", "td"))
    listed = (tag("div", tag("dt", name), tag("dd", data_value=key)) for key, name in VALUES.items() if key in known)
    shown = (
        tag("h3", "The best pair for this td"),
        tag("div", *times, class_="times"),
        tag("p", "in full: ", join(full, ", "), class_="soft exact"),
        tag("dl", *listed),
    )
    return tag("div", *shown, class_="now")


def _columns(flights: Sequence[Mapping[str, Any]], windows: bool) -> Iterator[Markup]:
    """Charts and values in two columns; on a narrow page the style puts them below each other in another order."""
    left = [
        _chart("energy", "Internal energy in the flight", _ENERGY if windows else _ENERGY[:-1]),
        _chart("whole", "The whole record; shaded: what is shown above", ()),
    ]
    right, values = [_chart("trade", _CAPTION, _TRADE)], _values(flights)
    if any(flight["motion"] for flight in flights):
        left.append(_chart("motion", "Deformation of the oscillator behind the record", _MOTION))
        right.append(values)
    else:
        left.append(values)
    yield from (tag("div", *column, class_="column") for column in (left, right))


def _chart(name: str, caption: str, key: Iterable[tuple[str, str]]) -> Markup:
    """Give the place of a chart, with its caption and what its marks mean."""
    entries = [tag("li", tag("i", **({"class_": mark} if mark else {})), text) for mark, text in key]
    listed = (tag("ul", *entries, class_="key"),) if entries else ()
    described = {"role": "group" if name == "energy" else "img", "aria_label": caption}
    return tag("div", tag("p", caption), tag("div", class_="plot", **described), *listed, class_=f"chart {name}")


def _flight(found: TradeOff) -> dict[str, Any]:
    """What is drawn and said of one flight."""
    situation = found.situation
    history, flight = situation.history, situation.flight
    first = found.asked or found.recommended or found.start or found.offers[-1]
    seen = view_of(situation, found.offers[-1].td)
    levels = [one.energy_td for one in found.offers]
    scale = scale_of(min(seen.low, *levels), max(seen.high, *levels), median(levels))
    whole = outline(history.time, history.energy, _OVERVIEW)
    inner = history.between(seen.start, seen.end)
    time, energy = outline(*inner, stretches=_STRETCHES)
    unit = history.time_unit
    above = [f"the {what}, up to {energy:.4g}" for what, energy in seen.above if energy > scale.high]
    cut = f"; cut at the top: {' and '.join(above)}" if above else ""
    return {
        "caption": f"Internal energy in the flight{cut}",
        "time": f"time [{unit}]" if unit else "time",
        "error": error_name(found.offers),
        "saved": saved_name(found.offers),
        "view": [seen.start, seen.end],
        "flight": [
            seen.start if flight.start is None else flight.start,
            seen.end if flight.end is None else flight.end,
        ],
        "heights": [scale.low, scale.high],
        "log": scale.logarithmic,
        "energy": [_brief(time), _brief(np.maximum(energy, scale.low) if scale.logarithmic else energy)],
        "whole": [_brief(column) for column in whole],
        "motion": _motion(situation),
        "start": found.offers.index(first),
        **table_of([row_of(one, first, seen, unit, _locked(situation, one)) for one in found.offers]),
    }


def _motion(situation: Situation) -> dict[str, Any] | None:
    """Give the curves of which the script composes the deformation; None where no oscillator is known."""
    found = response(situation)
    if found is None:
        return None
    columns = {"time": found.time, "reference": found.reference, "release": found.release}
    return {**{name: _brief(column) for name, column in columns.items()}, "preload": found.preload}


def _locked(situation: Situation, offer: Offer) -> float | None:
    """Deformation that an offer locks in, where one oscillator knows it."""
    return locked_in(situation, offer.tr) if offer.basis == "oscillator" and offer.tr is not None else None


def _brief(values: Samples) -> list[float]:
    """Numbers for a curve, to six digits."""
    return [float(f"{value:.6g}") for value in values.tolist()]
