"""One table: which result can be written in which form, and by what.

A result is a module of this folder, imported when it is written: ``--help`` lists the forms without it.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    Writer = Callable[[Any, Any, "Shown"], str]


# Columns of text that are read at a glance; a terminal may have fewer.
WIDEST: Final = 100


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


PLAIN: Final[Mapping[str, Writer]] = {
    "table": lambda report, answer, shown: report.as_table(answer, shown),
    "json": lambda report, answer, shown: report.DOCUMENT.as_json(answer, shown.command),
    "csv": lambda report, answer, _: report.as_csv(answer),
    "markdown": lambda report, answer, _: report.as_markdown(answer),
}
_LINE: Final[Mapping[str, Writer]] = {
    "ndjson": lambda report, answer, shown: report.DOCUMENT.as_line(answer, shown.command)
}

# The first form of each is the default.
FORMATS: Final[Mapping[str, Mapping[str, Writer]]] = {
    "suggestion": {
        **PLAIN,
        "markdown": lambda report, answer, shown: report.as_markdown(answer, shown),
        **_LINE,
        "value": lambda report, answer, _: report.as_value(answer),
    },
    "plan": {**PLAIN, **_LINE, "value": lambda report, answer, shown: report.as_value(answer, every=shown.every)},
    "trade_off": {
        **PLAIN,
        "markdown": lambda report, answer, shown: report.as_markdown(answer, shown),
        **_LINE,
    },
    "parts": {**PLAIN, "value": lambda report, answer, _: report.as_value(answer)},
    "calibration": {**PLAIN, "toml": lambda report, answer, _: report.as_toml(answer)},
    "drive": {form: PLAIN[form] for form in ("table", "json")},
    "verdict": PLAIN,
    "overview": PLAIN,
    "study": {
        **PLAIN,
        "ndjson": lambda report, answer, shown: "\n".join([*shown.lines, report.LAST.as_line(answer, shown.command)]),
    },
    "rollover": {
        **PLAIN,
        "markdown": lambda report, answer, _: report.as_markdown(answer.outcomes),
        "csv": lambda report, answer, _: report.as_csv(answer.outcomes),
    },
    "findings": {
        **PLAIN,
        "ndjson": lambda report, answer, shown: report.as_ndjson(answer, shown.command),
        "github": lambda report, answer, _: report.as_github(answer),
        "junit": lambda report, answer, _: report.as_junit(answer),
        "sarif": lambda report, answer, _: report.as_sarif(answer),
    },
}


def write(result: str, form: str, answer: Any, shown: Shown) -> str:
    """Write an answer in one of the forms of its result.

    Examples
    --------
    >>> list(FORMATS["suggestion"])
    ['table', 'json', 'csv', 'markdown', 'ndjson', 'value']
    """
    return FORMATS[result][form](import_module(f"d2rpick.report.{result}"), answer, shown)
