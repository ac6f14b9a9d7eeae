"""The answer of ``reproduce`` as table, JSON, CSV and Markdown."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from d2rpick import __version__
from d2rpick.models.published import MISPRINTS, MOST_DIFFERENCE, PUBLISHED, better_pair, residual
from d2rpick.report import tables

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.models.published import Row

SCHEMA = "d2rpick/reproduce/1"
_DECIMALS = 12
_HEAD = ("quantity", "unit", "published", "here", "difference", "source")


def as_table(rows: Sequence[Row]) -> str:
    """Published beside here, the pairs, the misprints."""
    body: list[list[tables.Cell]]
    body = [[row.what, row.unit, row.published, _rounded(row.here), _difference(row), row.source] for row in rows]
    misprints = [f"  {misprint}" for misprint in MISPRINTS]
    return "\n".join([tables.as_text(_HEAD, body), "", *_pairs(), "", "misprints in the paper", *misprints])


def as_markdown(rows: Sequence[Row], exhibits: Sequence[tuple[str, str]] = ()) -> str:
    """Give the same as Markdown, with the figures (title, file) where there are any."""
    body = [[r.what, r.unit, f"{r.published:.12g}", f"{_rounded(r.here):.12g}", _difference(r), r.source] for r in rows]
    blocks = [
        "# Analysis of switched-rigid floating oscillator, reproduced",
        f"k = 660e3 N/m, M = 31.4 kg, beta = 2, alpha = 50 1/s, V0 = 6 m/s; d2rpick {__version__}.",
        *(f"## {title}\n\n![{title}]({file})" for title, file in exhibits),
        "## Published and here",
        tables.as_markdown(_HEAD, body),
        *_pairs(),
        "## Misprints in the paper",
        "\n".join(f"* {misprint}" for misprint in MISPRINTS),
    ]
    return "\n\n".join(blocks)


def as_csv(rows: Sequence[Row]) -> str:
    """Give the rows at full precision."""
    body: list[list[tables.Cell]] = [[r.what, r.unit, r.published, r.here, r.difference, r.source] for r in rows]
    return tables.as_csv(_HEAD, body).rstrip("\n")


def as_json(rows: Sequence[Row], files: Sequence[str], command: Sequence[str]) -> str:
    """Everything by schema d2rpick/reproduce/1."""
    keys = ("what", "unit", "published", "here", "difference", "source", "agrees")
    return tables.as_json(
        {
            "schema": SCHEMA,
            "tool_version": __version__,
            "command": list(command),
            "warnings": [],
            "rows": [{key: getattr(row, key) for key in keys} for row in rows],
            "published": _pair(PUBLISHED),
            "better": _pair(better_pair()),
            "misprints": list(MISPRINTS),
            "files": list(files),
        }
    )


def _rounded(value: float) -> float:
    """Without what is rounding and differs from machine to machine."""
    return round(value, _DECIMALS)


def _difference(row: Row) -> str:
    return "0" if abs(row.difference) < MOST_DIFFERENCE * abs(row.published) else f"{row.difference:.1e}"


def _pair(pair: tuple[float, float]) -> dict[str, Any]:
    return {"tr": pair[0], "td": pair[1], "residual": residual(pair)}


def _pairs() -> list[str]:
    return [
        f"{name} pair: tr = {1e3 * pair[0]:.6g} ms, td = {1e3 * pair[1]:.6g} ms, residual {residual(pair):.3f}"
        for name, pair in (("published", PUBLISHED), ("better", better_pair()))
    ]
