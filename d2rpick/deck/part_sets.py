"""Write part sets, to which a card refers if it has too many parts to list."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

from d2rpick.deck.columns import write_list
from d2rpick.deck.ls_dyna_columns import SET, SET_PART_LIST

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

# Part set ids, keyed by the sorted tuple of part ids.
PartSets = Mapping[tuple[int, ...], int]
NO_SETS: Final[PartSets] = {}
# Largest number of parts that a card lists; for more parts, the card refers to a part set.
_MOST_LISTED: Final = 10


def number_sets(
    groups: Iterable[Sequence[int]], first: int
) -> dict[tuple[int, ...], int]:
    """Return part set ids for all groups of parts that are too large to list, by the sorted tuple of part ids."""
    long_groups = dict.fromkeys(
        tuple(sorted(group)) for group in groups if len(group) > _MOST_LISTED
    )
    return {group: first + index for index, group in enumerate(long_groups)}


def name_parts(parts: Sequence[int], part_sets: PartSets) -> list[tuple[int, str]]:
    """Return the ids and kinds (PTYPE) by which a card refers to parts: their part set, if any, or each part."""
    number = part_sets.get(tuple(sorted(parts)))
    return [(part, "PART") for part in parts] if number is None else [(number, "PSET")]


def write_part_set(parts: Sequence[int], number: int) -> Iterator[str]:
    """Yield the lines of a part set."""
    yield f"$ Part set {number}: give it another id if the deck has one with this id."
    yield from ("*SET_PART_LIST", SET.write_names(), SET.write(SID=number))
    yield SET_PART_LIST.write_names()
    yield from write_list(SET_PART_LIST, parts)
