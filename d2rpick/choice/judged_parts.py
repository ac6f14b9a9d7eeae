"""The parts by which a switched run is judged: those that were rigid, without those whose energy is reported wrongly.

Some solvers report a sum of densities for solids while these are rigid, and some go on with it.  When a part is
deformable again its energy is what it was at tr, since a frozen deformation does not change: one that is further off
than the part's largest energy without switching is reported wrongly, and the part is left out.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.base.errors import FormatError, if_written, listing
from d2rpick.flight.internal_energy import round_off
from d2rpick.histories.names import Part, Selection
from d2rpick.histories.samples import window

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from d2rpick.histories.history import History, Samples
    from d2rpick.histories.run import Run


# Of a part that is deformable fewer states follow each other without kinetic energy, or with one internal energy.
FEWEST: Final = 12
# An internal energy that changes by less is one value: solvers write single precision.
SAME: Final = 1e-6


def with_energy(run: Run, parts: Sequence[Part], history: History) -> tuple[Part, ...]:
    """Give those of the parts that ever have internal energy at the times of a history."""
    if not parts:
        return ()
    energies = run.part_energies(parts)
    if len(energies) != history.time.size:
        return ()
    return tuple(part for part, energy in zip(parts, energies.T, strict=True) if energy.any())


def rigid_parts(run: Run, parts: Sequence[Part], time: Samples, tr: float, td: float) -> NDArray[np.bool_] | None:
    """Tell which of the parts were rigid from tr to td, shape (parts,); None where their states do not tell.

    ``time`` are the times of the parts' states (n,).
    """
    inside = window(time, np.nextafter(tr, td), np.nextafter(td, tr))
    inside = slice(inside.start + 1, max(inside.start + 1, inside.stop - 1))  # switched at the first step after tr
    if not parts or len(time[inside]) < FEWEST:
        return None
    energies, kinetic = run.part_energies(parts)[inside], if_written(lambda: run.part_kinetic_energies(parts))
    still = np.ptp(energies, axis=0) <= SAME * np.abs(energies).max(axis=0)
    absent = (kinetic[inside] == 0).all(axis=0) if kinetic is not None else np.zeros(len(parts), dtype=bool)
    return np.asarray(still | absent)


class Judged(NamedTuple):
    """Energies of the same parts in both runs, and what to say of other parts.

    ``known`` is False where the energies of all parts are reported wrongly.
    """

    reference: History
    switched: History
    objections: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    known: bool = True


def judged_parts(runs: tuple[Run, Run], histories: tuple[History, History], pair: tuple[float, float]) -> Judged:
    """Choose the parts by which a finished switched run is judged.

    Parameters
    ----------
    runs : (Run, Run)
        Without switching, and switched.
    histories : (History, History)
        What was read of them: of the parts to be switched, or of the whole model.
    pair : (float, float)
        tr and td [time].

    Returns
    -------
    Judged
        Of a model of which only some parts were rigid these; in any case without parts that are reported wrongly.
    """
    as_read = Judged(*histories)
    try:
        parts = _with_energy(runs, histories[0])
        return _judged(runs, histories, pair, parts) if parts else as_read
    except FormatError:  # a quantity of the parts is not in every state
        return as_read


def _with_energy(runs: tuple[Run, Run], history: History) -> tuple[Part, ...]:
    """Give the parts with energy that are asked for, or all, which both runs have."""
    there = {part.id for part in runs[1].parts}
    known = tuple(part for part in history.parts or runs[0].parts if part.id in there)
    return with_energy(runs[0], known, history)


def _judged(
    runs: tuple[Run, Run], histories: tuple[History, History], pair: tuple[float, float], parts: tuple[Part, ...]
) -> Judged:
    rigid = rigid_parts(runs[1], parts, runs[1].part_time, *pair)
    some = rigid is not None and bool(rigid.any()) and not rigid.all()
    asked, objections, notes = histories[0].parts, [], []
    chosen = parts
    if some and rigid is not None:
        still = tuple(part for part, one in zip(parts, rigid.tolist(), strict=True) if one)
        if asked is None:
            chosen = still
            notes.append(f"judged by the parts that were rigid: {_names(still)}")
        else:
            others = (part for part in parts if part not in still)
            objections.append(f"not rigid from tr {pair[0]:g} to td {pair[1]:g} in the switched run: {_names(others)}")
    wrong = _parts_reported_wrong(runs, chosen, pair, round_off(histories[0]))
    if not wrong and chosen is parts:
        return Judged(*histories, tuple(objections))
    left = tuple(part for part in chosen if part not in wrong)
    if not left:
        who = f"the energies of {_names(wrong)}"
        objections.append(f"{who} are reported wrongly after td: nothing is left to compare but the motion")
    elif wrong:
        found = f"left out of the comparison: {_names(wrong)}, whose energy is reported wrongly after td"
        notes.append(f"{found}; some solvers do so with solids that were rigid")
    selection = Selection(
        parts=tuple(str(part.id) for part in left or chosen),
        springs=tuple(str(part.id) for part in histories[0].springs),
    )
    reference, switched = (run.history(selection) for run in runs)
    return Judged(reference, switched, tuple(objections), tuple(notes), known=bool(left))


def _parts_reported_wrong(
    runs: tuple[Run, Run], parts: tuple[Part, ...], pair: tuple[float, float], least: float
) -> tuple[Part, ...]:
    """Give the parts whose energy after td is further off that at tr than it can be, and than ``least`` [energy]."""
    time, energies = runs[1].part_time, runs[1].part_energies(parts)
    first = int(np.searchsorted(time, pair[1])) + 1  # the first state from td on may still be rigid
    last = int(np.searchsorted(time, pair[0], side="right")) - 1
    if last < 0 or first >= time.size:
        return ()
    largest = np.abs(runs[0].part_energies(parts)).max(axis=0)
    off = np.abs(energies[first] - energies[last]) > np.maximum(largest, least)
    return tuple(part for part, one in zip(parts, off.tolist(), strict=True) if one)


def _names(parts: Iterable[Part]) -> str:
    return listing([part.name for part in parts])
