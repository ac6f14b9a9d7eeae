"""One table: which result can be written in which form.

A result is a module of this folder, imported when it is written: ``--help`` lists the forms without it.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

from d2rpick.base.tuples import NamedTuple

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence


# Columns of text that are read at a glance; a terminal may have fewer.
WIDEST: Final = 100

PLAIN: Final = ("table", "json", "csv", "markdown")
# The first form of each is the default.
FORMATS: Final[Mapping[str, Sequence[str]]] = {
    "suggestion": (*PLAIN, "ndjson", "value"),
    "plan": (*PLAIN, "ndjson", "value"),
    "trade_off": (*PLAIN, "ndjson"),
    "parts": (*PLAIN, "value"),
    "calibration": (*PLAIN, "toml"),
    "drive": ("table", "json"),
    "verdict": PLAIN,
    "overview": PLAIN,
    "study": (*PLAIN, "ndjson"),
    "rollover": PLAIN,
    "findings": (*PLAIN, "ndjson", "github", "junit", "sarif"),
}


class Shown(NamedTuple):
    """What a form may show beside the answer: the command that was given, how many rows, lines written before.

    ``every``: all windows of a plan, not only the supported ones.  ``verbose``: all that is known; tables and text are
    no wider than ``width`` columns.
    """

    command: Sequence[str] = ()
    limit: int = 10
    every: bool = False
    lines: Sequence[str] = ()
    verbose: bool = False
    width: int = WIDEST


def write(result: str, form: str, answer: Any, shown: Shown) -> str:
    """Write an answer in one of the forms of its result: by ``as_FORM`` of its module, JSON by its ``DOCUMENT``.

    Examples
    --------
    >>> list(FORMATS["suggestion"])
    ['table', 'json', 'csv', 'markdown', 'ndjson', 'value']
    """
    return written_by(import_module(f"d2rpick.report.{result}"), form, answer, shown)


def written_by(report: Any, form: str, answer: Any, shown: Shown) -> str:
    """Write an answer in a form of the module of its result."""
    if own := getattr(report, f"as_{form}", None):
        return str(own(answer, shown))
    return str(
        report.DOCUMENT.as_json(answer, shown.command, 2 if form == "json" else None)
    )
