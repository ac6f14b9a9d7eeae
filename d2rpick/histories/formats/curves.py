"""Curves one after the other in one text, each with times of its own: what pre- and postprocessors export.

LS-PrePost's Curveplot: a head of word, title, x label, y label; for each curve ``name #pts=number``, lines with a star,
pairs of numbers and ``endcurve``.  LS-PrePost's XY pairs: a line with the number of pairs, then these.  T/HIS ``.cur``:
title, x label, y label, name and pairs, ``CONTINUE`` between curves, comments with a dollar; the Oasys programs write
type and factor behind a label.  DYNAFORM: the number of curves; for each ``number 'name'`` and pairs.
"""

from __future__ import annotations

import re
from itertools import chain, islice, takewhile
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.errors import FormatError, listing
from d2rpick.histories.database import Database
from d2rpick.histories.formats.cells import as_number
from d2rpick.histories.formats.layout import unique
from d2rpick.histories.formats.text import is_whole, precisions
from d2rpick.histories.meaning import (
    find_internal_energies,
    is_time,
    refuse_other_quantity,
)
from d2rpick.histories.names import Selection, resolve, unit_of
from d2rpick.histories.samples import of_one_run

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.histories.formats.text import Text
    from d2rpick.histories.history import Precision, Samples

_POINTS: Final = "#pts="
_DYNAFORM: Final = r"\s*\d+\s+'([^']*)'\s*"  # compiled where it is needed
_LONGEST_LABEL: Final = (
    1000  # what is longer is no label, and would be searched for long
)
# Type and factor that the Oasys programs write behind a label: "Time <TIME/0.001>;".  Compiled where it is needed.
_TYPE: Final = r"\s*<([^<>/]*)(?:/([^<>]*))?>\s*;?\s*$"
_UNITS_OF_TIME: Final = {1.0: "s", 1e-3: "ms", 1e-6: "us"}
_FEWEST_LABELS: Final = 3  # of x, y and the curve; the title may be blank
_MOST_DIGITS: Final = 12  # no file has more pairs than such a number says


class _Curve:
    """Name of a curve, its pairs as cells, and the numbers of their lines."""

    def __init__(self, name: str) -> None:
        from array import array  # not above: plain tables do without it

        self.name = name
        self.times: list[str] = []
        self.values: list[str] = []
        self.lines = array("q")


def find_curves(text: Text, selection: Selection) -> Curves | None:
    """Read a text of curves, those whose times are asked for first by the selection; None for any other text."""
    found = _CurveText(text)
    read = next(
        (read for read in (_curveplot, _t_his, _dynaform, _counted) if read(found)),
        None,
    )
    return Curves(found, selection) if read else None


class _CurveText:
    """What was found in a text: curves, the label of their x axis, and what it ends within of."""

    def __init__(self, text: Text) -> None:
        self.source, self._text = text.name, text
        self.unended = bool(text.unended.strip())
        self.curves: list[_Curve] = []
        self.x_label = self.time_unit = ""
        self.stops = ""
        self.last = 0  # number of the last line

    def top(self, count: int) -> list[str]:
        """The first lines that are neither blank nor comments."""
        rest = [self._text.unended] if self._text.is_short else []
        return list(islice(filter(_counts, chain(self._text.head, rest)), count))

    def lines(self) -> Iterator[tuple[int, str]]:
        """All lines that are neither blank nor comments, numbered."""
        for number, line in enumerate(self._text.lines(0), 1):
            self.last = number
            if _counts(line):
                yield number, line
        if _counts(self._text.unended):
            self.last += 1
            yield self.last, self._text.unended

    def add(self, number: int, line: str) -> None:
        """Add a pair to the last curve."""
        cells = line.replace(",", " ").split()
        if len(cells) != 2 or not self.curves:
            raise FormatError(
                f"{self.source}:{number}: {line.strip()[:60]!r}, a pair of numbers was expected"
            )
        curve = self.curves[-1]
        curve.times.append(cells[0])
        curve.values.append(cells[1])
        curve.lines.append(number)

    def count(self, number: int, digits: str) -> int:
        """Read how many pairs or curves a line announces."""
        if len(digits) > _MOST_DIGITS:
            raise FormatError(
                f"{self.source}:{number}: a count of {len(digits)} digits; the file is damaged"
            )
        return int(digits)

    def close(self, number: int, expected: int) -> None:
        """End the last curve; FormatError unless it has the pairs that were announced."""
        found = len(self.curves[-1].times)
        if found != expected:
            what = f"{self.source}:{number}: {found} pairs, {expected} were expected in {self.stops}"
            raise FormatError(f"{what}; export it again")
        self.stops = ""


class Curves(Database):
    """Curves of one text; a `Database` without parts, whose times are those of the curves that are asked for."""

    format = "csv"
    named_by_people = True

    def __init__(self, found: _CurveText, selection: Selection) -> None:
        self.source = found.source
        self.time_unit = unit_of(found.x_label) or found.time_unit
        self._curves = dict(
            zip(
                unique([one.name for one in found.curves], "curve"),
                found.curves,
                strict=True,
            )
        )
        self.channels = tuple(self._curves)
        notes = [f"the file ends within {found.stops}"] if found.stops else []
        if found.x_label and not is_time(found.x_label):
            notes.append(
                f"the x axis is called {found.x_label!r}; it was taken for the time"
            )
        last = found.curves[-1]
        breaks_off = found.unended and bool(last.times) and last.lines[-1] == found.last
        cut = breaks_off and not is_whole(last.values[-1], last.values[:-1])
        if cut:
            for cells in (last.times, last.values, last.lines):
                cells.pop()
            notes.append(
                "the last line has no line end and may be cut; it was left out"
            )
        self.complete = not found.stops and not cut
        self.notes = tuple(notes)
        if selection.time is not None and not is_time(selection.time):
            raise FormatError(
                f"{self.source}: each curve has its own times; leave `time` {selection.time!r} out"
            )
        self._asked = selection.energy

    @property
    def energy_channel(self) -> str:
        """The only curve, or the only one named like an internal energy; else FormatError with all there are."""
        fitting = (
            range(1)
            if len(self.channels) == 1
            else find_internal_energies(self.channels)
        )
        if len(fitting) != 1:
            found = f"{len(fitting)} curves are" if fitting else "no curve is"
            what = f"{self.source}: {found} named like an internal energy"
            raise FormatError(f"{what}; choose with `energy`: {self._menu()}")
        if len(self.channels) == 1:
            refuse_other_quantity(self.channels[0], self.source)
        return self.channels[fitting[0]]

    def find(self, wanted: str) -> str:
        """Name of the curve that is meant by its name or 1-based number; FormatError with what there is."""
        if (
            wanted.isdecimal()
            and wanted not in self.channels
            and 0 < int(wanted) <= len(self.channels)
        ):
            return self.channels[int(wanted) - 1]
        return resolve(wanted, self.channels, self.source)

    @cached_property
    def time(self) -> Samples:
        """Times of the curve that is asked for first, shape (n,) [time]."""
        name = self.find(self._asked[0]) if self._asked else self.energy_channel
        lines = self._curves[name].lines
        return of_one_run(
            self._numbers(name, "times"),
            lambda state: f"{self.source}:{lines[state]}, {name!r}",
        )

    def channel(self, name: str) -> Samples:
        """Values of one curve, shape (n,); FormatError when its times are not those of the run."""
        if name not in self._curves:
            raise FormatError(f"{self.source}: no curve {name!r}, only {self._menu()}")
        if not np.array_equal(self._numbers(name, "times"), self.time):
            raise FormatError(
                f"{self.source}: {name!r} has other times than the first curve that is asked for"
            )
        return self._numbers(name, "values")

    def precisions(self, names: Sequence[str]) -> tuple[Precision, Precision]:
        """How finely the times and these curves were printed."""
        curves = [self._curves[name] for name in names or self.channels[:1]]
        times = [cell for curve in curves for cell in curve.times]
        values = [cell for curve in curves for cell in curve.values]
        return precisions(times, values, self.time)

    def _numbers(self, name: str, axis: str) -> Samples:
        curve = self._curves[name]
        cells = curve.times if axis == "times" else curve.values
        numbers = np.array(
            [as_number(cell, ".") for cell in cells], dtype=np.float64
        )  # None becomes nan
        bad = np.flatnonzero(~np.isfinite(numbers))
        if bad.size:
            found = f"{self.source}:{curve.lines[bad[0]]}: {cells[bad[0]][:60]!r} of {name!r}, a number was expected"
            raise FormatError(f"{found}; repair or delete the line")
        return numbers

    def _menu(self) -> str:
        return listing(
            [f"{number} {name!r}" for number, name in enumerate(self.channels, 1)]
        )


def _curveplot(found: _CurveText) -> bool:
    word, *labels = [line.strip() for line in found.top(4)] or [""]
    if word != "Curveplot":
        return False
    found.x_label, y_label = (*labels, "", "", "")[1:3]
    points = 0
    for number, line in found.lines():
        name, mark, digits = (piece.strip() for piece in line.rpartition(_POINTS))
        if mark and digits.isdecimal():
            points = found.count(number, digits)
            found.curves.append(
                _Curve(name if name == y_label else f"{name}: {y_label}")
            )
            found.stops = f"the curve {name!r}"
        elif line.strip() == "endcurve" and found.stops:
            found.close(number, points)
        elif found.stops and not line.startswith("*"):
            found.add(number, line)
    if not found.curves:
        raise FormatError(
            f"{found.source}: a Curveplot without a line '#pts=', no curve was found; export it again"
        )
    return True


def _t_his(found: _CurveText) -> bool:
    top = [_without_type(line) for line in found.top(5)]
    labels = list(
        takewhile(lambda line: not _is_pair(line), top)
    )  # the title may be blank
    x_label = next(
        (place for place in (0, 1) if place < len(labels) and is_time(labels[place])),
        None,
    )
    if x_label is None or not _FEWEST_LABELS <= len(labels) < len(top):
        return False
    found.x_label = labels[x_label]
    found.time_unit = _unit_of_type(found.top(5)[x_label])
    labels = []
    in_head = True
    for number, line in found.lines():
        if line.strip().upper() == "CONTINUE":
            in_head, labels = True, []
        elif in_head and not _is_pair(line):
            labels.append(_without_type(line))
        else:
            if in_head:
                found.curves.append(
                    _Curve(
                        ": ".join(reversed(labels[-2:]))
                        or f"curve {len(found.curves) + 1}"
                    )
                )
                in_head = False
            found.add(number, line)
    return True


def _without_type(line: str) -> str:
    """Return a label without its type and factor.

    Examples
    --------
    >>> _without_type(" Time <TIME/0.001>;"), _unit_of_type("Time <TIME/1.0E-3>;"), _unit_of_type("Time <TIME>;")
    ('Time', 'ms', '')
    """
    return re.sub(_TYPE, "", line.strip()[:_LONGEST_LABEL]).strip()


def _unit_of_type(line: str) -> str:
    """Return the unit of time that the factor of a label says, empty if there is none."""
    found = re.search(_TYPE, line.strip()[:_LONGEST_LABEL])
    factor = as_number(found[2].strip(), ".") if found and found[2] else None
    return "" if factor is None else _UNITS_OF_TIME.get(factor, "")


def _dynaform(found: _CurveText) -> bool:
    top = found.top(2)
    if (
        len(top) < 2
        or not top[0].strip().isdecimal()
        or not re.fullmatch(_DYNAFORM, top[1])
    ):
        return False
    head = re.compile(_DYNAFORM)
    lines = found.lines()
    number, first = next(lines)
    expected = found.count(number, first.strip())
    for number, line in lines:
        if start := head.fullmatch(line):
            found.curves.append(_Curve(start[1].strip()))
        else:
            found.add(number, line)
    if len(found.curves) < expected:
        found.stops = f"curve {len(found.curves)} of {expected}"
    return True


def _counted(found: _CurveText) -> bool:
    top = found.top(2)
    if len(top) < 2 or not top[0].strip().isdecimal() or not _is_pair(top[1]):
        return False
    points = 0
    for number, line in found.lines():
        if line.strip().isdecimal():
            if found.stops:
                found.close(number, points)
            points = found.count(number, line.strip())
            found.curves.append(_Curve(f"curve {len(found.curves) + 1}"))
            found.stops = f"the {found.curves[-1].name}"
        else:
            found.add(number, line)
    if len(found.curves[-1].times) >= points:
        found.close(found.last, points)
    return True


def _counts(line: str) -> bool:
    """Whether a line is neither blank nor a comment."""
    return bool(line.strip()) and line[0] != "$"


def _is_pair(line: str) -> bool:
    cells = line.replace(",", " ").split()
    return len(cells) == 2 and all(as_number(cell, ".") is not None for cell in cells)
