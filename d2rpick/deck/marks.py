"""Where the keywords of an LS-DYNA deck stand, found without a look at each line of its mesh."""

from __future__ import annotations

from contextlib import suppress
from threading import Thread
from typing import TYPE_CHECKING, Final

from d2rpick.errors import DeckError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, MutableSequence, Sequence

    from d2rpick.deck.stored import Held, OnDisk

_PIECE: Final = 1 << 20  # bytes looked at together: they stay in the cache, always in the same place
_SHARE: Final = 1 << 23  # bytes of a big file that one thread searches before it asks for more
_HELPERS: Final = 1  # threads beside the first: the system copies bytes for all at once, but one at a time searches
_LOOKBACK: Final = 32  # bytes in front of a piece, where blanks before its first mark stand, or a head that it cuts
_PGP: Final = b"-----BEGIN PGP MESSAGE"
_ANCHOR: Final = _PGP.index(b"G")  # a letter that mesh data never holds: looking for it alone costs nothing
BYTE_ORDER_MARK: Final = b"\xef\xbb\xbf"  # of UTF-8


def find_marks(file: Held | OnDisk) -> Sequence[int]:
    """Offsets of the ``*`` that begin a line (blanks before it allowed) and of encrypted blocks, ascending."""
    search = _Search(file)
    helpers = [Thread(target=search.help) for _ in range(_HELPERS if len(search.shares) > 1 else 0)]
    for helper in helpers:
        helper.start()
    try:
        search.go_on()
    finally:
        search.stop()
        for helper in helpers:
            helper.join()
    return search.result()


class _Search:
    """A search of a file by several threads, each of which takes the next share that waits."""

    def __init__(self, file: Held | OnDisk) -> None:
        self._file = file
        self._first = len(BYTE_ORDER_MARK) if file.read(0, len(BYTE_ORDER_MARK)) == BYTE_ORDER_MARK else 0
        self.shares = range(self._first, file.size, _SHARE)
        self._room: Callable[[], MutableSequence[int]] = list if len(self.shares) == 1 else _compact
        self._waiting: Iterator[int] = iter(self.shares)
        self._found: dict[int, Sequence[int]] = {}

    def go_on(self) -> None:
        """Search what waits."""
        while (begin := next(self._waiting, None)) is not None:
            self._found[begin] = self._between(begin, min(begin + _SHARE, self._file.size))

    def stop(self) -> None:
        """Let nothing wait: where this thread was interrupted, no other one goes on."""
        self._waiting = iter(())

    def help(self) -> None:
        """Search beside others; the share with which something goes wrong is left to `result`."""
        with suppress(DeckError, OSError):
            self.go_on()

    def result(self) -> Sequence[int]:
        """All that was found; what a helper left is searched here, where an error is heard."""
        self._waiting = iter([begin for begin in self.shares if begin not in self._found])
        self.go_on()
        marks = self._room()
        for begin in self.shares:
            marks.extend(self._found.pop(begin))
        return marks

    def _between(self, begin: int, end: int) -> Sequence[int]:
        found, piece = self._room(), bytearray(_LOOKBACK + min(_PIECE, end - begin))
        with self._file.opened() as fill:
            for at in range(begin, end, _PIECE):
                low = max(self._first, at - _LOOKBACK)
                size = fill(piece, low, min(at + _PIECE, end))
                places = sorted([*_starred(piece, at - low, size), *_encrypted(piece, at - low, size)])
                found.extend(low + place for place in places)
        return found


def _compact() -> MutableSequence[int]:
    from array import array  # not above: most files are small, and a list of few is as good

    return array("q")


def _starred(piece: bytearray, first: int, end: int) -> Iterator[int]:
    at = piece.find(b"*", first, end)
    while at >= 0:
        before = piece[max(0, at - _LOOKBACK) : at].rstrip(b" ")
        if before.endswith(b"\n") or (not before and at < _LOOKBACK):
            yield at
        at = piece.find(b"*", at + 1, end)


def _encrypted(piece: bytearray, first: int, end: int) -> Iterator[int]:
    # a head cut by the end of this piece is found in the next one, where all of it stands before the first byte
    at = piece.find(b"G", max(0, first - len(_PGP) + _ANCHOR + 1), end)
    while at >= 0:
        start = at - _ANCHOR
        before = bytes(piece[max(0, start - 1) : max(0, start)])
        if start >= 0 and piece.startswith(_PGP, start, end) and before in (b"", b"\n"):
            yield start
        at = piece.find(b"G", at + 1, end)
