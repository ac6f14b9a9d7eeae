"""Nodes of the groups of a Radioss starter deck, and where nodes lie."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from d2rpick.deck.inventory.radioss_mesh import KINDS, NOT_COUNTED, elements_of, nodes_of
from d2rpick.deck.radioss.blocks import blocks, card_of, keyword, whole

if TYPE_CHECKING:
    from collections.abc import Mapping

    from d2rpick.deck.inventory.columns import Integers, Reals
    from d2rpick.deck.radioss.starter import Starter


class NodeGroups:
    """Groups of nodes of a starter deck; its mesh is read when a group asks for it."""

    def __init__(self, starter: Starter) -> None:
        self._starter = starter
        self._found: dict[int, frozenset[int] | None] = {0: frozenset()}

    def members(self, group: int) -> frozenset[int] | None:
        """Ids of the nodes of a group; None where they are not known."""
        if group not in self._found:
            self._found[group] = self._members(group)
        return self._found[group]

    def _members(self, group: int) -> frozenset[int] | None:
        known = self._starter.group_members(group)
        if known is None or any(part not in self._by_part for part in known[1]):
            return None
        return frozenset(known[0]).union(*(self._by_part[part].tolist() for part in known[1]))

    @cached_property
    def _by_part(self) -> Mapping[int, Integers]:
        """Nodes by part; a part with particles, which are not followed, is left out."""
        found: dict[int, list[Integers]] = {part: [] for part in self._starter.parts}
        unknown = set()
        for source in self._starter.sources:
            for block in blocks(source):
                words = keyword(block)
                if words[1:] and words[0] in KINDS:
                    part = found.setdefault(whole(words[1]), [])
                    part += [np.unique(nodes) for _, _, nodes in elements_of(card_of(block), words)]
                elif words[1:] and words[0] in NOT_COUNTED:
                    unknown.add(whole(words[1]))
        empty = np.empty(0, np.int64)
        joined = {part: np.unique(np.concatenate([empty, *nodes])) for part, nodes in found.items()}
        return {part: nodes[nodes > 0] for part, nodes in joined.items() if part not in unknown}

    @cached_property
    def placed(self) -> tuple[Integers, Reals]:
        """Ids of all nodes (n,) and where they lie (n, 3) [length]."""
        every = [block for source in self._starter.sources for block in blocks(source)]
        return nodes_of([card_of(block) for block in every if keyword(block)[:1] == ("NODE",)])
