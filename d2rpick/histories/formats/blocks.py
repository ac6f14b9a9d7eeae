"""Describe the blocks of solver text files, count repeated blocks, and read the numbers in blocks."""

from __future__ import annotations

import re
from functools import cache
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from d2rpick.base import __version__
from d2rpick.base.tuples import NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Mapping, Sequence

    from numpy.typing import NDArray

    from d2rpick.histories.content import Bytes, Content
    from d2rpick.histories.history import Samples


# Placeholder for the offset of a field that is truncated or occurs twice in the block.
UNSURE: Final = -1

# Lines of at least this length are treated as damaged [bytes], because solvers never write such long lines.
_OVERLONG: Final = 512

# Number of bytes that are compared at a time, so that these bytes fit into the processor cache.
CHUNK: Final = 1 << 20
# Number of adjacent blocks that are compared as one row, which halves the computing time.
_FOLD: Final = 16
# Largest block that is compared with other blocks [bytes]; larger blocks are parsed one by one.
_LONGEST: Final = 1 << 22
_NUMBER: Final = re.compile(
    rb" *([+-]?(?:\d+\.?\d*|\.\d+))(?:[EeDd]?([+-]\d+)|[EeDd](\d+))?"
)
# Largest exponent of a power of ten that a double represents exactly.
_EXACT: Final = 22
# Bit flags of a negative exponent and of a negative number. The lower bits contain the two exponent digits.
_SHRINKS, _NEGATIVE = 1 << 8, 1 << 9


class BlockLayout(NamedTuple):
    """The layout of a block of text: the position of each number in it.

    ``fields`` maps the name of a number to its offset in the block, or to UNSURE. ``literal``, shape (size of the
    block,), is 255 for the bytes that all blocks of this layout have in common, including all line ends, and 0 for the
    others; therefore no additional line can remain undetected. ``last`` is the name of the last number of the block.
    ``broken_off`` is True if the header of another run follows instead of the next block.
    """

    fields: Mapping[Any, int]
    literal: Bytes
    last: Hashable
    broken_off: bool


class Grammar(NamedTuple):
    """Description of the blocks of a file format, with everything that is needed to read a file.

    ``start`` is the text at the start of a block; ``lines`` matches the known lines. ``describe`` takes a block and
    these lines, returns the offsets of its numbers and the name of the last one, and sets the columns of the numbers in
    ``literal`` to 0. ``changing`` matches the text in other lines that may differ between blocks; it matches only short
    pieces, so that no complete line is ignored. ``time`` is the name of the first number. ``whole`` returns True if the
    only block of a file is known to be complete. Numbers have ``width`` columns and ``decimals`` decimals. If
    ``compare_all`` is True, all blocks are compared completely when the file is opened. Otherwise, if all blocks have
    the same size, only their first lines are compared at that time, and the rest when it is read.
    """

    start: bytes
    lines: re.Pattern[bytes]
    describe: Callable[
        [bytes, Sequence[re.Match[bytes]], Bytes], tuple[Mapping[Any, int], Hashable]
    ]
    changing: re.Pattern[bytes]
    time: Hashable
    whole: Callable[[BlockLayout], bool]
    width: int
    decimals: int
    compare_all: bool

    def layout(self, block: bytes) -> BlockLayout:
        """Determine the layout of a block."""
        literal = np.full(len(block), 255, np.uint8)
        lines = [*self.lines.finditer(block)]
        edges = [0, *(edge for line in lines for edge in line.span()), len(block)]
        for begin, end in zip(edges[::2], edges[1::2], strict=True):
            for piece in self.changing.finditer(block, begin, end):
                literal[piece.start() : piece.end()] = 0
        fields, last = self.describe(block, lines, literal)
        longest_line = max(map(len, block.split(b"\n")))
        if longest_line >= _OVERLONG:  # A damaged line may hide further states.
            fields = {
                name: offset if name == self.time else UNSURE
                for name, offset in fields.items()
            }
        return BlockLayout(fields, literal, last, broken_off=b"ls-dyna" in block)


def read_head_of_listing(data: bytes | Content) -> tuple[str, str, int]:
    """Read the header of an LS-DYNA text file.

    Returns
    -------
    title, version : str
        Title of the run and version of the solver; both are empty if the file has no header.
    begin : int
        Offset of the first byte after the header.
    """
    lines = data[:4096].split(b"\n")
    if len(lines) < 3 or b"ls-dyna" not in lines[1]:
        return "", "", 0
    title, version = (line.decode("latin-1") for line in lines[:2])
    return title.strip(), " ".join(version.split()), len(title) + len(version) + 2


def make_head(title: str, database: str) -> str:
    """Return the two header lines of a generated file, which name no release because no solver wrote the file."""
    return f" {title}\n{' ' * 25}d2rpick {__version__}, layout of ls-dyna {database}\n"


class Stretch(NamedTuple):
    """A sequence of ``repeats`` blocks of ``stride`` bytes from ``start`` with the layout of the one at ``example``."""

    start: int
    stride: int
    repeats: int
    example: int


def count_like_example(
    data: Content, run: Stretch, offset: int, literal: Bytes, varied: Bytes | None = None,
    take: Callable[[Bytes], object] | None = None,
) -> int:  # fmt: skip
    """Count the blocks of ``run`` whose fixed bytes from ``offset`` on equal those of the example block.

    Parameters
    ----------
    data : Content
    run : Stretch
    offset : int
        Offset in the blocks at which the comparison starts [bytes].
    literal : array of shape (size,)
        255 for the bytes that must equal those of the example, 0 for the others.
    varied : array of shape (size,), optional
        Array that is set to the bits in which a byte of any counted block differs from the example.
    take : callable, optional
        Function that is called with these bytes of the counted blocks, shape (count, size), some blocks at a time.

    Examples
    --------
    >>> from d2rpick.histories.content import Content
    >>> literal, varied = np.array([255, 255, 0, 0], np.uint8), np.zeros(4, np.uint8)
    >>> count_like_example(Content(b"a=10a=12b=14"), Stretch(0, 4, 3, 0), 0, literal, varied), varied.tolist()
    (2, [0, 0, 0, 2])
    """
    size = literal.size
    example = data.view(run.example + offset, run.example + offset + size).copy()
    done, step = (0, 1) if size else (run.repeats, 1)
    largest_step = max(1, CHUNK // max(1, size))
    if largest_step > _FOLD:
        largest_step -= largest_step % _FOLD
    alike = True
    while alike and done < run.repeats:
        rows = _view_rows(
            data,
            run.start + done * run.stride + offset,
            run.stride,
            min(step, run.repeats - done),
            size,
        )
        differing = _find_differing_bits(rows, example)
        alike = not (differing & literal).any()
        if not alike:
            rows = rows[: int(((rows ^ example) & literal).any(axis=1).argmax())]
            if len(rows):
                differing = _find_differing_bits(rows, example)
            else:
                differing = np.zeros_like(example)
        if varied is not None:
            varied |= differing
        if take is not None:
            take(rows)
        done += len(rows)
        step = min(2 * step, largest_step)
    return done


def _view_rows(data: Content, first: int, stride: int, count: int, size: int) -> Bytes:
    """Return ``size`` bytes of each of ``count`` blocks, shape (count, size)."""
    if 2 * size < stride:
        return data.fields(first + stride * np.arange(count), size)
    span = data.view(first, first + (count - 1) * stride + size)
    return np.ndarray((count, size), np.uint8, span, strides=(stride, 1))


def _find_differing_bits(rows: Bytes, example: Bytes) -> Bytes:
    """Return a bit mask of the bits in which at least one row (count, size) differs from ``example``, both (size,)."""
    count, size = rows.shape
    if count % _FOLD == 0 and rows.flags.c_contiguous:
        rows = rows.reshape(count // _FOLD, _FOLD * size)
    # A bit is the same in all rows and the example if both the AND and the OR of the rows equal the example.
    bits_of_all = _reduce_rows(np.bitwise_and, rows, size)
    bits_of_any = _reduce_rows(np.bitwise_or, rows, size)
    return np.asarray((bits_of_all ^ example) | (bits_of_any ^ example))


def _reduce_rows(operation: np.ufunc, rows: Bytes, size: int) -> Bytes:
    """Combine rows of one or more blocks of ``size`` bytes into a single block by a bitwise operation."""
    folded = operation.reduce(rows, axis=0).reshape(-1, size)
    return np.asarray(operation.reduce(folded))


def count_repetitions(
    data: Content, begin: int, fixed: Bytes, numbers: Sequence[tuple[int, int]]
) -> tuple[int, list[int]]:
    """Count the complete repetitions that directly follow the block at ``begin``.

    Parameters
    ----------
    data : Content
    begin : int
    fixed : array of shape (size,)
        255 for each byte that belongs to the structure, and 0 for each byte of data.
    numbers : sequence of (int, int)
        Offset and width of the decimal state numbers; each grows by its own constant step from block to block.

    Returns
    -------
    times : int
        Number of repetitions after the first block.
    steps : list of int
        Growth of each state number from one block to the next.

    Examples
    --------
    >>> from d2rpick.histories.content import Content
    >>> blocks = Content(b"[d01:x][d02:y][d03:z][d05:x]")
    >>> fixed = np.frombuffer(b"~~00~0~", dtype=np.uint8) // 126 * 255
    >>> count_repetitions(blocks, 0, fixed, [(2, 2)])
    (2, [1])
    """
    run = Stretch(begin, fixed.size, (len(data) - begin) // fixed.size, begin)
    if fixed.size > _LONGEST:
        return 0, []
    numbers_of_blocks: list[NDArray[np.int64]] = []
    count_like_example(
        data,
        run,
        0,
        fixed,
        take=lambda rows: numbers_of_blocks.append(
            _decode_state_numbers(rows, numbers)
        ),
    )
    states = np.concatenate(numbers_of_blocks)
    steps = np.diff(states[:2], axis=0)
    if not steps.size or steps.min() < 1:
        return 0, []
    even = (states == states[0] + steps * np.arange(len(states))[:, np.newaxis]).all(
        axis=1
    )
    return (len(even) if even.all() else int(even.argmin())) - 1, steps[0].tolist()


def _decode_state_numbers(
    blocks: Bytes, fields: Sequence[tuple[int, int]]
) -> NDArray[np.int64]:
    """Return the decimal integers in each block, shape (blocks, fields); -1 for a field with other characters."""
    numbers = np.empty((len(blocks), len(fields)), dtype=np.int64)
    for column, (offset, width) in enumerate(fields):
        digits = blocks[:, offset : offset + width].astype(np.int64) - ord("0")
        number = digits @ 10 ** np.arange(width - 1, -1, -1, dtype=np.int64)
        numbers[:, column] = np.where(
            ((digits < 0) | (digits > 9)).any(axis=1), -1, number
        )
    return numbers


@cache
def _make_scales(decimals: int) -> tuple[Samples, Samples]:
    """Return the factor and the divisor of an integer mantissa for each exponent and sign; one of them is always 1.

    Both are NaN if the conversion would be inexact.
    """
    exponent = np.arange(_SHRINKS) * [[1], [-1]] - decimals
    powers = np.array([float(f"1e{size}") for size in range(_EXACT + 1)] + [np.nan])[
        np.minimum(abs(exponent), _EXACT + 1)
    ]
    factors = np.where(exponent > 0, powers, 1.0)
    return np.stack([factors, -factors]).ravel(), np.tile(
        np.where(exponent < 0, powers, 1.0).ravel(), 2
    )


def parse_fortran_number(text: bytes) -> float:
    """Return the value of a right-aligned Fortran field; NaN if it is not a finite number.

    Examples
    --------
    >>> [parse_fortran_number(text) for text in (b"   4.87301E-03", b"   1.23457-100", b"   1.00000D+00", b"     1447")]
    [0.00487301, 1.23457e-100, 1.0, 1447.0]
    >>> [parse_fortran_number(text) for text in (b"**************", b"      NaN", b"  1.0E+00 ", b"   1.0E+999")]
    [nan, nan, nan, nan]
    """
    match = _NUMBER.fullmatch(text)
    if match is None:
        return np.nan
    mantissa, signed, unsigned = match.groups()
    value = float(mantissa + b"E" + (signed or unsigned or b"0"))
    return value if np.isfinite(value) else np.nan


def parse_fortran_numbers(fields: NDArray[np.bytes_], decimals: int) -> Samples:
    """Return the values of fixed-width fields as ``float()`` would; NaN for a field that is not a number.

    Right-justified fields of the usual form ``-d.dddddE+dd`` are converted together: the mantissa and the power of ten
    are both exact doubles, so their product or quotient is correctly rounded. `parse_fortran_number` converts all other
    fields.

    Parameters
    ----------
    fields : array of bytes of one width, shape (n,)
        Fields as written in the file.
    decimals : int
        Number of decimals in the usual form.

    Returns
    -------
    array of shape (n,)

    Examples
    --------
    >>> parse_fortran_numbers(np.array([b"   4.87301E-03", b"  -8.05000E+02", b"   2.00000E-20"]), decimals=5).tolist()
    [0.00487301, -805.0, 2e-20]
    """
    if not fields.size:
        return np.empty(0)
    width = fields.dtype.itemsize
    column = np.ascontiguousarray(
        np.ascontiguousarray(fields).view(np.uint8).reshape(-1, width).T
    )
    point = width - 5 - decimals
    mark = width - 4
    negative = column[point - 2] == ord("-")
    shrinks = column[mark + 1] == ord("-")
    # uint8 wraps around below "0", so a single comparison finds all characters that are not digits.
    digits = column[
        [point - 1, *range(point + 1, mark), mark + 2, mark + 3]
    ] - np.uint8(ord("0"))
    usual = digits.max(axis=0) <= 9
    usual &= (column[point] == ord(".")) & (column[mark] == ord("E"))
    usual &= negative | (column[point - 2] == ord(" "))
    usual &= shrinks | (column[mark + 1] == ord("+"))
    usual &= np.all(column[: point - 2] == ord(" "), axis=0)

    weights = np.array([float(10**exponent) for exponent in range(decimals, -1, -1)])
    # The mantissas are still exact integers at this point.
    values: Samples = weights @ digits[:-2].astype(np.float64)
    tens, units = digits[-2:]
    scale = (
        tens * np.uint8(10)
        + units
        + shrinks * np.uint16(_SHRINKS)
        + negative * np.uint16(_NEGATIVE)
    )
    factors, divisors = (table.take(scale) for table in _make_scales(decimals))
    values *= factors
    values /= divisors

    far = usual & np.isnan(values)
    values[far] = [float(text) for text in fields[far].tolist()]
    for row in np.flatnonzero(~usual):
        values[row] = parse_fortran_number(fields[row : row + 1].tobytes())
    return values
