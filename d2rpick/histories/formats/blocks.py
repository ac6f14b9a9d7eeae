"""Blocks of solver databases: what one looks like, how many are like it, and the numbers they hold."""

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


UNSURE: Final = (
    -1
)  # in place of an offset: the field is cut, or stands in the block twice

_OVERLONG: Final = 512  # bytes of a line that no solver writes


class BlockLayout(NamedTuple):
    """Where in a block what stands.

    ``fields`` maps the name of a number to its offset in the block, or to UNSURE.  ``literal`` is 255 for the
    bytes that all blocks of this layout share, line ends among them, and 0 for the others; its shape is that
    of the block.  No line of a block can be hidden between literal bytes.
    ``last`` names the number the block ends with.  ``broken_off`` is True when the head of another run
    follows in place of the next block.
    """

    fields: Mapping[Any, int]
    literal: Bytes
    last: Hashable
    broken_off: bool


class Grammar(NamedTuple):
    """What the engine has to know about a database.

    ``start`` is the text a block's first line begins with; ``lines`` matches the lines that are known.  ``describe``
    takes a block apart, by these lines, and names its numbers and the last of them; it releases their columns, in an
    array of the shape of the block.  What ``changing`` matches in other lines may differ from block to block: it must
    match short pieces only, lest a whole line hide in one.  ``time`` is the first number.  ``whole`` tells whether a
    block that stands alone in its file is known to be whole.  The numbers have ``width`` columns and ``decimals``
    places.  ``compare_all`` compares every block in full when the file is opened; otherwise, where all blocks have one
    size, only their first lines, and the rest when it is read.
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
        """Find where in a block what stands."""
        literal, lines = (
            np.full(len(block), 255, np.uint8),
            [*self.lines.finditer(block)],
        )
        edges = [0, *(edge for line in lines for edge in line.span()), len(block)]
        for first, behind in zip(edges[::2], edges[1::2], strict=True):
            for piece in self.changing.finditer(block, first, behind):
                literal[piece.start() : piece.end()] = 0
        fields, last = self.describe(block, lines, literal)
        if (
            max(map(len, block.split(b"\n"))) >= _OVERLONG
        ):  # states were blanked, and hide in it
            fields = {
                name: place if name == self.time else UNSURE
                for name, place in fields.items()
            }
        return BlockLayout(fields, literal, last, broken_off=b"ls-dyna" in block)


def head(data: bytes | Content) -> tuple[str, str, int]:
    """Read the head of an LS-DYNA text database.

    Returns
    -------
    title, version : str
        Empty if there is no head.
    begin : int
        Address behind it.
    """
    lines = data[:4096].split(b"\n")
    if len(lines) < 3 or b"ls-dyna" not in lines[1]:
        return "", "", 0
    title, version = (line.decode("latin-1") for line in lines[:2])
    return title.strip(), " ".join(version.split()), len(title) + len(version) + 2


def written_head(title: str, database: str) -> str:
    """Two lines as solvers write them; no release of a solver wrote this, its name alone tells the layout."""
    return f" {title}\n{' ' * 25}d2rpick {__version__}, layout of ls-dyna {database}\n"


CHUNK: Final = (
    1 << 20
)  # bytes compared at a time: they stay in the cache between the two passes
_FOLD: Final = 16  # blocks side by side compared as one row: saves half the time


class Stretch(NamedTuple):
    """``repeats`` blocks of ``stride`` bytes from ``start`` on, laid out like the one at ``example``."""

    start: int
    stride: int
    repeats: int
    example: int


def like_example(
    data: Content, run: Stretch, offset: int, literal: Bytes, varied: Bytes | None = None,
    take: Callable[[Bytes], object] | None = None,
) -> int:  # fmt: skip
    """Count the blocks of ``run`` that have, from ``offset`` on, the literal bytes of its example.

    Parameters
    ----------
    data : Content
    run : Stretch
    offset : int
        Where in the blocks to begin.
    literal : array of shape (size,)
        255 for the bytes that must be those of the example, 0 for the others.
    varied : array of shape (size,), optional
        Gets the bits in which a byte of any counted block differs from the example.
    take : callable, optional
        Gets those bytes of the counted blocks, some blocks at a time, shape (count, size), while they are at hand.

    Examples
    --------
    >>> from d2rpick.histories.content import Content
    >>> literal, varied = np.array([255, 255, 0, 0], np.uint8), np.zeros(4, np.uint8)
    >>> like_example(Content(b"a=10a=12b=14"), Stretch(0, 4, 3, 0), 0, literal, varied), varied.tolist()
    (2, [0, 0, 0, 2])
    """
    size = literal.size
    example = data.view(run.example + offset, run.example + offset + size).copy()
    done, step = (0, 1) if size else (run.repeats, 1)
    most = max(1, CHUNK // max(1, size))
    most -= most % _FOLD if most > _FOLD else 0
    alike = True
    while alike and done < run.repeats:
        rows = _rows(
            data,
            run.start + done * run.stride + offset,
            run.stride,
            min(step, run.repeats - done),
            size,
        )
        differing = _differing(rows, example)
        alike = not (differing & literal).any()
        if not alike:
            rows = rows[: int(((rows ^ example) & literal).any(axis=1).argmax())]
            differing = (
                _differing(rows, example) if len(rows) else np.zeros_like(example)
            )
        if varied is not None:
            varied |= differing
        if take is not None:
            take(rows)
        done += len(rows)
        step = min(2 * step, most)
    return done


def _rows(data: Content, first: int, stride: int, count: int, size: int) -> Bytes:
    """``size`` bytes of each of ``count`` blocks, shape (count, size)."""
    if 2 * size < stride:
        return data.fields(first + stride * np.arange(count), size)
    span = data.view(first, first + (count - 1) * stride + size)
    return np.ndarray((count, size), np.uint8, span, strides=(stride, 1))


def _differing(rows: Bytes, example: Bytes) -> Bytes:
    """Bits in which any of the rows differs from the example, shape (size,)."""
    count, size = rows.shape
    if count % _FOLD == 0 and rows.flags.c_contiguous:
        rows = rows.reshape(count // _FOLD, _FOLD * size)
    # a bit is the example's in all rows where it is so in their AND and in their OR
    least, most = (
        of.reduce(of.reduce(rows, axis=0).reshape(-1, size))
        for of in (np.bitwise_and, np.bitwise_or)
    )
    return np.asarray((least ^ example) | (most ^ example))


_LONGEST: Final = 1 << 22  # a block with more bytes is left to the walk


def repeats(
    data: Content, begin: int, fixed: Bytes, numbers: Sequence[tuple[int, int]]
) -> tuple[int, list[int]]:
    """Count the whole repetitions that follow the block at ``begin`` without a gap.

    Parameters
    ----------
    data : Content
    begin : int
    fixed : array of shape (size,)
        255 for each byte of structure and 0 for each byte of data.
    numbers : sequence of (int, int)
        Place and width of the decimal state numbers; each goes up by a step of its own, the same from block to block.

    Returns
    -------
    times : int
        Number of repetitions behind the first block.
    steps : list of int
        How much each state number grows from one to the next.

    Examples
    --------
    >>> from d2rpick.histories.content import Content
    >>> blocks = Content(b"[d01:x][d02:y][d03:z][d05:x]")
    >>> fixed = np.frombuffer(b"~~00~0~", dtype=np.uint8) // 126 * 255
    >>> repeats(blocks, 0, fixed, [(2, 2)])
    (2, [1])
    """
    run = Stretch(begin, fixed.size, (len(data) - begin) // fixed.size, begin)
    if fixed.size > _LONGEST:
        return 0, []
    found: list[NDArray[np.int64]] = []
    like_example(
        data, run, 0, fixed, take=lambda rows: found.append(_decimals(rows, numbers))
    )
    states = np.concatenate(found)
    steps = np.diff(states[:2], axis=0)
    if not steps.size or steps.min() < 1:
        return 0, []
    even = (states == states[0] + steps * np.arange(len(states))[:, np.newaxis]).all(
        axis=1
    )
    return (len(even) if even.all() else int(even.argmin())) - 1, steps[0].tolist()


def _decimals(blocks: Bytes, places: Sequence[tuple[int, int]]) -> NDArray[np.int64]:
    """Decimal numbers of each block, shape (blocks, places); -1 where a byte is no digit."""
    numbers = np.empty((len(blocks), len(places)), dtype=np.int64)
    for column, (at, width) in enumerate(places):
        digits = blocks[:, at : at + width].astype(np.int64) - ord("0")
        number = digits @ 10 ** np.arange(width - 1, -1, -1, dtype=np.int64)
        numbers[:, column] = np.where(
            ((digits < 0) | (digits > 9)).any(axis=1), -1, number
        )
    return numbers


_NUMBER: Final = re.compile(
    rb" *([+-]?(?:\d+\.?\d*|\.\d+))(?:[EeDd]?([+-]\d+)|[EeDd](\d+))?"
)
_EXACT: Final = 22  # 10**22 is the largest power of ten that a double holds exactly
_SHRINKS, _NEGATIVE = (
    1 << 8,
    1 << 9,
)  # beside the two digits of an exponent, which fill a byte


@cache
def _scales(decimals: int) -> tuple[Samples, Samples]:
    """Factors and divisors of mantissas without point, one of both 1, by exponent and signs; NaN for none exact."""
    exponent = np.arange(_SHRINKS) * [[1], [-1]] - decimals
    powers = np.array([float(f"1e{size}") for size in range(_EXACT + 1)] + [np.nan])[
        np.minimum(abs(exponent), _EXACT + 1)
    ]
    factors = np.where(exponent > 0, powers, 1.0)
    return np.stack([factors, -factors]).ravel(), np.tile(
        np.where(exponent < 0, powers, 1.0).ravel(), 2
    )


def number(text: bytes) -> float:
    """Value of one right-justified Fortran field, NaN if it does not hold a finite number.

    Examples
    --------
    >>> [number(text) for text in (b"   4.87301E-03", b"   1.23457-100", b"   1.00000D+00", b"     1447")]
    [0.00487301, 1.23457e-100, 1.0, 1447.0]
    >>> [number(text) for text in (b"**************", b"      NaN", b"  1.0E+00 ", b"   1.0E+999")]
    [nan, nan, nan, nan]
    """
    match = _NUMBER.fullmatch(text)
    if match is None:
        return np.nan
    mantissa, signed, unsigned = match.groups()
    value = float(mantissa + b"E" + (signed or unsigned or b"0"))
    return value if np.isfinite(value) else np.nan


def decode(fields: NDArray[np.bytes_], decimals: int) -> Samples:
    """Values of fixed-width fields, each the very double that ``float()`` gives; NaN for what is no number.

    Fields of the usual shape, ``-d.dddddE+dd`` right-justified, are converted together: mantissa and power
    of ten are both exact doubles, so their one product or quotient is correctly rounded.  All others go
    through ``number``.

    Parameters
    ----------
    fields : array of bytes of one width, shape (n,)
        As written in the file.
    decimals : int
        Places behind the point in the usual shape.

    Returns
    -------
    array of shape (n,)

    Examples
    --------
    >>> decode(np.array([b"   4.87301E-03", b"  -8.05000E+02", b"   2.00000E-20"]), decimals=5).tolist()
    [0.00487301, -805.0, 2e-20]
    """
    if not fields.size:
        return np.empty(0)
    width = fields.dtype.itemsize
    column = np.ascontiguousarray(
        np.ascontiguousarray(fields).view(np.uint8).reshape(-1, width).T
    )
    point, mark = width - 5 - decimals, width - 4
    negative, shrinks = column[point - 2] == ord("-"), column[mark + 1] == ord("-")
    # wraps around for what is below "0", so one comparison is enough
    digits = column[
        [point - 1, *range(point + 1, mark), mark + 2, mark + 3]
    ] - np.uint8(ord("0"))
    usual = digits.max(axis=0) <= 9
    usual &= (column[point] == ord(".")) & (column[mark] == ord("E"))
    usual &= negative | (column[point - 2] == ord(" "))
    usual &= shrinks | (column[mark + 1] == ord("+"))
    usual &= np.all(column[: point - 2] == ord(" "), axis=0)

    weights = np.array([float(10**place) for place in range(decimals, -1, -1)])
    values: Samples = weights @ digits[:-2].astype(np.float64)  # exact
    tens, ones = digits[-2:]
    scale = (
        tens * np.uint8(10)
        + ones
        + shrinks * np.uint16(_SHRINKS)
        + negative * np.uint16(_NEGATIVE)
    )
    factors, divisors = (table.take(scale) for table in _scales(decimals))
    values *= factors
    values /= divisors

    far = usual & np.isnan(values)
    values[far] = [float(text) for text in fields[far].tolist()]
    for row in np.flatnonzero(~usual):
        values[row] = number(fields[row : row + 1].tobytes())
    return values
