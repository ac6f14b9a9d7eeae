"""Messages of the library speak of arguments, in backticks; the command line names the options that set them."""

from __future__ import annotations

import re
from typing import Final

# Argument of the library: option that sets it.
OPTIONS: Final = {
    "after": "--after",
    "fit_window": "--fit-window",
}


def with_options(message: str) -> str:
    """Replace the arguments that a message names by the options that set them.

    Examples
    --------
    >>> with_options("give it as `after` where it is known")
    'give it as --after where it is known'
    """
    return re.sub(r"`(\w+)`", lambda found: OPTIONS.get(found[1], found[0]), message)
