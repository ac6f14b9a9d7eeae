"""Refuse a history with a value that no structure can have, such as a damaged number in a single state.

Each check looks at one state that leaves both states beside it. A contact that is shorter than the output interval also
does so, but it takes its internal energy from the motion: the sum of kinetic and internal energy rises by nothing.
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
    """Raise HistoryError if one kinetic energy exceeds the total energy of all other states, or is far below zero."""
    total = balance.kinetic_and_internal
    if balance.kinetic is None or total is None or total.size < _FEWEST:
        return
    kinetic = CheckedQuantity("kinetic energy", balance.time, balance.kinetic)
    _check_sign(kinetic, files)
    _check_supply(kinetic, total, files)


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
    column: CheckedQuantity, state: int, expected: str, files: Sequence[Source]
) -> HistoryError:
    """Return an error with the place and the value of a quantity, and the value that was expected."""
    value, time = float(column.values[state]), float(column.time[state])
    place, unit = _locate(value, time, files)
    if not place:
        place = f"{', '.join(file.name for file in files)}, state {state + 1}"
    return HistoryError(
        f"{place}: {column.name} is {value:.6g} in the single state at {time:.6g}, but {expected} was expected; "
        f"repair or delete the {unit}"
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
