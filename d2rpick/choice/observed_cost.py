"""What the legs of runs took, with the elements that were computed in them: observations for a calibration."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.choice.calibrate import Observation
from d2rpick.choice.cost import POINT
from d2rpick.choice.warnings import Caution
from d2rpick.deck import find_windows, ls_dyna, radioss, read_deck, read_parts, read_switching
from d2rpick.deck.folder import main_decks
from d2rpick.deck.radioss_run import find_run_windows, read_run, run_files
from d2rpick.errors import DeckError, FormatError
from d2rpick.histories.listings import is_glstat, read_timing, read_zone_times

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from d2rpick.deck import Deck
    from d2rpick.deck.model import Inventory
    from d2rpick.histories.listings import Timing, ZoneTimes

_US: Final = 1e6


class _Rigid(NamedTuple):
    """A part that is rigid from ``tr`` to ``td`` [time]."""

    part: int
    tr: float
    td: float


def observations_of_runs(folders: Sequence[str]) -> tuple[tuple[Observation, ...], tuple[Caution, ...]]:
    """Read what the legs of several runs took; a file of the same content, in a folder named twice or a copy, once.

    Raises
    ------
    DeckError, FormatError
        As `observations_of`.
    """
    found: dict[str, tuple[Observation, ...]] = {}
    cautions = []
    for folder in folders:
        by_file: dict[str, list[Observation]] = {}
        for one in observations_of(folder):
            by_file.setdefault(one.name, []).append(one)
        for name, legs in by_file.items():
            with Path(name).open("rb") as stream:
                content = hashlib.file_digest(stream, "sha256").hexdigest()
            if content in found:
                same = found[content][0].name
                what = "is given twice" if Path(same).samefile(name) else f"has the content of {same}"
                cautions.append(Caution("same-leg-twice", f"{name} {what}; it counts once"))
            else:
                found[content] = tuple(legs)
    return tuple(one for legs in found.values() for one in legs), tuple(dict.fromkeys(cautions))


def observations_of(folder: str) -> tuple[Observation, ...]:
    """Read what the legs of the run in a folder took.

    Parameters
    ----------
    folder : str
        Holds the deck of one run, and its Radioss listings, d3hsp or glstat.

    Raises
    ------
    DeckError
        If there is not one main deck.
    FormatError
        If no file says what the run took.
    """
    decks = main_decks(folder)
    if len(decks) != 1:
        count = f"{len(decks)} main decks were found" if decks else "no main deck was found"
        raise DeckError(f"{folder}: {count}, the folder of one run was expected")
    found = tuple(_of_radioss(decks[0]) if run_files(decks[0]) else _of_ls_dyna(decks[0]))
    if not found:
        wanted = "listings NAME_0001.out of Radioss, d3hsp or glstat were expected"
        raise FormatError(f"{folder}: nothing says what the run took; {wanted}")
    return found


def _of_radioss(deck: str) -> Iterator[Observation]:
    run = read_run(deck)
    inventory = radioss.read(run)
    windows = find_run_windows(run).windows.windows
    rigid = [_Rigid(one.unit.id, one.tr, one.td or np.inf) for one in windows if not one.unit.is_body]
    start = 0.0
    for leg in run.legs:
        listing = Path(deck).parent / f"{leg.name}_{leg.number:04d}.out"
        middle, start = (start + leg.stop.value) / 2, leg.stop.value
        if listing.is_file():
            parts = {one.part for one in rigid if one.tr <= middle < one.td}
            yield _of_timing(read_timing(str(listing)), inventory, dict.fromkeys(parts, 1.0))


def _of_ls_dyna(deck: str) -> Iterator[Observation]:
    read = read_deck(deck)
    inventory = ls_dyna.read(read)
    windows = find_windows(read_switching(read), read_parts(read)).windows
    rigid = [_Rigid(one.part, one.tr, one.td or np.inf) for one in windows if one.part is not None]
    for name in sorted(one.name for one in Path(deck).parent.iterdir() if one.is_file()):
        path = str(Path(deck).parent / name)
        if name == "d3hsp":
            end = _end(read)
            lasting = {one.part: (min(one.td, end) - one.tr) / end for one in rigid} if end else {}
            if not rigid or end:
                yield _of_timing(read_timing(path), inventory, lasting)
        elif name.startswith("glstat") and is_glstat(path):
            yield from _of_zones(read_zone_times(path), inventory, rigid)


def _end(deck: Deck) -> float:
    """End of an LS-DYNA run; 0 where it is not known."""
    cards = deck.named("CONTROL_TERMINATION")
    rows = [row for row in cards[0].rows if not row.blank] if cards else []
    return float(cards[0].real(rows[0], 0).value) if rows else 0.0


def _of_timing(timing: Timing, inventory: Inventory, lasting: Mapping[int, float]) -> Observation:
    """Take a leg in which parts were rigid for a fraction of it."""
    counts, nodes = _computed(inventory, lasting)
    cycle = _US / timing.cycles
    return Observation(
        timing.name, counts, len(inventory.coordinates), nodes, timing.total * cycle, timing.elements * cycle
    )


def _of_zones(zones: ZoneTimes, inventory: Inventory, rigid: Sequence[_Rigid]) -> Iterator[Observation]:
    """Take the median over states in which the same parts are rigid."""
    number = sum(counts.total() for counts in inventory.counts.values())
    states: dict[frozenset[int], list[float]] = {}
    for time, per_zone in zip(zones.time.tolist(), zones.per_zone.tolist(), strict=True):
        now = frozenset(one.part for one in rigid if one.tr < time <= one.td)
        states.setdefault(now, []).append(per_zone)
    for now, times in states.items():
        counts, nodes = _computed(inventory, dict.fromkeys(now, 1.0))
        total = float(np.median(times)) * number * _US
        yield Observation(zones.name, counts, len(inventory.coordinates), nodes, total, None)


def _computed(inventory: Inventory, lasting: Mapping[int, float]) -> tuple[dict[str, float], float]:
    """Deformable elements by class, with their further points, and nodes of rigid bodies, on the average of a leg."""
    always = {part for part, data in inventory.parts.items() if data.material and data.material.kind == "rigid"}
    computed: dict[str, float] = {}
    _count(computed, inventory, {part: one for part, one in inventory.counts.items() if part not in always}, 1.0)
    nodes = 0.0
    for fraction in sorted(set(lasting.values())):
        parts = [part for part, value in lasting.items() if value == fraction]
        nodes += fraction * inventory.rigid_nodes(parts)
        within = inventory.elements_within(parts)
        _count(computed, inventory, {part: one for part, one in within.items() if part not in always}, -fraction)
    return computed, nodes


def _count(into: dict[str, float], inventory: Inventory, counts: Mapping[int, Mapping[str, int]], times: float) -> None:
    """Add elements of known cost by their class, so many times."""
    for part, kinds in counts.items():
        for kind, count in kinds.items():
            cost = inventory.formulation(part, kind).cost
            further = inventory.further_points(part, kind)
            if cost is not None:
                into[cost] = into.get(cost, 0.0) + times * count
            if cost is not None and further:
                into[POINT] = into.get(POINT, 0.0) + times * count * further
