"""Solver text databases made of blocks of fixed columns: where the numbers stand, and what they are.

glstat and matsum write one block per state.  Blocks of one file mostly have the same lines, hence the same
number of bytes.  So a block is taken apart line by line once; the blocks after it are only compared with it,
byte by byte where the text must be the same (labels, part numbers, line ends), and the numbers are then
fetched by address.  Where a block differs, it is taken apart itself.  The comparison also shows which numbers
are the same in all blocks, as those of a part at rest: they are fetched once.
"""

from __future__ import annotations

from array import array
from functools import lru_cache
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.base.errors import FormatError
from d2rpick.histories.content import content_of
from d2rpick.histories.formats.blocks import CHUNK, UNSURE, BlockLayout, Grammar, Stretch, like_example
from d2rpick.histories.formats.printed import decode

if TYPE_CHECKING:
    from collections.abc import Hashable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from d2rpick.histories.content import Addresses, Bytes, Content
    from d2rpick.histories.history import Samples

    Fields = NDArray[np.bytes_]

_RECENT: Final = 4  # layouts tried before a block is taken apart
_LINE: Final = 1 << 10  # no first line of a block is longer
_NEAR: Final = 1 << 12  # fields closer than this are compared in one piece


class Portions(NamedTuple):
    """How much of a text is looked at together."""

    many: int = 64  # of so many blocks it is remembered what differs between them, a small share of the file
    chunk: int = CHUNK  # bytes in which the beginning of a line is looked for
    batch: int = 1 << 14  # numbers that are converted: they stay in the cache


PORTIONS: Final = Portions()
_NOTHING: Final[Mapping[int, Fields]] = {}


class Blocks:
    """The whole states of one file.

    Parameters
    ----------
    data : bytes or Content
        The file.
    source : str
        Its name, for messages.
    begin : int
        Address behind the head.
    grammar : Grammar
        What a block looks like.
    ahead : sequence of names, optional
        Numbers that will be asked for first, together: they are taken while all blocks are compared.
    portions : Portions

    Attributes
    ----------
    states : int
        Number of whole states.
    complete : bool
        False when the file ends within a state or a line.
    notes : tuple of str
        What was left out.
    tail : int
        Address at which the last block of the file starts, whole or not; ``begin`` when there is none.
    rest : Stretch or None
        The last block, when the file ends within it: it is no state unless ``admit_rest`` makes it one.
    """

    def __init__(
        self, data: bytes | Content, source: str, begin: int, grammar: Grammar, ahead: Sequence[Hashable] = (),
        portions: Portions = PORTIONS,
    ) -> None:  # fmt: skip
        self.source, self._portions = source, portions
        self._data = content_of(data)
        self._grammar = grammar
        self._end = self._data.rfind(b"\n", 0, len(self._data)) + 1
        self._begin = begin
        self._runs = array("q")  # packed: a file whose blocks all differ must not fill the memory
        data, end = self._data, self._end  # not self: a circle would keep the file open
        self.layout = lru_cache(maxsize=16)(lambda at, size: grammar.describe(data[at : min(at + size, end)]))
        self._compared = grammar.compare_all
        self._trusted = False  # whether a part of each block was compared for numbers that were asked for
        self._varied: dict[int, Bytes] = {}  # by the start of a run of many blocks: 0 for the bytes that they share
        self._asked_ahead = tuple(ahead)
        self._ahead: dict[int, Fields] = {}  # by the start of such a run: the numbers taken of its blocks, as printed
        self.states, self.complete = 0, True
        self.notes: tuple[str, ...] = ()
        self.rest: Stretch | None = None
        self._walk()
        if not self._compared and not self._is_even():
            self._compared = True
            self._walk()

    def __iter__(self) -> Iterator[Stretch]:
        return (Stretch(*self._runs[at : at + 4]) for at in range(0, len(self._runs), 4))

    def numbers(self, names: Sequence[Hashable], anchors: Sequence[Hashable] = ()) -> Samples:
        """Numbers of all states, shape (states, len(names)).

        ``anchors`` name, for each number, the field or line from which on the text is compared before the
        number is trusted, in files that were not compared in full when they were opened.

        Raises
        ------
        FormatError
            If a state lacks one of the numbers, has it twice, or has something else in its place.
        """
        if anchors and not self._compared and (self._trusted or not self._alike(names, anchors)):
            self._compare_in_full(names)  # who asks again will go on asking: one comparison is for all
        self._trusted = self._trusted or bool(anchors)
        if self._ahead and tuple(names) == self._asked_ahead:
            taken, self._ahead = self._ahead, {}  # who asks again has them
            return self._table(names, taken)
        moving = self._moving(names)
        if 2 * np.count_nonzero(moving) > moving.size:
            return self._table(names)
        values = np.zeros((self.states, len(names)))  # memory that is never written costs nothing
        still = [name for name, moves in zip(names, moving.tolist(), strict=True) if not moves]
        row = 0
        for run in self:
            first = (run.start + self._offsets(run, still)).view(np.float64)
            self._fetch(first, still)
            if first.view(np.int64).any():
                values[row : row + run.repeats, ~moving] = first
            row += run.repeats
        values[:, moving] = self._table([name for name, moves in zip(names, moving.tolist(), strict=True) if moves])
        return values

    def admit_rest(self, names: Sequence[Hashable]) -> None:
        """Let the last state count although the file ends within it, if these numbers and a line behind are there."""
        if self.rest is None:
            return
        offsets = [self.layout(self.rest.example, self.rest.stride).fields.get(name, UNSURE) for name in names]
        end_of_line = self._data.find(b"\n", self.rest.start + max(offsets))
        if UNSURE in offsets or end_of_line == len(self._data) - 1:
            return
        self._runs.extend(self.rest)
        self.states += 1
        self.notes = (*self.notes[:-1], "the file ends within its last state, after the lines that were needed")

    def line(self, address: int) -> int:
        """Find the number of the line at ``address``, from 1."""
        chunk = self._portions.chunk
        return 1 + sum(self._data[at : min(at + chunk, address)].count(b"\n") for at in range(0, address, chunk))

    def text(self, start: int, size: int) -> bytes:
        """Copy a piece of the whole lines of the file."""
        return self._data[start : min(start + size, self._end)]

    def _fetch(self, values: Samples, names: Sequence[Hashable]) -> None:
        """Replace the addresses in ``values`` by the numbers that stand there."""
        grammar, batch = self._grammar, self._portions.batch
        addresses = values.view(np.int64)
        for at in range(0, values.size, batch):
            where = addresses[at : at + batch].copy()
            fields = self._data.fields(where, grammar.width).view(f"S{grammar.width}").ravel()
            found = decode(fields, grammar.decimals)
            values[at : at + batch] = found
            if np.isnan(found).any():
                self._data.check()
                bad = int(np.argmax(np.isnan(found)))
                address, name = int(where[bad]), names[(at + bad) % len(names)]
                text = self.text(address, grammar.width).decode("latin-1").strip()
                what = f"{self.source}:{self.line(address)}: {_spoken(name)} is {text!r}"
                raise FormatError(f"{what}, a number in its columns was expected; cut the file before this state")
        self._data.check()

    def _moving(self, names: Sequence[Hashable]) -> NDArray[np.bool_]:
        """Tell of each number whether it may differ from state to state, shape (len(names),)."""
        moving = np.full(len(names), not self._varied)
        for run in self:
            if run.repeats == 1:
                continue
            if run.start not in self._varied:
                return np.ones_like(moving)
            moving |= self._moves(run, names)
        return moving

    def _moves(self, run: Stretch, names: Sequence[Hashable]) -> NDArray[np.bool_]:
        """Tell the same of the blocks of a run whose differences are known."""
        before = np.concatenate([[0], np.cumsum(self._varied[run.start] != 0)])
        offsets = self._offsets(run, names)
        return np.asarray(before[offsets + self._grammar.width] > before[offsets])

    def _table(self, names: Sequence[Hashable], taken: Mapping[int, Fields] = _NOTHING) -> Samples:
        """Numbers of all states, shape (states, len(names)): of some runs they are at hand, the others are fetched."""
        values, left = np.empty((self.states, len(names))), np.ones(self.states, bool)
        addresses = values.view(np.int64)  # each address gives way to the number found there
        row = 0
        for run in self:
            rows = slice(row, row := row + run.repeats)
            if run.start in taken:
                values[rows] = self._converted(taken[run.start][: run.repeats], self._moves(run, names))
                left[rows] = np.isnan(values[rows]).any()  # it is fetched again to say where
            if left[rows.start]:
                starts = run.start + run.stride * np.arange(run.repeats)
                np.add(starts[:, None], self._offsets(run, names), out=addresses[rows])
        fetched = values if left.all() else values[left]
        self._fetch(fetched.reshape(-1), names)
        if fetched is not values:
            values[left] = fetched
        return values

    def _converted(self, fields: Fields, moving: NDArray[np.bool_]) -> Samples:
        """Numbers of fields (states, names), NaN for what is none; what is the same in all states only once."""
        values, decimals = np.empty(fields.shape), self._grammar.decimals
        values[:, ~moving] = decode(fields[0, ~moving], decimals)
        step = max(1, self._portions.batch // max(1, int(moving.sum())))
        for at in range(0, len(fields), step):
            some = fields[at : at + step, moving]
            values[at : at + step, moving] = decode(some.ravel(), decimals).reshape(some.shape)
        return values

    def _offsets(self, run: Stretch, names: Sequence[Hashable]) -> Addresses:
        layout = self.layout(run.example, run.stride)
        for name in names:
            if layout.fields.get(name, UNSURE) == UNSURE:
                raise FormatError(
                    f"{self.source}:{self.line(run.start)}: {_spoken(name)} is missing, cut or doubled in "
                    "the state that begins here, each state should have it once; leave it out or cut the file"
                )
        return np.array([layout.fields[name] for name in names], dtype=np.int64)

    # How blocks are found

    def _walk(self) -> None:
        """Find all runs of blocks, leaving out blocks that are not whole."""
        self._runs, self._varied, self._ahead = array("q"), {}, {}
        self.notes = ()
        self.complete = not self._data[self._end : self._end + 4096].strip()
        self.states, self.tail, self.rest = 0, self._begin, None
        recent: list[tuple[int, int]] = []
        previous: BlockLayout | None = None
        position = self._find(self._begin)
        while position is not None:
            example, stride, count = self._known(position, recent) or self._new(position, recent)
            layout = self.layout(example, stride)
            self.tail = position + (count - 1) * stride
            is_last = (following := position + count * stride) >= self._end
            if (layout.broken_off or is_last) and not self._is_whole(layout, previous):
                self._leave_out(Stretch(position, stride, 1, example), is_last)
            else:
                self._runs.extend((position, stride, count, example))
                self.states += count
                previous = layout
            position = None if is_last else following
        if not self.complete and not self.notes:
            self.notes = ("the file ends within a line, which was left out",)

    def _is_whole(self, layout: BlockLayout, previous: BlockLayout | None) -> bool:
        return self._grammar.whole(layout) if previous is None else previous.last in layout.fields

    def _leave_out(self, block: Stretch, is_last: bool) -> None:
        if is_last:
            self.complete, self.rest = False, block
        where = "the file" if is_last else "a leg of the run"
        self.notes += (f"{where} ends within the state of line {self.line(block.start)}, which was left out",)

    def _known(self, position: int, recent: list[tuple[int, int]]) -> tuple[int, int, int] | None:
        """Try the recent layouts: example, stride and count of the blocks that follow one of them."""
        for example, stride in recent:
            count = self._count(position, example, stride)
            if count:
                return example, stride, count
        return None

    def _new(self, position: int, recent: list[tuple[int, int]]) -> tuple[int, int, int]:
        """Take the block apart: the same for a layout not met before."""
        following = self._find(position + 1)
        if following is None:
            last = Stretch(position, self._end - position, 1, position)
            return self._repeated(last, recent), last.stride, 1
        stride = following - position
        if self.layout(position, stride).broken_off:
            return position, stride, 1
        recent.insert(0, (position, stride))
        del recent[_RECENT:]
        return position, stride, self._count(position, position, stride)

    def _repeated(self, last: Stretch, recent: list[tuple[int, int]]) -> int:
        """Find a recent example that the last block of the file is like, or take the block itself."""
        alike = (
            example
            for example, stride in recent
            if stride == last.stride
            and like_example(self._data, last._replace(example=example), 0, self.layout(example, stride).literal)
        )
        return next(alike, last.start)

    def _count(self, position: int, example: int, stride: int) -> int:
        """Count the blocks from ``position`` on that look like the example and have another behind them."""
        literal, start = self.layout(example, stride).literal, self._grammar.start
        run = Stretch(position, stride, (self._end - position) // stride, example)
        if self._compared and run.repeats >= self._portions.many:
            count = self._count_and_take(run, literal)
        elif self._compared:
            count = like_example(self._data, run, 0, literal)
        else:
            first_line = self.text(example, _LINE).find(b"\n") + 1
            count = like_example(self._data, run, 0, literal[:first_line])
            count = like_example(self._data, run._replace(repeats=count), stride - 1, literal[-1:])
        return count if self.text(position + count * stride, len(start)) == start else max(0, count - 1)

    def _count_and_take(self, run: Stretch, literal: Bytes) -> int:
        """Count the blocks like the example; remember what differs in them, and the numbers that will be asked for."""
        varied, fields = np.zeros_like(literal), self.layout(run.example, run.stride).fields
        offsets = np.array([fields.get(name, UNSURE) for name in self._asked_ahead], dtype=np.int64)
        sure = offsets.size > 0 and not np.any(offsets == UNSURE)
        width = self._grammar.width
        ahead: list[Fields] = []

        def take(rows: Bytes) -> None:
            starts = np.ndarray((len(rows), run.stride - width + 1), f"S{width}", rows, strides=(rows.strides[0], 1))
            ahead.append(starts[:, offsets])

        count = like_example(self._data, run, 0, literal, varied, take if sure else None)
        if count > self._portions.many:
            self._varied[run.start] = varied
            if sure:
                self._ahead[run.start] = np.concatenate(ahead)
        return count

    def _alike(self, names: Sequence[Hashable], anchors: Sequence[Hashable]) -> bool:
        """Tell whether in all blocks the text from anchors to numbers is that of their examples.

        False without a look where that is most of a block: to compare all of it costs no more.
        """
        return all(self._alike_in(run, self._offsets(run, names), anchors) for run in self)

    def _alike_in(self, run: Stretch, offsets: Addresses, anchors: Sequence[Hashable]) -> bool:
        if run.repeats == 1 and run.start == run.example:
            return True
        layout = self.layout(run.example, run.stride)
        first = np.array([layout.fields[anchor] for anchor in anchors])
        order = np.argsort(first)
        behind = offsets[order] + self._grammar.width + 1  # what follows a number is compared, too
        first, last = first[order], np.maximum.accumulate(behind)
        gaps = np.flatnonzero(first[1:] - last[:-1] > _NEAR) + 1
        pieces = [
            (int(firsts[0]), int(lasts[-1]))
            for firsts, lasts in zip(np.split(first, gaps), np.split(last, gaps), strict=True)
        ]
        return 2 * sum(high - low for low, high in pieces) <= run.stride and all(
            like_example(self._data, run, low, layout.literal[low:high]) == run.repeats for low, high in pieces
        )

    def _is_even(self) -> bool:
        """Tell whether all blocks but the last have one size, and look alike at both ends of the file."""
        runs = list(self)
        if not runs:
            return True
        first = runs[0]
        literal = self.layout(first.example, first.stride).literal
        last = first.repeats - 1
        return [run.start for run in runs[1:]] in ([], [self.tail]) and all(
            like_example(self._data, first._replace(start=first.start + block * first.stride, repeats=1), 0, literal)
            for block in (min(1, last), last)
        )

    def _compare_in_full(self, names: Sequence[Hashable]) -> None:
        states = self.states
        self._compared, self._asked_ahead = True, tuple(names)
        self._walk()
        if self.states != states:
            raise FormatError(f"{self.source}: states overlap, the file is damaged")

    def _find(self, position: int) -> int | None:
        """Address of the next line that begins a block."""
        start, chunk = self._grammar.start, self._portions.chunk
        if position == 0 and self.text(0, len(start)) == start:
            return 0
        for at in range(max(0, position - 1), self._end, chunk):
            found = self.text(at, chunk + len(start)).find(b"\n" + start)
            if found >= 0:
                return at + found + 1
        return None


def _spoken(name: Hashable) -> str:
    """Name a field in a message."""
    return f"{name[1]} of part {name[0]}" if isinstance(name, tuple) else f"{name!r}"
