"""List the output formats of each result, and write results in these formats.

Each result has a module in this folder.  It is imported only to write the result, so that ``--help`` starts fast.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

from d2rpick.base.tuples import NamedTuple

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence


# Largest width of a text line [columns], because longer lines are hard to read.
WIDEST: Final = 100

PLAIN: Final = ("table", "json", "csv", "markdown")
# Output formats of each result; the first format is the default.
FORMATS: Final[Mapping[str, Sequence[str]]] = {
    "suggestion": (*PLAIN, "ndjson", "value"),
    "plan": (*PLAIN, "ndjson", "value"),
    "trade_off": (*PLAIN, "ndjson"),
    "parts": (*PLAIN, "value"),
    "calibration": (*PLAIN, "toml"),
    "drive": ("table", "json"),
    "verdict": PLAIN,
    "overview": (*PLAIN, "ndjson"),
    "study": (*PLAIN, "ndjson"),
    "rollover": PLAIN,
    "findings": (*PLAIN, "ndjson", "github", "junit", "sarif"),
}
# Modules that write only the table of a result, without the imports that its other formats need.
_TABLES: Final = {"findings": "findings_table", "overview": "overview_table"}


class WrittenDeck(NamedTuple):
    """The folder of a deck that was written with the cards of a plan, and the result of checking this deck.

    ``passed`` is True if the check found no error, ``warned`` if it found an error or a warning.
    """

    folder: str
    passed: bool
    warned: bool


class RepeatedQuestion(NamedTuple):
    """Parts of the command line with which another command asks about the same run.

    Parameters
    ----------
    times : tuple of str
        Options that only the same command has, such as a given td.
    parts : tuple of str
        Options that name the parts to be switched.
    options : tuple of str
        All other options that select and judge the run.
    judging : tuple of str
        All options and files by which ``card`` judges in the same way.
    checking : tuple of str
        All options and files by which ``check`` judges in the same way.
    files : tuple of str
        Files of the history.
    card : tuple of str
        Options of the card, which only a command that prints a card accepts.
    unused_deck : str
        Main deck that the user named but that belongs to another model; empty if there is none.
    """

    times: tuple[str, ...] = ()
    parts: tuple[str, ...] = ()
    options: tuple[str, ...] = ()
    judging: tuple[str, ...] = ()
    checking: tuple[str, ...] = ()
    files: tuple[str, ...] = ()
    card: tuple[str, ...] = ()
    unused_deck: str = ""


class DisplayOptions(NamedTuple):
    """Content to show in addition to the answer: the command, the number of rows, and lines that were already written.

    With ``every``, all windows of a plan are shown, not only the supported ones; with ``verbose``, all details.  Tables
    and text are no wider than ``width`` columns.  ``written_deck`` is the deck that was written with the answer.
    ``question`` has the words with which the next command asks about the same run.  ``page`` is the name of the HTML
    page that was written with the answer, if any.
    """

    command: Sequence[str] = ()
    limit: int = 10
    every: bool = False
    lines: Sequence[str] = ()
    verbose: bool = False
    width: int = WIDEST
    written_deck: WrittenDeck | None = None
    question: RepeatedQuestion = RepeatedQuestion()
    page: str = ""


def write(result: str, form: str, answer: Any, display: DisplayOptions) -> str:
    """Write an answer in a format.

    JSON is written by the ``DOCUMENT`` of a report module, any other format by ``as_FORM``.

    Examples
    --------
    >>> list(FORMATS["suggestion"])
    ['table', 'json', 'csv', 'markdown', 'ndjson', 'value']
    """
    module = _TABLES.get(result, result) if form == "table" else result
    return write_by_module(
        import_module(f"d2rpick.report.{module}"), form, answer, display
    )


def write_by_module(
    report: Any, form: str, answer: Any, display: DisplayOptions
) -> str:
    """Write an answer in a format that ``module`` provides."""
    if write_form := getattr(report, f"as_{form}", None):
        return str(write_form(answer, display))
    return str(
        report.DOCUMENT.as_json(answer, display.command, 2 if form == "json" else None)
    )
