"""Part sets of a card: parts that are too many to be listed stand in *SET_PART_LIST, and the card names the set."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

PartSets = Mapping[tuple[int, ...], int]  # number of the set by its parts, ascending
NO_SETS: Final[PartSets] = {}
_MOST_LISTED: Final = 10  # parts one by one
_PER_LINE: Final = 8


def number_sets(
    groups: Iterable[Sequence[int]], first: int
) -> dict[tuple[int, ...], int]:
    """Number a set for each of the groups of parts that are too many to be listed."""
    many = dict.fromkeys(
        tuple(sorted(group)) for group in groups if len(group) > _MOST_LISTED
    )
    return {group: first + place for place, group in enumerate(many)}


def name_parts(parts: Sequence[int], part_sets: PartSets) -> list[tuple[int, str]]:
    """Name parts with their kind (PTYPE): by their set where there is one."""
    number = part_sets.get(tuple(sorted(parts)))
    return [(part, "PART") for part in parts] if number is None else [(number, "PSET")]


def write_part_set(parts: Sequence[int], number: int) -> Iterator[str]:
    """Write the set of some parts."""
    yield f"$ Part set {number}: give it another id where the deck has one of that."
    yield from ("*SET_PART_LIST", "$#     sid", f"{number:10d}")
    yield "$#    pid1      pid2      pid3      pid4      pid5      pid6      pid7      pid8"
    lines = (parts[at : at + _PER_LINE] for at in range(0, len(parts), _PER_LINE))
    yield from ("".join(f"{part:10d}" for part in line) for line in lines)
