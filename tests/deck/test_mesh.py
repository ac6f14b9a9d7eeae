"""The table of nodes: every id has one place, however large it is."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from d2rpick.deck.mesh import NO_NODE, NodeTable

IDS = st.lists(st.integers(1, 30), max_size=12)


@pytest.mark.parametrize(
    "far", [0, 10**8]
)  # from this id on, a table of all ids would be too large
@given(IDS, IDS, IDS)
def test_places_are_those_of_the_ids(
    far: int, placed: list[int], used: list[int], asked: list[int]
) -> None:
    of_elements = np.array([*(node_id + far for node_id in used), 0], np.int64)
    table = NodeTable(np.array(placed, np.int64) + far, [of_elements])
    assert table.ids.tolist() == [
        *(node_id + far for node_id in placed),
        *(node_id + far for node_id in sorted({*used} - {*placed})),
    ]
    first = {id_: index for index, id_ in reversed([*enumerate(table.ids.tolist())])}
    assert table.places(of_elements).tolist() == [
        first.get(node_id, NO_NODE) for node_id in of_elements.tolist()
    ]
    wanted = np.array([node_id + far for node_id in asked] + [far + 99, -3], np.int64)
    assert table.known(wanted).tolist() == [
        first[node_id] for node_id in wanted.tolist() if node_id in first
    ]
