"""Refuse a history with a value that no structure can have, such as a damaged number in a single state.

Each check looks at one state, or two, that leave both states beside them. A contact that is shorter than the output
interval also does so, but it takes its internal energy from the motion: the sum of kinetic and internal energy rises by
nothing. It may store energy that no part contains, so that the kinetic energy, and with it the sum, falls.
"""

from __future__ import annotations

import re
from operator import itemgetter
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.errors import HistoryError
from d2rpick.base.tuples import NamedTuple

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.histories.history import Balance, Momenta, Samples
    from d2rpick.histories.source import Source

# Smallest number of states among which a single one can be called wrong.
_FEWEST: Final = 8
# Fraction of its jump by which the sum of the energies rises if no motion supplies the internal energy [-].
_UNSUPPLIED: Final = 0.5
# A single energy is wrong if it exceeds the range of all other energies by this factor [-].
# After a contact of one state, a structure keeps more than this fraction of the energy as vibration or plastic work.
_BEYOND_ALL: Final = 100.0
# Smallest negative energy that is wrong, relative to the largest energy and to any other negative energy [-].
_NEGATIVE, _MORE_NEGATIVE = 0.1, 10.0
# The sum of kinetic and internal energy is wrong if it leaves both states beside it by this multiple of the largest of
# its other changes between two states [-]. In 259 records of solvers, the multiple is at most 1.7.
_BEYOND_CHANGES: Final = 10.0
# Smallest such deviation that is reported, relative to the largest sum [-]; a smaller one hardly affects an answer.
_NOTABLE: Final = 1e-3
# The sum deviates because of one energy if the other one deviates by at most this fraction of it [-].
_STEADY: Final = 0.1
# A single momentum is wrong if it leaves those beside it by this multiple of the largest of all others [-].
_BEYOND_MOMENTA: Final = 10.0
# A text begins without zero bytes.
_HEAD: Final = 4096
# This pattern is compiled on first use to keep start-up fast.
_NUMBER: Final = rb"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][-+]?\d+)?"


class CheckedQuantity(NamedTuple):
    """A quantity over time, with its name for messages: ``time`` and ``values`` have the shape (n,)."""

    name: str
    time: Samples
    values: Samples


def has_lone_jump(energy: Samples) -> bool:
    """Return True if a single energy (n,) may be wrong, so that the other energies have to be read.

    Examples
    --------
    >>> has_lone_jump(np.array([0, 1, 5, 4, 3, 2, 1, 1, 0.0])), has_lone_jump(np.array([0, 1, 2, 99, 1, 2, 1, 1, 0.0]))
    (False, True)
    """
    if energy.size < _FEWEST:
        return False
    if energy.min() < 0:
        return True
    inner, jump = _find_largest_jump(energy)
    ends = (0, energy[0] - energy[1]), (energy.size - 1, energy[-1] - energy[-2])
    state, jump = max((inner, jump), *ends, key=itemgetter(1))
    return bool(jump > np.abs(np.delete(energy, state)).max())


def check_internal_energy(
    internal: CheckedQuantity, total: Samples | None, files: Sequence[Source]
) -> None:
    """Raise HistoryError if one internal energy exceeds the total energy of all other states, or is far below zero.

    ``total`` is the sum of kinetic and internal energy (n,) of the model at the same times; None if it is unknown.
    """
    energy = internal.values
    if energy.size < _FEWEST:
        return
    _check_sign(internal, files)
    if total is not None:
        _check_supply(internal, total, files)
        return
    state, jump = _find_largest_jump(energy)
    others = np.delete(energy, state)
    if jump > _BEYOND_ALL * np.ptp(others) > 0:
        expected = f"at most {others.max():.6g} (the largest value of the other states)"
        raise _make_error(internal, state, expected, files)


def check_balance(balance: Balance, files: Sequence[Source]) -> None:
    """Raise HistoryError if one or two energies do not fit the total energy, or a kinetic energy is far below zero."""
    total = balance.kinetic_and_internal
    if balance.kinetic is None or balance.internal is None or total is None:
        return
    if total.size < _FEWEST:
        return
    kinetic = CheckedQuantity("kinetic energy", balance.time, balance.kinetic)
    internal = CheckedQuantity("internal energy", balance.time, balance.internal)
    _check_sign(kinetic, files)
    _check_supply(kinetic, total, files)
    for count in (1, 2):
        _check_sum(internal, total, count, files, may_fall=False)
        _check_sum(kinetic, total, count, files, may_fall=True)


def check_momenta(momenta: Momenta, files: Sequence[Source]) -> None:
    """Raise HistoryError if a momentum of one state exceeds those of all other states by far."""
    values = momenta.values
    if len(values) < _FEWEST:
        return
    beside = np.stack([values[:-2], values[2:]])
    jumps = np.maximum(
        values[1:-1] - beside.max(axis=0), beside.min(axis=0) - values[1:-1]
    )
    where = np.unravel_index(int(jumps.argmax()), jumps.shape)
    state, member, axis = (int(index) for index in where)
    others = np.abs(np.delete(values, state + 1, axis=0)).max()
    if not jumps[where] > _BEYOND_MOMENTA * others > 0:
        return
    name = f"the {'xyz'[axis]} {'velocity' if momenta.velocity else 'momentum'}"
    if momenta.parts:
        name = f"{name} of part {momenta.parts[member].name}"
    column = CheckedQuantity(name, momenta.time, values[:, member, axis])
    expected = f"at most {others:.6g} (the largest value of the other states)"
    raise _make_error(column, state + 1, expected, files)


def _check_sign(column: CheckedQuantity, files: Sequence[Source]) -> None:
    """Raise HistoryError if one energy is far below zero, as no other is."""
    energy = column.values
    state = int(energy.argmin())
    others = np.delete(energy, state)
    depth = -float(energy[state])
    if depth > max(
        _NEGATIVE * np.abs(others).max(), -_MORE_NEGATIVE * others.min(), 0.0
    ):
        raise _make_error(column, state, "at least 0", files)


def _check_supply(
    column: CheckedQuantity, total: Samples, files: Sequence[Source]
) -> None:
    """Raise HistoryError if one energy exceeds the ``total`` (n,) of all other states, and no motion supplies it.

    At an end of the record, only one state lies beside it, so that a load may have begun or ended there.
    """
    energy = column.values
    inner, jump = _find_largest_jump(energy)
    rise = total[inner] - max(total[inner - 1], total[inner + 1])
    if rise <= _UNSUPPLIED * jump:
        jump = 0.0
    ends = (0, energy[0] - energy[1]), (energy.size - 1, energy[-1] - energy[-2])
    for state, excess in (
        (inner, jump),
        *((end, up / _BEYOND_ALL) for end, up in ends),
    ):
        largest = float(np.abs(np.delete(total, state)).max())
        if excess > largest > 0:
            expected = (
                f"at most {largest:.6g} (the largest total energy of the other states)"
            )
            raise _make_error(column, state, expected, files)


def _check_sum(
    column: CheckedQuantity,
    total: Samples,
    count: int,
    files: Sequence[Source],
    *,
    may_fall: bool,
) -> None:
    """Raise HistoryError if ``count`` neighbouring energies make the ``total`` (n,) leave the range beside them.

    ``may_fall`` is True if a contact may take this energy.
    """
    rise = _find_largest_excess(total, count)
    found = [rise] if may_fall else [rise, _find_largest_excess(-total, count)]
    first, deviation = max(found, key=itemgetter(1))
    states = slice(first, first + count)
    changes = np.abs(np.diff(total))
    changes[first - 1 : first + count] = 0.0
    largest = float(np.abs(np.delete(total, states)).max())
    is_wrong = deviation / _BEYOND_CHANGES > changes.max()
    if not (is_wrong and deviation > _NOTABLE * largest):
        return
    beside = [first - 1, first + count]
    other = total - column.values
    expected_other, expected_total = (
        np.interp(column.time[states], column.time[beside], values[beside])
        for values in (other, total)
    )
    if np.abs(other[states] - expected_other).max() > _STEADY * deviation:
        return
    energies = [f"{energy:.6g}" for energy in expected_total - other[states]]
    reason = "by the total energy of the neighbouring states"
    expected = f"about {' and '.join(energies)} ({reason})"
    raise _make_error(column, first, expected, files, count)


def _find_largest_excess(values: Samples, count: int) -> tuple[int, float]:
    """Return the first of ``count`` states that exceed the states beside them by the most, and by how much.

    Examples
    --------
    >>> _find_largest_excess(np.array([0.0, 1.0, 9.0, 8.0, 3.0, 4.0]), 2)
    (2, 5.0)
    """
    lowest = np.lib.stride_tricks.sliding_window_view(values, count).min(axis=1)[1:-1]
    excess = lowest - np.maximum(values[: -count - 1], values[count + 1 :])
    state = int(excess.argmax())
    return state + 1, float(excess[state])


def _find_largest_jump(values: Samples) -> tuple[int, float]:
    """Return the state that exceeds both states beside it by the most, and by how much.

    Examples
    --------
    >>> _find_largest_jump(np.array([0.0, 1.0, 9.0, 2.0, 3.0]))
    (2, 7.0)
    """
    jumps = values[1:-1] - np.maximum(values[:-2], values[2:])
    state = int(jumps.argmax())
    return state + 1, float(jumps[state])


def _make_error(
    column: CheckedQuantity,
    state: int,
    expected: str,
    files: Sequence[Source],
    count: int = 1,
) -> HistoryError:
    """Return an error with the place and the values of a quantity, and the values that were expected."""
    value, time = float(column.values[state]), float(column.time[state])
    place, unit = _locate(value, time, files)
    if not place:
        place = f"{', '.join(file.name for file in files)}, state {state + 1}"
    states, verb, these = f"in the single state at {time:.6g}", "was", f"the {unit}"
    if count > 1:
        last = float(column.time[state + count - 1])
        states = f"in the {count} states from {time:.6g} to {last:.6g}"
        verb, these = "were", f"these {unit}s"
    found = " and ".join(
        f"{number:.6g}" for number in column.values[state : state + count]
    )
    return HistoryError(
        f"{place}: {column.name} is {found} {states}, but {expected} {verb} expected; repair or delete {these}"
    )


def _locate(value: float, time: float, files: Sequence[Source]) -> tuple[str, str]:
    """Return the place of the only line of a text with a value, as FILE:LINE, and what it is; no place if unknown.

    If several lines contain the value, it is the one with the time.
    """
    for file in files:
        if b"\0" in file.data[:_HEAD]:
            continue
        lines = list[int]()
        for number, line in enumerate(bytes(file.data).split(b"\n"), start=1):
            values = [
                float(word.translate(bytes.maketrans(b"dD", b"ee")))
                for word in re.findall(_NUMBER, line)
            ]
            if value not in values:
                continue
            if time in values:
                return f"{file.name}:{number}", "line"
            lines.append(number)
        if len(lines) == 1:
            return f"{file.name}:{lines[0]}", "state"
    return "", "state"
