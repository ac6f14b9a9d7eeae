"""Refuse listings of LS-DYNA in which a line between lines of numbers cannot be read."""

from __future__ import annotations

import re
from typing import Final

from d2rpick.base.errors import DamageError
from d2rpick.histories.content import count_line_number, make_content
from d2rpick.histories.formats.header import quote_start

# Texts in the lines that a solver writes between lines of numbers: headers of states, tables and restarts.
_HEADER: Final = rb"(?i)ls-dyna|legend|nodal point|n o d a l|wall#|entity"


def refuse_damaged_rows(name: str, data: bytes, row: bytes) -> None:
    """Raise DamageError if, between two lines of numbers without a blank line, another line cannot be read.

    Parameters
    ----------
    name : str
        Name of the file.
    data : bytes
        Content of the file.
    row : bytes
        Pattern of a line of numbers, which begins at the start of a line.
    """
    between = (
        rb"(?mi)^" + row + rb"[^\n]*\n"
        rb"(?P<odd>(?:(?!" + row + rb")[ \t]*[^\s][^\n]*\n){1,50}?)"
        rb"(?=" + row + rb")"
    )
    for match in re.finditer(between, data):
        if re.search(_HEADER, match["odd"]) is None:
            line = count_line_number(make_content(data), match.start("odd"))
            text = match["odd"].split(b"\n")[0].decode("latin-1")
            raise DamageError(
                f"{name}:{line}: {quote_start(text)} was found, but numbers were expected as in the lines around it; "
                "repair the line, or copy the file again"
            )
