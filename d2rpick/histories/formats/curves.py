"""Read text files that list curves one after another, each with its own times, as exported by postprocessors.

A Curveplot file of LS-PrePost has a header (word, title, x label, y label); each curve consists of ``name
#pts=number``, lines with a star, pairs of numbers, and ``endcurve``. A file with XY pairs of LS-PrePost has a line with
the number of pairs, followed by the pairs. A ``.cur`` file of T/HIS has title, x label, y label, name and pairs, with
``CONTINUE`` between curves and comments that begin with a dollar sign; the Oasys programs write a type and a factor
after a label. A DYNAFORM file begins with the number of curves; each curve consists of ``number 'name'`` and pairs.
"""

from __future__ import annotations

import re
from itertools import chain, islice, takewhile
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.errors import EnergyChoiceError, FormatError, list_names
from d2rpick.histories.database import Database
from d2rpick.histories.formats.cells import parse_cell
from d2rpick.histories.formats.layout import number_duplicates
from d2rpick.histories.formats.text import find_precisions, is_whole_field
from d2rpick.histories.meaning import (
    find_internal_energies,
    is_time,
    may_be_energy,
    refuse_other_quantity,
)
from d2rpick.histories.names import Selection, find_unit, resolve_name
from d2rpick.histories.samples import check_one_run

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.histories.formats.text import Text
    from d2rpick.histories.history import Precision, Samples

_POINTS: Final = "#pts="
_DYNAFORM: Final = r"\s*\d+\s+'([^']*)'\s*"
# Number of characters at the start of a line within which a label is expected.
_LONGEST_LABEL: Final = 1000
# Pattern of the type and factor that Oasys programs write after a label: "Time <TIME/0.001>;".
_TYPE: Final = r"\s*<([^<>/]*)(?:/([^<>]*))?>\s*;?\s*$"
_UNITS_OF_TIME: Final = {1.0: "s", 1e-3: "ms", 1e-6: "us"}
# Smallest number of labels above a curve: x label, y label and curve name. The title may be blank.
_FEWEST_LABELS: Final = 3
# Largest number of digits in a pair count; a longer number is a sign of damage.
_MOST_DIGITS: Final = 12


class _TextCurve:
    """A curve: its name, its pairs as text cells, and the line numbers of these pairs."""

    def __init__(self, name: str) -> None:
        from array import array  # Imported here to keep start-up fast.

        self.name = name
        self.times: list[str] = []
        self.values: list[str] = []
        self.lines = array("q")


def find_curves(text: Text, selection: Selection) -> Curves | None:
    """Read a text that lists curves; None for any other text. The first selected curve determines the times."""
    curves = _CurveText(text)
    for read in (_read_curveplot, _read_t_his, _read_dynaform, _read_xy_pairs):
        if read(curves):
            return Curves(curves, selection)
    return None


class _CurveText:
    """State of the reader: the curves that have been read, and the label of their x axis."""

    def __init__(self, text: Text) -> None:
        self.source, self._text = text.name, text
        self.unended = bool(text.unended.strip())
        self.curves: list[_TextCurve] = []
        self.x_label = self.time_unit = ""
        self.stops = ""
        self.last = 0  # Number of the line that was read last.

    def top(self, count: int) -> list[str]:
        """Return the first lines of the text that are neither blank nor comments."""
        unended = [self._text.unended] if self._text.is_short else []
        return list(
            islice(filter(_has_content, chain(self._text.head, unended)), count)
        )

    def lines(self) -> Iterator[tuple[int, str]]:
        """Yield the number and text of all lines that are neither blank nor comments."""
        for number, line in enumerate(self._text.lines(0), 1):
            self.last = number
            if _has_content(line):
                yield number, line
        if _has_content(self._text.unended):
            self.last += 1
            yield self.last, self._text.unended

    def add(self, number: int, line: str) -> None:
        """Add the pair of numbers in a line to the last curve."""
        cells = line.replace(",", " ").split()
        if len(cells) != 2 or not self.curves:
            raise FormatError(
                f"{self.source}:{number}: {line.strip()[:60]!r}, but a pair of numbers was expected"
            )
        curve = self.curves[-1]
        curve.times.append(cells[0])
        curve.values.append(cells[1])
        curve.lines.append(number)

    def count(self, number: int, digits: str) -> int:
        """Return the number of pairs or curves announced in a line."""
        if len(digits) > _MOST_DIGITS:
            raise FormatError(
                f"{self.source}:{number}: a count of {len(digits)} digits; the file is damaged"
            )
        return int(digits)

    def close(self, number: int, expected: int) -> None:
        """End the last curve; raise FormatError unless it has the announced number of pairs."""
        count = len(self.curves[-1].times)
        if count != expected:
            problem = f"{self.source}:{number}: {count} pairs, but {expected} were expected in {self.stops}"
            raise FormatError(f"{problem}; export it again")
        self.stops = ""


class Curves(Database):
    """The curves in one text, as a `Database` without parts whose times are those of the first requested curve."""

    format = "csv"
    named_by_people = True

    def __init__(self, text: _CurveText, selection: Selection) -> None:
        self.source = text.source
        self.time_unit = find_unit(text.x_label) or text.time_unit
        self._curves = dict(
            zip(
                number_duplicates([curve.name for curve in text.curves], "curve"),
                text.curves,
                strict=True,
            )
        )
        self.channels = tuple(self._curves)
        notes = [f"the file ends within {text.stops}"] if text.stops else []
        if text.x_label and not is_time(text.x_label):
            notes.append(
                f"the x axis is called {text.x_label!r}; it was used as the time"
            )
        last = text.curves[-1]
        breaks_off = text.unended and bool(last.times) and last.lines[-1] == text.last
        cut = breaks_off and not is_whole_field(last.values[-1], last.values[:-1])
        if cut:
            for cells in (last.times, last.values, last.lines):
                cells.pop()
            notes.append(
                "the last line has no line end and may be cut; it was left out"
            )
        self.complete = not text.stops and not cut
        self.notes = tuple(notes)
        if selection.time is not None and not is_time(selection.time):
            raise FormatError(
                f"{self.source}: each curve has its own times; leave `time` {selection.time!r} out"
            )
        self._asked = selection.energy

    @property
    def energy_channel(self) -> str:
        """The only curve, or the only curve whose name denotes an internal energy; otherwise a FormatError is raised.

        The error lists all curves.
        """
        if len(self.channels) == 1:
            fitting = [0]
        else:
            fitting = find_internal_energies(self.channels)
        if len(fitting) != 1:
            count = f"{len(fitting)} curves are" if fitting else "no curve is"
            problem = f"{self.source}: {count} named like an internal energy"
            message = f"{problem}; choose with `energy`: {self._menu()}"
            choices = fitting or [
                number
                for number, name in enumerate(self.channels)
                if may_be_energy(name)
            ]
            if not choices:
                raise FormatError(
                    f"{self.source}: none of the curves is an energy by its name: {self._menu()}; write the internal "
                    "energy too, or give one of them as `energy` if it is one after all"
                )
            numbers = tuple(str(number + 1) for number in choices)
            raise EnergyChoiceError(message, numbers)
        if len(self.channels) == 1:
            refuse_other_quantity(self.channels[0], self.source)
        return self.channels[fitting[0]]

    def find(self, wanted: str) -> str:
        """Return the name of a curve given by its name or 1-based number; otherwise a FormatError lists the curves."""
        if (
            wanted.isdecimal()
            and wanted not in self.channels
            and 0 < int(wanted) <= len(self.channels)
        ):
            return self.channels[int(wanted) - 1]
        return resolve_name(wanted, self.channels, self.source)

    @cached_property
    def time(self) -> Samples:
        """Times of the first requested curve, shape (n,) [time]."""
        name = self.find(self._asked[0]) if self._asked else self.energy_channel
        lines = self._curves[name].lines
        return check_one_run(
            self._numbers(name, "times"),
            lambda state: f"{self.source}:{lines[state]}, {name!r}",
        )

    def channel(self, name: str) -> Samples:
        """Return the values of one curve, shape (n,); raise FormatError if its times differ from those of the run."""
        if name not in self._curves:
            raise FormatError(f"{self.source}: no curve {name!r}, only {self._menu()}")
        if not np.array_equal(self._numbers(name, "times"), self.time):
            raise FormatError(
                f"{self.source}: the times of {name!r} differ from those of the first requested curve"
            )
        return self._numbers(name, "values")

    def precisions(self, names: Sequence[str]) -> tuple[Precision, Precision]:
        """Return the precision with which the times and these curves were printed."""
        curves = [self._curves[name] for name in names or self.channels[:1]]
        times = [cell for curve in curves for cell in curve.times]
        values = [cell for curve in curves for cell in curve.values]
        return find_precisions(times, values, self.time)

    def _numbers(self, name: str, axis: str) -> Samples:
        """Return the times or values of a curve, shape (n,); raise FormatError for a cell that is not a number."""
        curve = self._curves[name]
        cells = curve.times if axis == "times" else curve.values
        # parse_cell returns None for a string that is not a number, and numpy converts None to NaN.
        numbers = np.array([parse_cell(cell, ".") for cell in cells], dtype=np.float64)
        bad = np.flatnonzero(~np.isfinite(numbers))
        if bad.size:
            line = curve.lines[bad[0]]
            cell = cells[bad[0]][:60]
            problem = (
                f"{self.source}:{line}: {cell!r} of {name!r}, but a number was expected"
            )
            raise FormatError(f"{problem}; repair or delete the line")
        return numbers

    def _menu(self) -> str:
        """Return the numbers and names of the curves from which the user can choose."""
        return list_names(
            [f"{number} {name!r}" for number, name in enumerate(self.channels, 1)]
        )


def _read_curveplot(text: _CurveText) -> bool:
    """Read a Curveplot file of LS-PrePost; return False for any other text."""
    word, *labels = [line.strip() for line in text.top(4)] or [""]
    if word != "Curveplot":
        return False
    text.x_label, y_label = (*labels, "", "", "")[1:3]
    points = 0
    for number, line in text.lines():
        name, mark, digits = (piece.strip() for piece in line.rpartition(_POINTS))
        if mark and digits.isdecimal():
            points = text.count(number, digits)
            text.curves.append(
                _TextCurve(name if name == y_label else f"{name}: {y_label}")
            )
            text.stops = f"the curve {name!r}"
        elif line.strip() == "endcurve" and text.stops:
            text.close(number, points)
        elif text.stops and not line.startswith("*"):
            text.add(number, line)
    if not text.curves:
        raise FormatError(
            f"{text.source}: a Curveplot without a line '#pts=', no curve was found; export it again"
        )
    return True


def _read_t_his(text: _CurveText) -> bool:
    """Read a .cur file of T/HIS; return False for any other text."""
    top = [_remove_type(line) for line in text.top(5)]
    # The title may be blank, so the x label is either the first or the second label.
    labels = list(takewhile(lambda line: not _is_pair(line), top))
    x_label = next((i for i in (0, 1) if i < len(labels) and is_time(labels[i])), None)
    if x_label is None or not _FEWEST_LABELS <= len(labels) < len(top):
        return False
    text.x_label = labels[x_label]
    text.time_unit = _find_unit_of_type(text.top(5)[x_label])
    labels = []
    in_head = True
    for number, line in text.lines():
        if line.strip().upper() == "CONTINUE":
            in_head, labels = True, []
        elif in_head and not _is_pair(line):
            labels.append(_remove_type(line))
        else:
            if in_head:
                text.curves.append(
                    _TextCurve(
                        ": ".join(reversed(labels[-2:]))
                        or f"curve {len(text.curves) + 1}"
                    )
                )
                in_head = False
            text.add(number, line)
    return True


def _remove_type(line: str) -> str:
    """Remove the type and the factor, such as ``<TIME/0.001>``, from a label.

    Examples
    --------
    >>> _remove_type(" Time <TIME/0.001>;")
    'Time'
    >>> _find_unit_of_type("Time <TIME/1.0E-3>;"), _find_unit_of_type("Time <TIME>;")
    ('ms', '')
    """
    return re.sub(_TYPE, "", line.strip()[:_LONGEST_LABEL]).strip()


def _find_unit_of_type(line: str) -> str:
    """Return the time unit that corresponds to the factor in a label; empty if the label contains no factor."""
    match = re.search(_TYPE, line.strip()[:_LONGEST_LABEL])
    factor = parse_cell(match[2].strip(), ".") if match and match[2] else None
    return "" if factor is None else _UNITS_OF_TIME.get(factor, "")


def _read_dynaform(text: _CurveText) -> bool:
    """Read a text of curves from DYNAFORM; return False for any other text."""
    top = text.top(2)
    if (
        len(top) < 2
        or not top[0].strip().isdecimal()
        or not re.fullmatch(_DYNAFORM, top[1])
    ):
        return False
    head = re.compile(_DYNAFORM)
    lines = text.lines()
    number, first = next(lines)
    expected = text.count(number, first.strip())
    for number, line in lines:
        if start := head.fullmatch(line):
            text.curves.append(_TextCurve(start[1].strip()))
        else:
            text.add(number, line)
    if len(text.curves) < expected:
        text.stops = f"curve {len(text.curves)} of {expected}"
    return True


def _read_xy_pairs(text: _CurveText) -> bool:
    """Read a file of XY pairs written by LS-PrePost; return False for any other text."""
    top = text.top(2)
    if len(top) < 2 or not top[0].strip().isdecimal() or not _is_pair(top[1]):
        return False
    points = 0
    for number, line in text.lines():
        if line.strip().isdecimal():
            if text.stops:
                text.close(number, points)
            points = text.count(number, line.strip())
            text.curves.append(_TextCurve(f"curve {len(text.curves) + 1}"))
            text.stops = f"the {text.curves[-1].name}"
        else:
            text.add(number, line)
    if len(text.curves[-1].times) >= points:
        text.close(text.last, points)
    return True


def _has_content(line: str) -> bool:
    """Return True if a line is neither blank nor a comment."""
    return bool(line.strip()) and line[0] != "$"


def _is_pair(line: str) -> bool:
    """Return True if a line is a pair of numbers."""
    cells = line.replace(",", " ").split()
    return len(cells) == 2 and all(parse_cell(cell, ".") is not None for cell in cells)
