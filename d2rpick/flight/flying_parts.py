"""Parts by what they do: ``flying`` for all deformable parts that fly together, ``all`` for those with energy."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.errors import FormatError
from d2rpick.flight.flight import all_seen
from d2rpick.histories.history import Given

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.flight.window import FreeFlight
    from d2rpick.histories.history import History, Part
    from d2rpick.histories.run import Run
    from d2rpick.histories.selection import Selection

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
    """Give the deformable parts that fly together in the longest flight; FormatError where momenta do not tell.

    All of them are tried first.  Where these do not fly, as with a driven sled among them, each is asked which others
    fly with it, that with the most energy first.
    """
    deformable = deformable_parts(run)
    for chosen in (deformable, *((part,) for part in _by_energy(run, deformable))):
        found = [one for one in _flights(run, chosen) if one.parts]
        if found:
            longest = max(found, key=lambda one: one.end - one.start)
            members = {part.id for part in longest.parts or ()}
            return tuple(part for part in deformable if part.id in members)
    raise FormatError(f"{run.name}: no momenta show which parts fly together; name the parts to be switched")


def _by_energy(run: Run, parts: tuple[Part, ...]) -> Iterator[Part]:
    highest = run.part_energies(parts).max(axis=0)
    yield from (parts[i] for i in np.argsort(-highest).tolist())


def _flights(run: Run, chosen: tuple[Part, ...]) -> list[FreeFlight]:
    """Flights by the momenta of parts alone."""
    from d2rpick.histories.selection import Selection

    history: History = run.history(Selection(parts=tuple(str(part.id) for part in chosen)))
    own = tuple(one for one in history.momenta if one.parts is not None)
    return [flight for _, flight in all_seen(replace(history, evidence=Given(own)))]


def asks_for_recommended(parts: Sequence[str], run: Run) -> bool:
    """Whether the parts hold the word "recommended", and no part of the run has it for its title."""
    titles = {part.title.strip().casefold() for part in run.parts}
    return RECOMMENDED in {text.strip().casefold() for text in parts} - titles
