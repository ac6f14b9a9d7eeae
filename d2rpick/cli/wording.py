"""Messages of the library speak of arguments, in backticks; the command line names the options that set them."""

from __future__ import annotations

import re
from typing import Final

# Argument of the library: option that sets it.
OPTIONS: Final = {
    "after": "--after",
    "deck": "--deck",
    "energy": "--energy",
    "fit_window": "--fit-window",
    "min_rigid": "--min-rigid",
    "overwrite": "--overwrite",
    "parts": "--part",
    "td": "--td",
    "td_window": "--td-window",
    "time": "--time",
    "weights": "--weights",
    "tr": "--tr",
    "write_as": "--write-as",
}
_FOR_PROGRAMS: Final = {"json", "ndjson", "csv", "value"}


def with_options(message: str) -> str:
    """Replace the arguments that a message names by the options that set them.

    Examples
    --------
    >>> with_options("give it as `after` where it is known")
    'give it as --after where it is known'
    """
    return re.sub(r"`(\w+)`", lambda found: OPTIONS.get(found[1], found[0]), message)


def in_words(text: str, form: str) -> str:
    """Name the options in a result that people read; other programs get the arguments.

    Examples
    --------
    >>> in_words("choose with `energy`", "table"), in_words("choose with `energy`", "json")
    ('choose with --energy', 'choose with `energy`')
    """
    return text if form in _FOR_PROGRAMS else with_options(text)
