"""What the user asked for: columns by name, parts by number, range or title."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, NamedTuple

from d2rpick.errors import FormatError, listing
from d2rpick.histories.names import near_miss

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.histories.history import Part

# More digits than any number of a part has are a title.
_RANGE = r"(\d{1,18})(?:\s*-\s*(\d{1,18}))?"  # compiled where it is needed


class Selection(NamedTuple):
    """Columns or labels by name, columns also by 1-based number; parts by number, range or title.

    Nothing asked: the time and the internal energy of the whole model.  Several energies, and the energies of
    several parts, are added.  ``flying`` are the parts that are known to fly together with these.  ``channels`` are
    pairs of a quantity (a key of `d2rpick.histories.names.QUANTITIES`) and the name of the channel that holds it, where
    this is not one of the usual names.  ``springs`` are the numbers of the parts that are springs or dampers, None
    where the energies are to tell.
    """

    time: str | None = None
    energy: tuple[str, ...] = ()
    parts: tuple[str, ...] = ()
    flying: tuple[str, ...] = ()
    channels: tuple[tuple[str, str], ...] = ()
    springs: tuple[str, ...] | None = None


def select_parts(wanted: Sequence[str], known: Sequence[Part], where: str) -> tuple[Part, ...]:
    """Find the parts that are meant by numbers (``3``, ``3,7``), ranges (``10-19``) and titles.

    Raises
    ------
    FormatError
        If a number or title is no part's, a range holds none, or a title is that of several; ``where`` is named.

    Examples
    --------
    >>> from d2rpick.histories.history import Part
    >>> select_parts(["roof", "2-9"], [Part(1, "roof"), Part(2, "door"), Part(7, "seat, left")], "run1")
    (Part(id=1, title='roof'), Part(id=2, title='door'), Part(id=7, title='seat, left'))
    """
    if not known:
        raise FormatError(f"{where}: no parts with histories of their own; add the matsum, binout or T01 of the run")
    found = dict.fromkeys(part for text in wanted for part in _meant(text, known, where))
    return tuple(part for part in known if part in found)


def _meant(text: str, known: Sequence[Part], where: str) -> Iterator[Part]:
    whole = _titled(text, known)
    if whole and "," in text:  # a title may hold a comma
        yield _only(whole, text, where)
        return
    for piece in text.split(","):
        yield from _piece(piece.strip(), known, where)


def _piece(piece: str, known: Sequence[Part], where: str) -> Sequence[Part]:
    titled = _titled(piece, known)
    numbers = re.fullmatch(_RANGE, piece)
    if not numbers:
        if not titled:
            near = near_miss(piece, [part.title for part in known])
            raise FormatError(f"{where}: no part {piece!r}{near}; there are: {menu(known)}")
        return [_only(titled, piece, where)]
    low, high = int(numbers[1]), int(numbers[2] or numbers[1])
    inside = [part for part in known if low <= part.id <= high]
    if titled and titled != inside:
        raise FormatError(
            f"{where}: {piece!r} is the title of part {titled[0].id}, as a number it means {menu(inside) or 'none'}; "
            "choose by a number or title that is one part's only"
        )
    if not inside:
        raise FormatError(f"{where}: no part {piece}; there are: {menu(known)}")
    return inside


def _titled(text: str, known: Sequence[Part]) -> list[Part]:
    """Parts with this title; none of them has no title."""
    wanted = text.strip().casefold()
    return [part for part in known if wanted and part.title.strip().casefold() == wanted]


def _only(titled: Sequence[Part], text: str, where: str) -> Part:
    if len(titled) > 1:
        raise FormatError(f"{where}: {text!r} is the title of several parts, choose by number: {menu(titled)}")
    return titled[0]


def menu(parts: Sequence[Part]) -> str:
    """Parts for a message: number and title."""
    return listing([f"{part.id} {part.title!r}" if part.title else str(part.id) for part in parts])
