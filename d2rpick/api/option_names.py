"""Replace the names of Python arguments in messages with the options of the command line."""

from __future__ import annotations

import re
from typing import Final

from d2rpick.api.cards import Cards
from d2rpick.api.request import OPTIONS
from d2rpick.base.options import list_options, make_option_name

# Arguments that messages show in backticks.
ARGUMENTS: Final = (
    *OPTIONS,
    *list_options(Cards),
    *(
        "td",
        "td_window",
        "tr",
        "min_rigid",
        "overwrite",
        "write_as",
        "done",
        "before",
        "wait",
        "min_mean_energy",
        "switched",
    ),
)
# Options whose names differ from the names of their arguments.
_OTHERS: Final = {
    "parts": "part",
    "channels": "channel",
    "replay": "no_verify",
    "run": "history",
}


def replace_arguments(message: str) -> str:
    """Replace the names of arguments in a message with the options that set these arguments.

    Examples
    --------
    >>> replace_arguments("give it as `after` where it is known")
    'give it as --after where it is known'
    """
    has_names = "`" in message
    if has_names:
        return re.sub(
            r"`(\w+)`", lambda match: find_option(match[1]) or match[0], message
        )
    return message


def find_option(argument: str) -> str:
    """Return the option that sets an argument; empty if there is no such option."""
    name = _OTHERS.get(argument, argument)
    return f"--{make_option_name(name)}" if name in ARGUMENTS else ""
