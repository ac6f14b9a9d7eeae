"""Curves one after the other in one text, each with times of its own: what pre- and postprocessors export.

LS-PrePost's Curveplot: a head of word, title, x label, y label; for each curve ``name #pts=number``, lines with a star,
pairs of numbers and ``endcurve``.  T/HIS ``.cur``: title, x label, y label, name and pairs, ``CONTINUE`` between
curves, comments with a dollar.  DYNAFORM: the number of curves; for each ``number 'name'`` and pairs.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from d2rpick.errors import FormatError
from d2rpick.histories.formats import printed
from d2rpick.histories.formats.layout import as_number
from d2rpick.histories.names import internal_energies, is_time, listing, resolve, unit_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.histories.history import Part, Precision, Samples
    from d2rpick.histories.selection import Selection

_POINTS = re.compile(r"(.*?)\s*#pts=\s*(\d+)\s*")
_DYNAFORM = re.compile(r"\s*\d+\s+'([^']*)'\s*")


@dataclass
class _Curve:
    """Name of a curve and its pairs, as cells, with the numbers of their lines."""

    name: str
    cells: list[list[str]] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)


def find_curves(source: str, lines: Sequence[str], unended: str, selection: Selection) -> Curves | None:
    """Read a text of curves; None for any other.

    Parameters
    ----------
    source : str
        Name for messages.
    lines : sequence of str
        The lines that have an end.
    unended : str
        The last line when it has none, else empty.
    selection : Selection
        The curves that are asked for, whose times are the times of the run.
    """
    for read in (_curveplot, _t_his, _dynaform):
        text = _Text(source, [*lines, unended])
        if read(text):
            return Curves(text, bool(unended.strip()), selection)
    return None


class _Text:
    """Lines of a text and the curves that were found in it."""

    def __init__(self, source: str, lines: Sequence[str]) -> None:
        self.source = source
        self.lines = [(number, line) for number, line in enumerate(lines, 1) if line.strip() and line[0] != "$"]
        self.curves: list[_Curve] = []
        self.x_label = ""
        self.stops = ""  # what the file stops inside of, if it does

    def add(self, number: int, line: str) -> None:
        """Add a pair to the last curve."""
        cells = line.replace(",", " ").split()
        if len(cells) != 2 or not self.curves:
            raise FormatError(f"{self.source}:{number}: {line.strip()[:60]!r}, a pair of numbers was expected")
        self.curves[-1].cells.append(cells)
        self.curves[-1].lines.append(number)


class Curves:
    """Curves of one text; a `Database` without parts, whose times are those of the curves that are asked for."""

    format = "csv"
    version = ""
    parts: tuple[Part, ...] = ()

    def __init__(self, text: _Text, unended: bool, selection: Selection) -> None:
        self.source, self.title = text.source, ""
        self.time_unit = unit_of(text.x_label)
        self._curves = _uniquely_named(text.curves)
        self.channels = tuple(self._curves)
        notes = [f"the file stops inside {text.stops}"] if text.stops else []
        if text.x_label and not is_time(text.x_label):
            notes.append(f"the x axis is called {text.x_label!r}; it was taken for the time")
        last = text.curves[-1]
        if unended and last.cells and last.lines[-1] == text.lines[-1][0] and not _is_whole(last):
            last.cells.pop()
            notes.append("the last line has no line end and may be cut; it was left out")
        self.complete = not text.stops and not (notes and "may be cut" in notes[-1])
        self.notes = tuple(notes)
        if selection.time is not None and not is_time(selection.time):
            raise FormatError(f"{self.source}: each curve has its own times; leave --time {selection.time!r} out")
        self._asked = selection.energy

    @property
    def energy_channel(self) -> str:
        """The only curve, or the only one named like an internal energy; else FormatError with all there are."""
        fitting = range(1) if len(self.channels) == 1 else internal_energies(self.channels)
        if len(fitting) != 1:
            found = f"{len(fitting)} curves are" if fitting else "no curve is"
            raise FormatError(
                f"{self.source}: {found} named like an internal energy; choose with --energy: {self._menu()}"
            )
        return self.channels[fitting[0]]

    def find(self, wanted: str) -> str:
        """Name of the curve that is meant by its name or 1-based number; FormatError with what there is."""
        if wanted.isdecimal() and wanted not in self.channels and 0 < int(wanted) <= len(self.channels):
            return self.channels[int(wanted) - 1]
        return resolve(wanted, self.channels, self.source)

    @property
    def time(self) -> Samples:
        """Times of the curve that is asked for first, shape (n,) [time]."""
        return self._values(self.find(self._asked[0]) if self._asked else self.energy_channel, 0)

    @property
    def part_time(self) -> Samples:
        """Refused: curves are no parts."""
        raise self._no_parts()

    def channel(self, name: str) -> Samples:
        """Values of one curve, shape (n,); FormatError when its times are not those of the run."""
        if name not in self._curves:
            raise FormatError(f"{self.source}: no curve {name!r}, only {self._menu()}")
        if not np.array_equal(self._values(name, 0), self.time):
            raise FormatError(f"{self.source}: {name!r} has other times than the first curve that is asked for")
        return self._values(name, 1)

    def part_channel(self, quantity: str, ids: Sequence[int]) -> Samples:  # noqa: ARG002  as a Database
        """Refused: curves are no parts."""
        raise self._no_parts()

    def precisions(self, names: Sequence[str]) -> tuple[Precision, Precision]:
        """How finely the times and these curves were printed."""
        cells = [self._curves[name].cells for name in names or self.channels[:1]]
        return printed.precisions(
            [pair[0] for curve in cells for pair in curve], [pair[1] for curve in cells for pair in curve], self.time
        )

    def _values(self, name: str, axis: int) -> Samples:
        curve = self._curves[name]
        numbers = [as_number(pair[axis], ".") for pair in curve.cells]
        if None in numbers:
            bad = numbers.index(None)
            raise FormatError(
                f"{self.source}:{curve.lines[bad]}: {curve.cells[bad][axis]!r} of {name!r}, a number was expected; "
                "repair or delete the line"
            )
        return np.array(numbers, dtype=np.float64)

    def _menu(self) -> str:
        return listing([f"{number} {name!r}" for number, name in enumerate(self.channels, 1)])

    def _no_parts(self) -> FormatError:
        return FormatError(f"{self.source}: curves are no parts; choose them with --energy")


def _curveplot(text: _Text) -> bool:
    if not text.lines or text.lines[0][1].strip() != "Curveplot":
        return False
    labels = [line.strip() for _, line in text.lines[1:4]]
    text.x_label, y_label = (*labels, "", "", "")[1:3]
    points = 0
    for number, line in text.lines[1:]:
        if start := _POINTS.fullmatch(line):
            name, points = start[1].strip(), int(start[2])
            text.curves.append(_Curve(name if name == y_label else f"{name}: {y_label}"))
            text.stops = f"the curve {name!r}"
        elif line.strip() == "endcurve" and text.stops:
            if len(text.curves[-1].cells) != points:
                raise FormatError(
                    f"{text.source}:{number}: {len(text.curves[-1].cells)} pairs, {points} were expected "
                    f"in {text.stops} (#pts); export it again"
                )
            text.stops = ""
        elif text.stops and not line.startswith("*"):
            text.add(number, line)
    if not text.curves:
        raise FormatError(f"{text.source}: a Curveplot without a line '#pts=', no curve was found; export it again")
    return True


def _t_his(text: _Text) -> bool:
    head = [line.strip() for _, line in text.lines[:4]]
    if len(text.lines) < 5 or any(map(_is_pair, head)) or not is_time(head[1]) or not _is_pair(text.lines[4][1]):
        return False
    text.x_label = head[1]
    labels: list[str] = []
    in_head = True
    for number, line in text.lines:
        if line.strip() == "CONTINUE":
            in_head, labels = True, []
        elif in_head and not _is_pair(line):
            labels.append(line.strip())
        else:
            if in_head:
                text.curves.append(_Curve(": ".join(reversed(labels[-2:])) or f"curve {len(text.curves) + 1}"))
                in_head = False
            text.add(number, line)
    return True


def _dynaform(text: _Text) -> bool:
    first, *rest = text.lines or [(1, "")]
    if not first[1].strip().isdecimal() or not rest or not _DYNAFORM.fullmatch(rest[0][1]):
        return False
    for number, line in rest:
        if start := _DYNAFORM.fullmatch(line):
            text.curves.append(_Curve(start[1].strip()))
        else:
            text.add(number, line)
    if len(text.curves) < int(first[1]):
        text.stops = f"curve {len(text.curves)} of {first[1].strip()}"
    return True


def _is_pair(line: str) -> bool:
    cells = line.replace(",", " ").split()
    return len(cells) == 2 and all(as_number(cell, ".") is not None for cell in cells)


def _is_whole(curve: _Curve) -> bool:
    """Whether the last pair, behind which the file stops, is whole for sure."""
    return printed.is_whole(curve.cells[-1][1], [pair[1] for pair in curve.cells[:-1]])


def _uniquely_named(curves: Sequence[_Curve]) -> dict[str, _Curve]:
    names = [curve.name for curve in curves]
    return {
        name if names.count(name) == 1 else f"{name} (curve {number})": curve
        for number, (name, curve) in enumerate(zip(names, curves, strict=True), 1)
    }
