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
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.errors import FormatError
from d2rpick.histories.content import content_of, line_at
from d2rpick.histories.database import Database
from d2rpick.histories.formats.blocks import (
    UNSURE,
    BlockLayout,
    Grammar,
    Stretch,
    decode,
    head,
    like_example,
)

if TYPE_CHECKING:
    from collections.abc import Hashable, Iterator, Sequence

    from numpy.typing import NDArray

    from d2rpick.histories.content import Addresses, Bytes, Content
    from d2rpick.histories.history import Samples

    Fields = NDArray[np.bytes_]

_RECENT: Final = 12  # layouts tried before a block is taken apart
_LINE: Final = 1 << 10  # no first line of a block is longer


class Blocks(Database):
    """The whole states of one file; what they hold, and whether a file without any is one, says a database made of it.

    Parameters
    ----------
    data : bytes or Content
        The file.
    source : str
        Its name, for messages.
    grammar : Grammar
        What a block looks like.
    ahead : sequence of names, optional
        Numbers that will be asked for first, together: they are taken while all blocks are compared.

    Attributes
    ----------
    states : int
        Number of whole states.
    tail : int
        Address at which the last block of the file starts, whole or not; that behind the head when there is none.
    rest : Stretch or None
        The last block, when the file ends within it: it is no state unless ``admit_rest`` makes it one.
    """

    many = 64  # of so many blocks it is remembered what differs between them, a small share of the file
    batch = 1 << 14  # numbers that are converted together: they stay in the cache

    def __init__(
        self,
        data: bytes | Content,
        source: str,
        grammar: Grammar,
        ahead: Sequence[Hashable] = (),
    ) -> None:
        self.source = source
        self.title, self.version, self._begin = head(data)
        self._data = content_of(data)
        self._grammar = grammar
        self._end = self._data.rfind(b"\n", 0, len(self._data)) + 1
        self._runs = array(
            "q"
        )  # packed: a file whose blocks all differ must not fill the memory
        data, end = self._data, self._end  # not self: a circle would keep the file open
        self.layout = lru_cache(maxsize=16)(
            lambda at, size: grammar.layout(data[at : min(at + size, end)])
        )
        self._compared = grammar.compare_all
        self._trusted = False  # whether a part of each block was compared for numbers that were asked for
        self._varied: dict[
            int, Bytes
        ] = {}  # by the start of a run of many blocks: 0 for the bytes that they share
        self._asked_ahead = tuple(ahead)
        self._ahead: dict[
            int, Fields
        ] = {}  # by the start of such a run: the numbers taken of its blocks, as printed
        self._walk()
        if not self._compared and not self._is_even():
            self._compared = True
            self._walk()

    def __iter__(self) -> Iterator[Stretch]:
        return (
            Stretch(*self._runs[at : at + 4]) for at in range(0, len(self._runs), 4)
        )

    def refuse_foreign(self) -> None:
        """FormatError where there is neither a head nor a state."""
        if not self.version and not self.states:
            told = f"{self.source}:1: neither a line with 'ls-dyna' nor a whole state was found, this is not a"
            raise FormatError(f"{told} {self.format}; choose another input format")

    def numbers(
        self, names: Sequence[Hashable], anchors: Sequence[Hashable] = ()
    ) -> Samples:
        """Numbers of all states, shape (states, len(names)).

        ``anchors`` name, for each number, the field or line from which on the text is compared before the
        number is trusted, in files that were not compared in full when they were opened.

        Raises
        ------
        FormatError
            If a state lacks one of the numbers, has it twice, or has something else in its place.
        """
        if (
            anchors
            and not self._compared
            and (self._trusted or not self._alike(names, anchors))
        ):
            self._compare_in_full(
                names
            )  # who asks again will go on asking: one comparison is for all
        self._trusted = self._trusted or bool(anchors)
        taken: dict[int, Fields] = {}
        if tuple(names) == self._asked_ahead:
            taken, self._ahead = self._ahead, taken  # who asks again has them
        values = np.zeros(
            (self.states, len(names))
        )  # memory that is never written costs nothing
        few, row = np.ones(self.states, bool), 0
        for run in self:
            rows = slice(row, row := row + run.repeats)
            offsets = self._offsets(run, names)
            if run.start in self._varied:
                self._read(values[rows], run, offsets, taken.get(run.start))
                few[rows] = False
            else:  # each address gives way to the number found there
                np.add(
                    _starts(run, 0, run.repeats),
                    offsets,
                    out=values[rows].view(np.int64),
                )
        together = values if few.all() else values[few]
        flat = together.reshape(-1)
        for piece in np.split(flat, range(self.batch, flat.size, self.batch)):
            piece[:] = self._decoded(piece.view(np.int64))
        if together is not values:
            values[few] = together
        self._data.check()
        self._refuse_odd(values, names)
        return values

    def admit_rest(self, names: Sequence[Hashable]) -> None:
        """Let the last state count although the file ends within it, if these numbers and a line behind are there."""
        if self.rest is None:
            return
        offsets = [
            self.layout(self.rest.example, self.rest.stride).fields.get(name, UNSURE)
            for name in names
        ]
        end_of_line = self._data.find(b"\n", self.rest.start + max(offsets))
        if UNSURE in offsets or end_of_line == len(self._data) - 1:
            return
        self._runs.extend(self.rest)
        self.states += 1
        self.notes = (
            *self.notes[:-1],
            "the file ends within its last state, after the lines that were needed",
        )

    def text(self, start: int, size: int) -> bytes:
        """Copy a piece of the whole lines of the file."""
        return self._data[start : min(start + size, self._end)]

    def _read(
        self, values: Samples, run: Stretch, offsets: Addresses, taken: Fields | None
    ) -> None:
        """Read the numbers of a run of many blocks, which may have been taken; what never changes is read once."""
        before = np.append(0, np.cumsum(self._varied[run.start] != 0))
        moves = before[offsets + self._grammar.width] > before[offsets]
        still = self._decoded(run.start + offsets[~moves])
        if still.view(np.int64).any():
            values[:, ~moves] = still
        moving = (
            slice(None) if moves.all() else np.flatnonzero(moves)
        )  # without copies, as mostly
        step = max(1, self.batch // max(1, offsets[moving].size))
        for at in range(0, run.repeats if moves.any() else 0, step):
            end = min(at + step, run.repeats)
            if taken is None:
                found = self._decoded((_starts(run, at, end) + offsets[moving]).ravel())
            else:
                found = decode(taken[at:end, moving].ravel(), self._grammar.decimals)
            values[at:end, moving] = found.reshape(end - at, -1)

    def _decoded(self, addresses: Addresses) -> Samples:
        """Numbers at these addresses, NaN for what is none."""
        fields = self._data.fields(addresses, self._grammar.width)
        return decode(
            fields.view(f"S{self._grammar.width}").ravel(), self._grammar.decimals
        )

    def _refuse_odd(self, values: Samples, names: Sequence[Hashable]) -> None:
        """FormatError with the line of the first of values (states, len(names)) that is no number."""
        odd = np.isnan(values)
        if not odd.any():
            return
        state, place = divmod(int(odd.argmax()), len(names))
        run, state = self._run_of(state)
        address = run.start + state * run.stride + int(self._offsets(run, names)[place])
        text = self.text(address, self._grammar.width).decode("latin-1").strip()
        what = f"{self.source}:{line_at(self._data, address)}: {_spoken(names[place])} is {text!r}"
        raise FormatError(
            f"{what}, a number in its columns was expected; cut the file before this state"
        )

    def _run_of(self, state: int) -> tuple[Stretch, int]:
        """Find the run that a state belongs to, and its place there."""
        for run in self:
            if state < run.repeats:
                return run, state
            state -= run.repeats
        raise AssertionError("there is such a state")

    def _offsets(self, run: Stretch, names: Sequence[Hashable]) -> Addresses:
        layout = self.layout(run.example, run.stride)
        for name in names:
            if layout.fields.get(name, UNSURE) == UNSURE:
                raise FormatError(
                    f"{self.source}:{line_at(self._data, run.start)}: {_spoken(name)} is missing, cut or doubled in "
                    "the state that begins here, each state should have it once; leave it out or cut the file"
                )
        return np.array([layout.fields[name] for name in names], dtype=np.int64)

    # How blocks are found

    def _walk(self) -> None:
        """Find all runs of blocks, leaving out blocks that are not whole."""
        self._runs, self._varied, self._ahead = array("q"), {}, {}
        self.notes = ()
        self.complete = not self._data[self._end : self._end + 4096].strip()
        self.states, self.tail = 0, self._begin
        self.rest: Stretch | None = None
        recent: list[tuple[int, int]] = []
        previous: BlockLayout | None = None
        position = self._find(self._begin)
        while position is not None:
            example, stride, count = self._known(position, recent) or self._new(
                position, recent
            )
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
        return (
            self._grammar.whole(layout)
            if previous is None
            else previous.last in layout.fields
        )

    def _leave_out(self, block: Stretch, is_last: bool) -> None:
        if is_last:
            self.complete, self.rest = False, block
        where = "the file" if is_last else "a leg of the run"
        self.notes += (
            f"{where} ends within the state of line {line_at(self._data, block.start)}, which was left out",
        )

    def _known(
        self, position: int, recent: list[tuple[int, int]]
    ) -> tuple[int, int, int] | None:
        """Try the recent layouts: example, stride and count of the blocks that follow one of them."""
        start = self._grammar.start
        fitting = (
            one for one in recent if self.text(position + one[1], len(start)) == start
        )
        counted = ((*one, self._count(position, *one)) for one in fitting)
        return next((found for found in counted if found[2]), None)

    def _new(
        self, position: int, recent: list[tuple[int, int]]
    ) -> tuple[int, int, int]:
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
            and like_example(
                self._data,
                last._replace(example=example),
                0,
                self.layout(example, stride).literal,
            )
        )
        return next(alike, last.start)

    def _count(self, position: int, example: int, stride: int) -> int:
        """Count the blocks from ``position`` on that look like the example and have another behind them."""
        literal, start = self.layout(example, stride).literal, self._grammar.start
        run = Stretch(position, stride, (self._end - position) // stride, example)
        if self._compared and run.repeats >= self.many:
            count = self._count_and_take(run, literal)
        elif self._compared:
            count = like_example(self._data, run, 0, literal)
        else:
            first_line = self.text(example, _LINE).find(b"\n") + 1
            count = like_example(self._data, run, 0, literal[:first_line])
            count = like_example(
                self._data, run._replace(repeats=count), stride - 1, literal[-1:]
            )
        return (
            count
            if self.text(position + count * stride, len(start)) == start
            else max(0, count - 1)
        )

    def _count_and_take(self, run: Stretch, literal: Bytes) -> int:
        """Count the blocks like the example; remember what differs in them, and the numbers that will be asked for."""
        varied, fields = (
            np.zeros_like(literal),
            self.layout(run.example, run.stride).fields,
        )
        offsets = np.array(
            [fields.get(name, UNSURE) for name in self._asked_ahead], dtype=np.int64
        )
        sure = offsets.size > 0 and not np.any(offsets == UNSURE)
        width = self._grammar.width
        ahead: list[Fields] = []

        def take(rows: Bytes) -> None:
            starts = np.ndarray(
                (len(rows), run.stride - width + 1),
                f"S{width}",
                rows,
                strides=(rows.strides[0], 1),
            )
            ahead.append(starts[:, offsets])

        count = like_example(
            self._data, run, 0, literal, varied, take if sure else None
        )
        if count > self.many:
            self._varied[run.start] = varied
            if sure:
                self._ahead[run.start] = np.concatenate(ahead)
        return count

    def _alike(self, names: Sequence[Hashable], anchors: Sequence[Hashable]) -> bool:
        """Tell whether in all blocks the text from the first anchor to the last number is that of their examples.

        False without a look where that is most of a block: to compare all of it costs no more.
        """
        return all(
            self._alike_in(run, self._offsets(run, names), anchors) for run in self
        )

    def _alike_in(
        self, run: Stretch, offsets: Addresses, anchors: Sequence[Hashable]
    ) -> bool:
        if run.repeats == 1 and run.start == run.example:
            return True
        layout = self.layout(run.example, run.stride)
        first = min(layout.fields[anchor] for anchor in anchors)
        text = layout.literal[
            first : int(offsets.max()) + self._grammar.width + 1
        ]  # with what follows a number
        return (
            2 * text.size <= run.stride
            and like_example(self._data, run, first, text) == run.repeats
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
            like_example(
                self._data,
                first._replace(start=first.start + block * first.stride, repeats=1),
                0,
                literal,
            )
            for block in (min(1, last), last)
        )

    def _compare_in_full(self, names: Sequence[Hashable]) -> None:
        states, told = self.states, (self.complete, self.notes)
        self._compared, self._asked_ahead = True, tuple(names)
        self._walk()
        self.complete, self.notes = told
        if self.states != states:
            raise FormatError(f"{self.source}: states overlap, the file is damaged")

    def _find(self, position: int) -> int | None:
        """Address of the next line that begins a block."""
        start = self._grammar.start
        if position == 0 and self.text(0, len(start)) == start:
            return 0
        found = self._data.find(b"\n" + start, max(0, position - 1)) + 1
        return found if 0 < found < self._end else None


def _starts(run: Stretch, first: int, behind: int) -> Addresses:
    """Addresses of some blocks of a run, shape (behind - first, 1)."""
    return run.start + run.stride * np.arange(first, behind)[:, np.newaxis]


def _spoken(name: Hashable) -> str:
    """Name a field in a message."""
    return f"{name[1]} of part {name[0]}" if isinstance(name, tuple) else f"{name!r}"
