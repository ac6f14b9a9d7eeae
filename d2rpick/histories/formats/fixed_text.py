"""Read solver text files that consist of fixed-column blocks.

A glstat or matsum contains one block for each state. Most blocks of a file have the same lines and therefore the same
number of bytes. Only the first of such blocks is parsed line by line. The following blocks are compared with it, byte
by byte where the text must be the same (labels, part numbers, line ends), and their numbers are then read from the same
offsets. A block that differs is parsed itself. The comparison also shows which numbers are the same in all blocks (for
instance those of a part at rest); these are read only once.
"""

from __future__ import annotations

import re
from array import array
from functools import lru_cache
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.errors import CHOOSE_FORMAT, DamageError, FormatError
from d2rpick.histories.content import count_line_number, make_content
from d2rpick.histories.database import Database
from d2rpick.histories.formats.blocks import (
    UNSURE,
    BlockLayout,
    Grammar,
    Stretch,
    count_like_example,
    parse_fortran_numbers,
    read_head_of_listing,
)
from d2rpick.histories.formats.header import quote_start
from d2rpick.histories.resuming import ResumePoint

if TYPE_CHECKING:
    from collections.abc import Hashable, Iterator, Sequence

    from numpy.typing import NDArray

    from d2rpick.histories.content import Addresses, Bytes, Content
    from d2rpick.histories.history import Samples

    Fields = NDArray[np.bytes_]

_RECENT: Final = 12  # Number of recent block layouts tried before parsing a block.
# Pattern of a printed number, whatever precedes it.
_PRINTED: Final = re.compile(rb"[ +-]*\d[\d.]*(?:[EeDd]?[+-]\d+)?(?=[ \t\r]|$)")
# Largest length of the first line of a block [bytes].
_LINE: Final = 1 << 10


class Blocks(Database):
    """Base class for a `Database` that reads a text file of blocks; it finds the complete states.

    Parameters
    ----------
    data : bytes or Content
        Content of the file.
    source : str
        Name of the format, for messages.
    grammar : Grammar
        Description of the blocks.
    ahead : sequence of names, optional
        Names of numbers that are needed first and together; they are copied while the blocks are compared.

    Attributes
    ----------
    states : int
        Number of complete states.
    tail : int
        Offset of the last block of the file, whether or not it is complete; the offset after the header if there is no
        block.
    rest : Stretch or None
        The last block if the file ends within it; it becomes a state only if ``admit_rest`` is called.
    """

    # Short sequences of equal blocks do not store the positions of differing bytes, which saves memory.
    many = 64
    # Number of printed numbers that are converted at a time, so that these numbers fit into the processor cache.
    batch = 1 << 14

    def __init__(
        self,
        data: bytes | Content,
        source: str,
        grammar: Grammar,
        ahead: Sequence[Hashable] = (),
    ) -> None:
        self.source = source
        self.title, self.version, self._begin = read_head_of_listing(data)
        self._data = make_content(data)
        self._grammar = grammar
        self._end = self._data.rfind(b"\n", 0, len(self._data)) + 1
        # The sequences are packed, so that a file with many different blocks does not fill the memory.
        self._runs = array("q")
        data = self._data
        # The function below must not refer to self, because a reference cycle would keep the file open.
        end = self._end
        self.layout = lru_cache(maxsize=16)(
            lambda at, size: grammar.layout(data[at : min(at + size, end)])
        )
        self._compared = grammar.compare_all
        # True once a request has compared a part of each block.
        self._trusted = False
        # Bits that vary between the blocks of a long sequence of equal blocks, keyed by the start of the sequence.
        self._varied: dict[int, Bytes] = {}
        self._asked_ahead = tuple(ahead)
        # Numbers copied as printed from a long sequence of equal blocks, keyed by the start of the sequence.
        self._ahead: dict[int, Fields] = {}
        self._walk()
        if not self._compared and not self._is_even():
            self._compared = True
            self._walk()

    def __iter__(self) -> Iterator[Stretch]:
        return (
            Stretch(*self._runs[at : at + 4]) for at in range(0, len(self._runs), 4)
        )

    def refuse_foreign(self) -> None:
        """Raise FormatError if the file has neither a header nor a complete state."""
        if not self.version and not self.states:
            raise FormatError(
                f"{self.source}:1: this is not a {self.format}: neither a line with 'ls-dyna' nor a whole state was "
                f"found; {CHOOSE_FORMAT}"
            )

    def numbers(
        self, names: Sequence[Hashable], anchors: Sequence[Hashable] = ()
    ) -> Samples:
        """Return the named numbers in all states, shape (states, len(names)).

        ``anchors`` contains, for each number, the field or line from which the text is compared before the number is
        used; they are needed for files that were not compared completely when they were opened.

        Raises
        ------
        FormatError
            If a number is missing in a state, occurs twice, or is replaced by other text.
        """
        is_checked = self._compared or not anchors
        if not is_checked and (self._trusted or not self._alike(names, anchors)):
            # If a second request occurs, more will usually follow, so all blocks are compared once.
            self._compare_in_full(names)
        self._trusted = self._trusted or bool(anchors)
        taken: dict[int, Fields] = {}
        if tuple(names) == self._asked_ahead:
            # Copied numbers are used only once, because the caller keeps the result.
            taken, self._ahead = self._ahead, taken
        # The operating system allocates memory for an array of zeros only when values are written to it.
        values = np.zeros((self.states, len(names)))
        is_scattered = np.ones(self.states, bool)
        row = 0
        for run in self:
            rows = slice(row, row := row + run.repeats)
            offsets = self._offsets(run, names)
            if run.start in self._varied:
                self._read(values[rows], run, offsets, taken.get(run.start))
                is_scattered[rows] = False
            else:  # The array contains the offsets first, and is then overwritten with the numbers.
                np.add(
                    _compute_starts(run, 0, run.repeats),
                    offsets,
                    out=values[rows].view(np.int64),
                )
        together = values if is_scattered.all() else values[is_scattered]
        flat = together.reshape(-1)
        for piece in np.split(flat, range(self.batch, flat.size, self.batch)):
            piece[:] = self._decoded(piece.view(np.int64))
        if together is not values:
            values[is_scattered] = together
        self._data.check()
        self._refuse_odd(values, names)
        return values

    def admit_rest(self, names: Sequence[Hashable]) -> None:
        """Use the incomplete last block of a file as a state if it contains these numbers and one further line."""
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

    def find_resume_points(self) -> dict[str, ResumePoint]:
        """Return the offset at which a later read can resume: the last state with the third-to-last distinct time.

        The states after this offset show whether the last state is complete, and which of several states with the same
        printed time is the newest.  A last state that `admit_rest` accepted with only the needed lines is incomplete.
        """
        first, begin, end = self._find(self._begin), self.tail, len(self._data)
        head = self._data[: self.tail if first is None else first]
        times = self.numbers([self._grammar.time])[:, 0]
        if times.size:
            state = times.size - 1
            for _ in range(2):
                earlier = np.flatnonzero(times[: state + 1] < times[state])
                state = int(earlier[-1]) if earlier.size else 0
            run, number = self._run_of(state)
            begin = run.start + number * run.stride
            last_run, number = self._run_of(times.size - 1)
            last_used = last_run.start + number * last_run.stride
            if self.rest is not None and last_used == self.rest.start:
                end = last_used
        return {self.source: ResumePoint(head, begin, end)}

    def text(self, start: int, size: int) -> bytes:
        """Return ``size`` bytes at an offset, limited to the end of the last complete line."""
        return self._data[start : min(start + size, self._end)]

    def _read(
        self, values: Samples, run: Stretch, offsets: Addresses, taken: Fields | None
    ) -> None:
        """Read the numbers of many blocks of the same layout. A field that never changes is read only once."""
        varied_before = np.append(0, np.cumsum(self._varied[run.start] != 0))
        moves = varied_before[offsets + self._grammar.width] > varied_before[offsets]
        still = self._decoded(run.start + offsets[~moves])
        if still.view(np.int64).any():
            values[:, ~moves] = still
        # A slice makes no copy, unlike an index array.
        moving = slice(None) if moves.all() else np.flatnonzero(moves)
        step = max(1, self.batch // max(1, offsets[moving].size))
        for begin in range(0, run.repeats if moves.any() else 0, step):
            end = min(begin + step, run.repeats)
            if taken is None:
                addresses = (_compute_starts(run, begin, end) + offsets[moving]).ravel()
                numbers = self._decoded(addresses)
            else:
                fields = taken[begin:end, moving].ravel()
                numbers = parse_fortran_numbers(fields, self._grammar.decimals)
            values[begin:end, moving] = numbers.reshape(end - begin, -1)

    def _decoded(self, addresses: Addresses) -> Samples:
        """Return the numbers at the given offsets; NaN for a field that is not a number."""
        fields = self._data.fields(addresses, self._grammar.width)
        return parse_fortran_numbers(
            fields.view(f"S{self._grammar.width}").ravel(), self._grammar.decimals
        )

    def _refuse_odd(self, values: Samples, names: Sequence[Hashable]) -> None:
        """Raise FormatError with the line of the first of ``values`` (states, len(names)) that is not a number."""
        odd = np.isnan(values)
        if not odd.any():
            return
        state, column = divmod(int(odd.argmax()), len(names))
        run, state = self._run_of(state)
        address = (
            run.start + state * run.stride + int(self._offsets(run, names)[column])
        )
        text = self.text(address, self._grammar.width).decode("latin-1").strip()
        problem = f"{self.source}:{count_line_number(self._data, address)}: {_name_field(names[column])} is {text!r}"
        raise DamageError(
            f"{problem}, but a number in its columns was expected; cut the file before this state"
        )

    def _run_of(self, state: int) -> tuple[Stretch, int]:
        """Return the sequence of equally laid out blocks that contains a state, and the index of the state in it."""
        for run in self:
            if state < run.repeats:
                return run, state
            state -= run.repeats
        raise AssertionError("the file has this state")

    def _offsets(self, run: Stretch, names: Sequence[Hashable]) -> Addresses:
        """Return the offsets of the named numbers in equal blocks; raise FormatError if any of them is ambiguous."""
        layout = self.layout(run.example, run.stride)
        for name in names:
            if not self._has(run, name):
                raise self._explain_missing(run, name)
        return np.array([layout.fields[name] for name in names], dtype=np.int64)

    def _has(self, run: Stretch, name: Hashable) -> bool:
        """Return True if equal blocks contain the number ``name`` exactly once."""
        return self.layout(run.example, run.stride).fields.get(name, UNSURE) != UNSURE

    def _explain_missing(self, run: Stretch, name: Hashable) -> FormatError:
        """Return the error for equal blocks without the number ``name``; a DamageError if their text is damaged.

        A solver may begin or cease to write a number, for instance at a restart. The text is damaged if the number is
        truncated or occurs twice, if it is missing between states that have it, or if its state has a line of a form
        that a state with this number does not have.
        """
        with_it = [other for other in self if self._has(other, name)]
        field = _name_field(name)
        odd_line = self._find_odd_line(run, with_it[0]) if with_it else None
        if odd_line is not None:
            address, text = odd_line
            line = count_line_number(self._data, address)
            return DamageError(
                f"{self.source}:{line}: {quote_start(text)} was found, but a line as in other states was expected, "
                f"because {field} is missing, cut or doubled in this state; repair the line or cut the file"
            )
        is_between = bool(with_it) and with_it[0].start < run.start < with_it[-1].start
        is_unsure = name in self.layout(run.example, run.stride).fields
        line = count_line_number(self._data, run.start)
        kind = DamageError if is_between or is_unsure else FormatError
        return kind(
            f"{self.source}:{line}: {field} is missing, cut or doubled in the state that begins here, but each state "
            "should contain it once; delete this state, or cut the file before it"
        )

    def _find_odd_line(self, run: Stretch, regular: Stretch) -> tuple[int, str] | None:
        """Return the offset and text of the first line of a block whose form no line of a regular block has."""
        usual = {
            self._remove_numbers(line)
            for line in self.text(regular.example, regular.stride).split(b"\n")
        }
        address = run.start
        for line in self.text(run.start, run.stride).split(b"\n"):
            if line.strip() and self._remove_numbers(line) not in usual:
                return address, line.decode("latin-1").strip()
            address += len(line) + 1
        return None

    def _remove_numbers(self, line: bytes) -> bytes:
        """Return the form of a line: its text without blanks, numbers, and other text that may change."""
        return self._grammar.changing.sub(b"", _PRINTED.sub(b"", line)).replace(
            b" ", b""
        )

    # The methods below find the blocks of the file.

    def _walk(self) -> None:
        """Find all sequences of complete blocks."""
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
            following = position + count * stride
            is_last = following >= self._end
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
        """Return True if a block is complete, i.e. contains the number that ends the previous block.

        If there is no previous block, ``whole`` of the grammar decides.
        """
        if previous is None:
            return self._grammar.whole(layout)
        return previous.last in layout.fields

    def _leave_out(self, block: Stretch, is_last: bool) -> None:
        """Omit an incomplete block, and add a note about it."""
        if is_last:
            self.complete, self.rest = False, block
        where = "the file" if is_last else "a restart segment of the run"
        self.notes += (
            f"{where} ends within the state of line {count_line_number(self._data, block.start)}, which was left out",
        )

    def _known(
        self, position: int, recent: list[tuple[int, int]]
    ) -> tuple[int, int, int] | None:
        """Return the example, stride and number of blocks at ``position`` if ``recent`` has their layout, else None."""
        start = self._grammar.start
        for example, stride in recent:
            if self.text(position + stride, len(start)) == start:
                count = self._count(position, example, stride)
                if count:
                    return example, stride, count
        return None

    def _new(
        self, position: int, recent: list[tuple[int, int]]
    ) -> tuple[int, int, int]:
        """Parse a block with a new layout; return an example block, its length, and the number of similar blocks."""
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
        """Return the offset of a recent block that resembles the last block; if there is none, that of the last."""
        alike = (
            example
            for example, stride in recent
            if stride == last.stride
            and count_like_example(
                self._data,
                last._replace(example=example),
                0,
                self.layout(example, stride).literal,
            )
        )
        return next(alike, last.start)

    def _count(self, position: int, example: int, stride: int) -> int:
        """Count the blocks that start at ``position``, resemble the example, and are followed by another block."""
        literal = self.layout(example, stride).literal
        start = self._grammar.start
        run = Stretch(position, stride, (self._end - position) // stride, example)
        if self._compared and run.repeats >= self.many:
            count = self._count_and_take(run, literal)
        elif self._compared:
            count = count_like_example(self._data, run, 0, literal)
        else:
            first_line = self.text(example, _LINE).find(b"\n") + 1
            count = count_like_example(self._data, run, 0, literal[:first_line])
            count = count_like_example(
                self._data, run._replace(repeats=count), stride - 1, literal[-1:]
            )
        if self.text(position + count * stride, len(start)) == start:
            return count
        return max(0, count - 1)

    def _count_and_take(self, run: Stretch, literal: Bytes) -> int:
        """Count the blocks that resemble their example; store their varying bits and the numbers requested ahead."""
        varied = np.zeros_like(literal)
        fields = self.layout(run.example, run.stride).fields
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

        count = count_like_example(
            self._data, run, 0, literal, varied, take if sure else None
        )
        if count > self.many:
            self._varied[run.start] = varied
            if sure:
                self._ahead[run.start] = np.concatenate(ahead)
        return count

    def _alike(self, names: Sequence[Hashable], anchors: Sequence[Hashable]) -> bool:
        """Return True if all blocks equal their examples from the first anchor to the last requested number.

        Return False without a comparison if this is most of a block, because comparing complete blocks then takes no
        longer.
        """
        return all(
            self._alike_in(run, self._offsets(run, names), anchors) for run in self
        )

    def _alike_in(
        self, run: Stretch, offsets: Addresses, anchors: Sequence[Hashable]
    ) -> bool:
        """Return True if all blocks of a sequence equal their example; `_alike` applies this test to all sequences."""
        if run.repeats == 1 and run.start == run.example:
            return True
        layout = self.layout(run.example, run.stride)
        first = min(layout.fields[anchor] for anchor in anchors)
        # The comparison includes the character after the last number.
        end = int(offsets.max()) + self._grammar.width + 1
        text = layout.literal[first:end]
        return (
            2 * text.size <= run.stride
            and count_like_example(self._data, run, first, text) == run.repeats
        )

    def _is_even(self) -> bool:
        """Return True if all blocks except the last have the same size, and the first and the last block are alike."""
        runs = list(self)
        if not runs:
            return True
        first = runs[0]
        literal = self.layout(first.example, first.stride).literal
        last = first.repeats - 1
        return [run.start for run in runs[1:]] in ([], [self.tail]) and all(
            count_like_example(
                self._data,
                first._replace(start=first.start + block * first.stride, repeats=1),
                0,
                literal,
            )
            for block in (min(1, last), last)
        )

    def _compare_in_full(self, names: Sequence[Hashable]) -> None:
        """Compare all blocks completely; raise FormatError if the states differ from those found before."""
        states = self.states
        is_complete = self.complete
        notes = self.notes
        self._compared, self._asked_ahead = True, tuple(names)
        self._walk()
        self.complete, self.notes = is_complete, notes
        if self.states != states:
            raise FormatError(f"{self.source}: states overlap, the file is damaged")

    def _find(self, position: int) -> int | None:
        """Return the offset of the next line that begins a block."""
        start = self._grammar.start
        if position == 0 and self.text(0, len(start)) == start:
            return 0
        address = self._data.find(b"\n" + start, max(0, position - 1)) + 1
        return address if 0 < address < self._end else None


def _compute_starts(run: Stretch, first: int, end: int) -> Addresses:
    """Return the offsets of the blocks ``first`` to ``end - 1`` of a sequence, shape (end - first, 1)."""
    return run.start + run.stride * np.arange(first, end)[:, np.newaxis]


def _name_field(name: Hashable) -> str:
    """Return the name of a field for a message."""
    return f"{name[1]} of part {name[0]}" if isinstance(name, tuple) else f"{name!r}"
