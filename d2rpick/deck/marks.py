"""Where the keywords of an LS-DYNA deck stand, found without a look at each line of its mesh."""

from __future__ import annotations

from contextlib import suppress
from functools import partial
from itertools import pairwise
from threading import Thread
from typing import TYPE_CHECKING, Final

from d2rpick.errors import DeckError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, MutableSequence

    from d2rpick.deck.stored import Held, OnDisk

_PIECE: Final = 1 << 18  # bytes looked at together: they stay in the cache
_SHARED: Final = 1 << 22  # a file from this size on is searched by several threads; it takes long to start one
_SHARES: Final = 2  # the system copies bytes for all of them at once, but only one searches at a time
_LOOKBACK: Final = 32  # bytes in front of a piece, where blanks before its first mark stand, or a head that it cuts
_PGP: Final = b"-----BEGIN PGP MESSAGE"
_ANCHOR: Final = _PGP.index(b"G")  # a letter that mesh data never holds: looking for it alone costs nothing
BYTE_ORDER_MARK: Final = b"\xef\xbb\xbf"  # of UTF-8


def find_marks(file: Held | OnDisk) -> MutableSequence[int]:
    """Offsets of the ``*`` that begin a line (blanks before it allowed) and of encrypted blocks, ascending."""
    shares = _SHARES if file.size >= _SHARED else 1
    first = len(BYTE_ORDER_MARK) if file.read(0, len(BYTE_ORDER_MARK)) == BYTE_ORDER_MARK else 0
    bounds = [first + (file.size - first) * share // shares for share in range(shares + 1)]
    searches = [partial(_between, file, first, *share) for share in pairwise(bounds)]
    helpers = [_Helper(search) for search in searches[1:]]
    for helper in helpers:
        helper.start()
    try:
        found = searches[0]()
    finally:
        for helper in helpers:
            helper.join()
    for helper in helpers:
        found.extend(helper.result())
    return found


class _Helper(Thread):
    """A search beside others."""

    def __init__(self, search: Callable[[], MutableSequence[int]]) -> None:
        super().__init__()
        self._search = search
        self._found: MutableSequence[int] | None = None

    def run(self) -> None:
        """Search; what goes wrong is said by `result`, where it is heard."""
        with suppress(DeckError, OSError):
            self._found = self._search()

    def result(self) -> MutableSequence[int]:
        """Give what was found, or search again."""
        return self._search() if self._found is None else self._found


def _between(file: Held | OnDisk, first: int, begin: int, end: int) -> MutableSequence[int]:
    """Search a part of a file that begins at ``first``."""
    found = _room_for_marks(file)
    with file.opened() as read:
        for at in range(begin, end, _PIECE):
            low = max(first, at - _LOOKBACK)
            piece = read(low, min(at + _PIECE, end))
            found.extend(low + place for place in sorted([*_starred(piece, at - low), *_encrypted(piece, at - low)]))
    return found


def _room_for_marks(file: Held | OnDisk) -> MutableSequence[int]:
    if file.size < _SHARED:
        return []
    from array import array  # a fifth of the memory of a list, which counts where every line of a big file has a mark

    return array("q")


def _starred(piece: bytes, first: int) -> Iterator[int]:
    at = piece.find(b"*", first)
    while at >= 0:
        before = piece[max(0, at - _LOOKBACK) : at].rstrip(b" ")
        if before.endswith(b"\n") or (not before and at < _LOOKBACK):
            yield at
        at = piece.find(b"*", at + 1)


def _encrypted(piece: bytes, first: int) -> Iterator[int]:
    # a head cut by the end of this piece is found in the next one, where all of it stands before the first byte
    at = piece.find(b"G", max(0, first - len(_PGP) + _ANCHOR + 1))
    while at >= 0:
        start = at - _ANCHOR
        if start >= 0 and piece.startswith(_PGP, start) and piece[max(0, start - 1) : start] in (b"", b"\n"):
            yield start
        at = piece.find(b"G", at + 1)
