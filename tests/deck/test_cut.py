"""What tells that a deck seems to be cut."""

from __future__ import annotations

import pytest

from d2rpick.deck.radioss_mesh import KINDS, NOT_COUNTED
from d2rpick.deck.reader import holds_mesh
from d2rpick.deck.source import Block, SourceFile


@pytest.mark.parametrize("keyword", [*KINDS, *sorted(NOT_COUNTED), "NODE"])
def test_all_elements_of_radioss_are_mesh(keyword: str) -> None:
    """Their names stand twice: a check does without the inventory, which takes time to load."""
    assert holds_mesh(Block(SourceFile("run_0000.rad", b""), 0, None, f"/{keyword}/1"))
