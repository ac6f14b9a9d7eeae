"""Where the keywords of an LS-DYNA deck stand, found without a look at each line of its mesh."""

from __future__ import annotations

from contextlib import suppress
from threading import Thread
from typing import TYPE_CHECKING, Final

from d2rpick.errors import DeckError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, MutableSequence, Sequence

    from d2rpick.deck.stored import Held, OnDisk

_PIECE: Final = 1 << 20  # bytes looked at together: they stay in the cache, always in the same place
_HELPERS: Final = 1  # threads beside the first: the system copies bytes for all at once, but one at a time searches
_ALONE: Final = 4  # pieces that one thread searches before another one would have begun
_LOOKBACK: Final = 32  # bytes in front of a piece, where blanks before its first mark stand, or a head that it cuts
_PGP: Final = b"-----BEGIN PGP MESSAGE"
_ANCHOR: Final = _PGP.index(b"G")  # a letter that mesh data never holds: looking for it alone costs nothing
BYTE_ORDER_MARK: Final = b"\xef\xbb\xbf"  # of UTF-8


def find_marks(
    file: Held | OnDisk, piece: int = _PIECE, *, alone: int = _ALONE, helpers: int = _HELPERS
) -> Sequence[int]:
    """Offsets of the ``*`` that begin a line (blanks before it allowed) and of encrypted blocks, ascending.

    A file of more than ``alone`` pieces of so many bytes is searched by ``helpers`` threads beside this one.
    """
    search = _Search(file, piece)
    threads = [Thread(target=search.help) for _ in range(helpers if len(search.pieces) > alone else 0)]
    for thread in threads:
        thread.start()
    try:
        search.go_on()
    finally:
        search.stop()
        for thread in threads:
            thread.join()
    return search.result()


class _Search:
    """A search of a file by several threads, each of which takes the next piece that waits."""

    def __init__(self, file: Held | OnDisk, piece: int) -> None:
        self._file, self._piece = file, piece
        self._first = len(BYTE_ORDER_MARK) if file.read(0, len(BYTE_ORDER_MARK)) == BYTE_ORDER_MARK else 0
        self.pieces = range(self._first, file.size, piece)
        self._room: Callable[[Iterable[int]], MutableSequence[int]] = list if len(self.pieces) == 1 else _compact
        self._waiting: Iterator[int] = iter(self.pieces)
        self._found: dict[int, Sequence[int]] = {}

    def go_on(self) -> None:
        """Search what waits, all of it in one buffer: fresh memory costs more than what is put into it."""
        found: dict[int, Sequence[int]] = {}
        piece = bytearray(_LOOKBACK + min(self._piece, self._file.size))
        with self._file.opened() as fill:
            while (begin := next(self._waiting, None)) is not None:
                low = max(self._first, begin - _LOOKBACK)
                size = fill(piece, low, min(begin + self._piece, self._file.size))
                places = _starred(piece, begin - low, size) + _encrypted(piece, begin - low, size)
                found[begin] = self._room([low + place for place in sorted(places)]) if places else ()
        self._found |= found  # not before: only now it is sure that the file did not change

    def stop(self) -> None:
        """Let nothing wait: where this thread was interrupted, no other one goes on."""
        self._waiting = iter(())

    def help(self) -> None:
        """Search beside others; the pieces of a thread with which something goes wrong are left to `result`."""
        with suppress(DeckError, OSError):
            self.go_on()

    def result(self) -> Sequence[int]:
        """All that was found; what a helper left is searched here, where an error is heard."""
        if left := [begin for begin in self.pieces if begin not in self._found]:
            self._waiting = iter(left)
            self.go_on()
        marks = self._room(())
        for begin in self.pieces:
            marks.extend(self._found.pop(begin))
        return marks


def _compact(places: Iterable[int]) -> MutableSequence[int]:
    from array import array  # not above: most files are small, and a list of few is as good

    return array("q", places)


def _starred(piece: bytearray, first: int, end: int) -> list[int]:
    found, at = [], piece.find(b"*", first, end)
    while at >= 0:
        before = piece[max(0, at - _LOOKBACK) : at].rstrip(b" ")
        if before.endswith(b"\n") or (not before and at < _LOOKBACK):
            found.append(at)
        at = piece.find(b"*", at + 1, end)
    return found


def _encrypted(piece: bytearray, first: int, end: int) -> list[int]:
    # a head cut by the end of this piece is found in the next one, where all of it stands before the first byte
    found, at = [], piece.find(b"G", max(0, first - len(_PGP) + _ANCHOR + 1), end)
    while at >= 0:
        start = at - _ANCHOR
        before = bytes(piece[max(0, start - 1) : max(0, start)])
        if start >= 0 and piece.startswith(_PGP, start, end) and before in (b"", b"\n"):
            found.append(start)
        at = piece.find(b"G", at + 1, end)
    return found
