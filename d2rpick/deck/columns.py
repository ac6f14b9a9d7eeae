"""Declare the columns of data lines once, with name, type and width, for both reading and writing.

The lines of LS-DYNA keywords are declared in `ls_dyna_columns`, those of Radioss blocks in `radioss_columns`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from d2rpick.base.tuples import NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

Kind = type[int] | type[float] | type[str]
Cell = int | float | str

WIDTH: Final = 10  # Width of a field [characters].


class CardColumn(NamedTuple):
    """A column of a data line: its name in the solver manual, the type of its values, and its width [characters].

    ``start`` is the index of its first character, from 0. ``position`` is the number of fields of 10 characters before
    it; in free format and in long format, the line has the same fields in the same order.
    """

    name: str
    kind: Kind
    width: int
    start: int

    @property
    def position(self) -> int:
        """Return the number of 10-character fields that precede this column."""
        return self.start // WIDTH

    def cut(self, line: str) -> str:
        """Return the text in this column of a line, including spaces."""
        return line[self.start : self.start + self.width]

    def format(self, value: Cell) -> str:
        """Return a value as text, right-aligned in this column."""
        return f"{value!s:>{self.width}}"

    def put(self, line: str, value: Cell) -> str:
        """Return the line with the value in this column replaced."""
        before = line[: self.start].ljust(self.start)
        return f"{before}{self.format(value)}{line[self.start + self.width :]}"


def integers(names: str, width: int = WIDTH) -> list[CardColumn]:
    """Declare columns of integers with these names."""
    return _declare(names, int, width)


def reals(names: str, width: int = WIDTH) -> list[CardColumn]:
    """Declare columns of real numbers with these names."""
    return _declare(names, float, width)


def words(names: str, width: int = WIDTH) -> list[CardColumn]:
    """Declare text columns with these names."""
    return _declare(names, str, width)


def blank(width: int) -> list[CardColumn]:
    """Declare a column that has no name and is left blank."""
    return [CardColumn("", str, width, 0)]


def _declare(names: str, kind: Kind, width: int) -> list[CardColumn]:
    return [CardColumn(name, kind, width, 0) for name in names.split()]


class DataLine:
    """The columns of a data line, from left to right.

    Examples
    --------
    >>> line = DataLine(integers("PID LRB"), words("PTYPE"))
    >>> line.write(PID=11, PTYPE="PART")
    '        11         0      PART'
    >>> line["PTYPE"].cut(line.write(PID=11, PTYPE="PSET"))
    '      PSET'
    """

    def __init__(self, *groups: Iterable[CardColumn]) -> None:
        self._columns: dict[str, CardColumn] = {}
        start = 0
        for column in (column for group in groups for column in group):
            name = column.name or f" {start}"
            self._columns[name] = CardColumn(
                column.name, column.kind, column.width, start
            )
            start += column.width

    def __getitem__(self, name: str) -> CardColumn:
        """Return the column with this name."""
        return self._columns[name]

    def __iter__(self) -> Iterator[CardColumn]:
        """Iterate over the columns, from left to right."""
        return iter(self._columns.values())

    @property
    def layout(self) -> list[tuple[int, int]]:
        """Return the index of the first character and the width of each column."""
        return [(column.start, column.width) for column in self]

    def write(self, **values: Cell) -> str:
        """Return a line with these values. A missing value becomes 0, spaces or ``0.0``, as its column requires."""
        assert values.keys() <= self._columns.keys()
        defaults: dict[Kind, Cell] = {int: 0, float: 0.0, str: ""}
        return "".join(
            column.format(values.get(column.name, defaults[column.kind]))
            for column in self
        )

    def write_names(self) -> str:
        """Return the LS-DYNA comment line that contains the column names in lower case.

        Examples
        --------
        >>> DataLine(integers("PID"), words("PTYPE")).write_names()
        '$#     pid     ptype'
        """
        names = "".join(column.format(column.name.lower()) for column in self)
        return f"$#{names[2:]}"


def cut_fields(line: str) -> list[str]:
    """Return the texts of all 10-character fields in a line of ids."""
    return [line[at : at + WIDTH].strip() for at in range(0, len(line), WIDTH)]


def write_list(line: DataLine, values: Iterable[Cell]) -> Iterator[str]:
    """Yield lines of values, in which all columns except some of the last line are filled."""
    columns = list(line)
    cells = list(values)
    for first in range(0, len(cells), len(columns)):
        on_line = zip(columns, cells[first:], strict=False)
        yield "".join(column.format(cell) for column, cell in on_line)
