"""Parts by what they do: ``flying`` for all deformable parts that fly together, ``all`` for those with energy."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.errors import FormatError
from d2rpick.flight.momentum import all_flights

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from d2rpick.flight.window import FreeFlight
    from d2rpick.histories.history import Momenta
    from d2rpick.histories.names import Part, Selection
    from d2rpick.histories.run import Run

FLYING: Final = "flying"
ALL: Final = "all"
RECOMMENDED: Final = "recommended"


def with_parts_by_number(run: Run, selection: Selection) -> Selection:
    """Replace the words ``flying`` and ``all`` among the parts that are asked for by the numbers they stand for.

    A part with such a title is meant by it.

    Raises
    ------
    FormatError
        If the run has no parts with energies, or does not tell which of them fly together.

    Examples
    --------
    >>> from d2rpick.histories.opening import Selection, open_run
    >>> run = open_run(["sample_data/rolloverT01.gz"], Selection())
    >>> with_parts_by_number(run, Selection(parts=("flying",))).parts
    ('1', '2')
    """
    titles = {part.title.strip().casefold() for part in run.parts}
    meanings = {FLYING: flying_parts, ALL: deformable_parts}
    named: list[str] = []
    for text in selection.parts:
        word = text.strip().casefold()
        meant = meanings.get(word) if word not in titles else None
        named += [str(part.id) for part in meant(run)] if meant else [text]
    return selection._replace(parts=tuple(dict.fromkeys(named)))


def deformable_parts(run: Run) -> tuple[Part, ...]:
    """Give the parts that ever have internal energy; FormatError where there are none."""
    parts = run.parts
    energies = run.part_energies(parts)  # says why there are none
    found = tuple(part for part, energy in zip(parts, energies.T, strict=True) if energy.any())
    if not found:
        raise FormatError(f"{run.name}: no part ever has internal energy; name the parts to be switched")
    return found


def flying_parts(run: Run) -> tuple[Part, ...]:
    """Give the deformable parts that fly as one body; FormatError where momenta do not tell.

    Of all sets that fly, the one with the largest product of mass and time counts: a loose tyre may fly for longer than
    the car, which is what is to be switched.  Tried are the parts that hang together by the deck; without one, or where
    none of these flies by itself, what `flying_together` tries.
    """
    deformable, momenta = _with_momenta(run)
    found = list(_of_bodies(momenta, run.surroundings.bodies())) if momenta else []
    return _heaviest(run, deformable, momenta, found) if found else flying_together(run)


def flying_together(run: Run) -> tuple[Part, ...]:
    """Give the deformable parts that momenta show to fly together, in one body or in several; FormatError without.

    All parts are tried, and each that is in no set yet, with what hangs on it.
    """
    deformable, momenta = _with_momenta(run)
    found: list[FreeFlight] = []
    if momenta:
        for part, place in zip(deformable, momenta.chosen, strict=True):
            if not any(part in (flight.parts or ()) for flight in found):
                found += all_flights(momenta.choosing((place,)))
        found += all_flights(momenta)
    return _heaviest(run, deformable, momenta, found)


def _with_momenta(run: Run) -> tuple[tuple[Part, ...], Momenta | None]:
    deformable = deformable_parts(run)
    return deformable, next((one for one in run.momenta(deformable, None) if one.parts), None)


def _of_bodies(momenta: Momenta, bodies: Iterable[Iterable[int]]) -> Iterator[FreeFlight]:
    """Find the flights of parts that hang together, by their numbers."""
    places = {part.id: place for place, part in enumerate(momenta.parts or ())}
    for body in bodies:
        members = tuple(places[part] for part in body if part in places)
        if members:
            yield from all_flights(momenta.choosing(members, members))


def _heaviest(
    run: Run, deformable: Sequence[Part], momenta: Momenta | None, found: Sequence[FreeFlight]
) -> tuple[Part, ...]:
    """Give the deformable parts of the flight with the largest product of mass and time."""
    if not found or momenta is None:
        raise FormatError(f"{run.name}: no momenta show which parts fly together; name the parts to be switched")
    masses = np.ones(len(run.parts)) if momenta.masses is None else np.nan_to_num(momenta.masses)
    mass = dict(zip(run.parts, masses.tolist(), strict=True))
    best = max(found, key=lambda one: (one.end - one.start) * sum(mass[part] for part in one.parts or ()))
    return tuple(part for part in deformable if part in (best.parts or ()))


def asks_for_recommended(parts: Sequence[str], run: Run) -> bool:
    """Whether the parts hold the word "recommended", and no part of the run has it for its title."""
    titles = {part.title.strip().casefold() for part in run.parts}
    return RECOMMENDED in {text.strip().casefold() for text in parts} - titles
