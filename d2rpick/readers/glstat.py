"""LS-DYNA glstat: states of lines ``label....... value``, each begun by its time line.

A label fills columns 2-32, padded with dots; its value stands in columns 33-46 (E14.5, six digits).  What
else a state holds depends on the run: everything but the time and the labels asked for is passed over.  A
last state whose lines are not all there is left out.
"""

from __future__ import annotations

import math
import re
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np

from d2rpick.errors import FormatError
from d2rpick.history import History, Precision
from d2rpick.readers.names import listing, near_miss, quantity_note
from d2rpick.readers.source import Selection, Source, states_that_count

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.history import Samples

_LABEL = 31
_FIELD = 14
_TIME = b"time"
_PRECISION = Precision(digits=6)

_TIME_LINE = re.compile(rb"\n time[. ]{27}")
_VALUE_LINE = re.compile(rb"\n (?=\S)([^\n=]{30}\.)[^\n]{14}")
_NO_E = re.compile(rb"\s*([+-]?[\d.]+)([+-]\d{3})")  # Ew.d drops the E of a three-digit exponent


def recognises(head: bytes) -> bool:
    """Whether there is a time line, or the head of an LS-DYNA text database with no state at all."""
    if _TIME_LINE.search(head):
        return True
    _, _, rest = head.partition(b"\n")
    version, _, states = rest.partition(b"\n")
    return b" ls-dyna " in version and (not states.strip() or b"\n dt of cycle " in states)


def read(source: Source, selection: Selection) -> History:
    """Read the labels asked for, by default ``internal energy``, over time."""
    if selection.time is not None and selection.time.casefold() != "time":
        raise FormatError(f"{source.name}: no time {selection.time!r} in glstat, its time is 'time'; leave --time out")
    wanted = _labels(source, selection.energy or ("internal energy",))
    rows, notes, complete = _states(source, wanted)
    keep, order_notes = states_that_count(source.name, rows[:, 0])
    channel = " + ".join(label.decode("latin-1") for label in wanted)
    return History(
        time=rows[keep, 0],
        energy=rows[keep, 1:].sum(axis=1),
        source=(source.name,),
        format="glstat",
        channel=channel,
        time_precision=_PRECISION,
        energy_precision=_PRECISION,
        complete=complete,
        notes=(*notes, *order_notes, *quantity_note(channel)),
    )


def _labels(source: Source, asked: Sequence[str]) -> list[bytes]:
    """Find the labels as the first state spells them."""
    first = _TIME_LINE.search(source.data)
    if not first:
        raise FormatError(
            f"{source.name}: no states, not one time line was found; did the run get to its first output?"
        )
    following = _TIME_LINE.search(source.data, first.end())
    block = source.data[first.start() : following.start() if following else len(source.data)]
    present = [label.rstrip(b". ").decode("latin-1") for label in _VALUE_LINE.findall(block)]
    known = {label.casefold(): label for label in present if label != "time"}
    choice = list(known.values())
    labels = []
    for name in asked:
        label = known.get(name.strip().casefold())
        if label is None:
            raise FormatError(
                f"{source.name}: the first state has no whole line {name!r}{near_miss(name, choice)}; "
                f"there are: {listing(choice, most=40)}"
            )
        labels.append(label.encode("latin-1"))
    if len(set(labels)) < len(labels):
        raise FormatError(f"{source.name}: an energy is asked for twice; name each once")
    return labels


def _states(source: Source, wanted: Sequence[bytes]) -> tuple[Samples, list[str], bool]:
    """Rows of time and wanted values, what to say of lines left out, and whether the file is whole."""
    data = source.data
    fields = (re.escape(label) + rb"[. ]{%d}" % (_LABEL - len(label)) for label in (_TIME, *wanted))
    pattern = re.compile(rb"\n (" + b"|".join(fields) + rb")([^\n]*)")
    found = pattern.findall(data)
    labels = [field.rstrip(b". ") for field, _ in found]
    first = labels.index(_TIME)
    notes = ["the file begins inside a state, which was left out"] if first else []
    # The last line found may be cut, and a cut number is often a number: it counts when another line follows.
    end_of_line = data.find(b"\n", data.rindex(b"\n " + found[-1][0]) + 1)
    last = len(found) if 0 <= end_of_line < len(data) - 1 else len(found) - 1

    order = _order(labels[first:last], wanted)
    states, rest = divmod(last - first, len(order))
    expected = (order * (states + 1))[: last - first]
    if labels[first:last] != expected:
        wrong = next(i for i, label in enumerate(expected) if labels[first + i] != label)
        here, there = labels[first + wrong].decode("latin-1"), expected[wrong].decode("latin-1")
        raise FormatError(
            f"{source.name}:{_line_number(data, pattern, first + wrong)}: {here!r} where {there!r} "
            "was expected, as a state has its time and every label once; repair it or take another label"
        )
    values = np.array([_value(line) for _, line in found[first : last - rest]])
    bad = np.flatnonzero(np.isnan(values))
    if bad.size:
        label, line = found[first + bad[0]]
        raise FormatError(
            f"{source.name}:{_line_number(data, pattern, first + bad[0])}: "
            f"{label.rstrip(b'. ').decode('latin-1')!r} is {line.strip().decode('latin-1')!r}, "
            "a number in columns 33-46 was expected; repair the line or cut the file before it"
        )
    if rest or last < len(found):
        notes.append("the last state is cut short and was left out")
    elif not data.endswith(b"\n"):
        notes.append("the file stops inside its last state, behind the lines that were needed")
    complete = not rest and last == len(found) and data.endswith(b"\n")
    columns = [order.index(label) for label in (_TIME, *wanted)]
    return values.reshape(states, len(order))[:, columns], notes, complete


def _order(labels: Sequence[bytes], wanted: Sequence[bytes]) -> list[bytes]:
    """Order in which the first state has its lines."""
    order = list(labels[: len(wanted) + 1])
    return order if set(order) == {_TIME, *wanted} else [_TIME, *wanted]


def _value(line: bytes) -> float:
    """Return the number in columns 33-46 from what stands behind the label; NaN when there is none for sure.

    Examples
    --------
    >>> [_value(line) for line in (b"   2.04235E+03", b"   1.00000D+00 wall# 1", b" -4.94066-300", b"   3.")]
    [2042.35, 1.0, nan, nan]
    """
    field = line[:_FIELD]
    if len(field) < _FIELD or b"_" in field or line[_FIELD : _FIELD + 1].strip():
        return math.nan  # cut, no number in Fortran though in Python, or wider than its column
    try:
        value = float(field)
    except ValueError:
        bare = _NO_E.fullmatch(field)
        text = bare[1] + b"E" + bare[2] if bare else field.replace(b"D", b"E")
        try:
            value = float(text)
        except ValueError:
            return math.nan
    return value if math.isfinite(value) else math.nan


def _line_number(data: bytes, pattern: re.Pattern[bytes], index: int) -> int:
    match = next(islice(pattern.finditer(data), index, None))
    return data.count(b"\n", 0, match.start() + 1) + 1
