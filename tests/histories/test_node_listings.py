"""Nodes whose motion LS-DYNA lists in its ASCII database nodout, next to the file with the energies."""

from __future__ import annotations

import pickle
from typing import TYPE_CHECKING

import numpy as np
import pytest

from d2rpick.base.errors import FormatError
from d2rpick.histories.node_listings import read_listed_nodes, recognises
from d2rpick.histories.opening import open_run
from d2rpick.histories.source import Source
from tests.energies import require
from tests.flight.test_body_frame import (
    BOX,
    CORNER_IDS,
    CORNERS,
    TIME as BOX_TIME,
    find_drift_of_box,
    find_drift_with_nodes,
    get_turning,
)

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from d2rpick.histories.history import NodeMotion, Samples

IDS = (7, 11, 123456789)
TIME = np.linspace(0.0, 0.3, 4)
MOVED = np.linspace(-40.0, 40.0, 36).round(3).reshape(4, 3, 3)
TABLE = b"time,internal_energy\n0,1\n0.1,2\n0.2,1.5\n0.3,1\n"


def list_nodes(
    time: Samples = TIME,
    moved: Samples = MOVED,
    ids: Sequence[int] = IDS,
    *,
    rotations: bool = True,
) -> bytes:
    """Return a nodout with displacements (n, nodes, 3), other numbers after them, and blocks of rotations."""
    text = " made for tests\n                         ls-dyna smp.d R13\n"
    for state, moment in enumerate(time.tolist()):
        head = f"\n\n\n n o d a l   p r i n t   o u t   f o r   t i m e  s t e p{state + 1:8d}"
        head += f"{'':30s}( at time{moment:14.7E} )\n\n"
        text += head + " nodal point  x-disp     y-disp      z-disp      x-vel\n"
        for node, row in zip(ids, moved[state].tolist(), strict=True):
            numbers = [*row, *[-9.9] * 9]
            text += f"{node:9d}{numbers[0]:13.4E}"
            text += "".join(f"{number:12.4E}" for number in numbers[1:]) + "\n"
        if rotations:
            text += (
                head + " nodal point  x-rot      y-rot       z-rot       x-rot vel\n"
            )
            text += "".join(f"{node:9d}{77.0:13.4E}{77.0:12.4E}\n" for node in ids)
    return text.encode()


def read_nodes(*contents: bytes) -> NodeMotion | None:
    """Read the nodes of some files."""
    sources = [Source(f"nodout{i}", data) for i, data in enumerate(contents)]
    return read_listed_nodes(sources, {*IDS})


@pytest.mark.parametrize("rotations", [True, False])
def test_the_displacements_of_each_node_are_read_and_nothing_else(
    rotations: bool,
) -> None:
    content = list_nodes(rotations=rotations)
    assert recognises(content)
    motion = require(read_nodes(content))
    assert motion.ids == IDS
    np.testing.assert_allclose(motion.time, TIME)
    np.testing.assert_allclose(motion.displacements, MOVED, rtol=1e-4)


def test_a_newer_restart_segment_replaces_states_and_a_node_of_one_of_them_is_left_out() -> (
    None
):
    newer = list_nodes(TIME[2:] + 0.05, -MOVED[2:, 1:], IDS[1:])
    motion = require(read_nodes(list_nodes(), newer))
    assert motion.ids == IDS[1:]
    np.testing.assert_allclose(motion.time, [*TIME[:3], *(TIME[2:] + 0.05)])
    joined = np.concatenate([MOVED[:3, 1:], -MOVED[2:, 1:]])
    np.testing.assert_allclose(motion.displacements, joined, rtol=1e-4)


def test_a_file_cut_at_any_byte_has_whole_states_or_none() -> None:
    content = list_nodes(TIME[:2], MOVED[:2])
    for end in range(len(content)):
        try:
            motion = require(read_nodes(content[:end]))
        except FormatError as error:
            assert "no displacements of nodes can be read" in str(error)  # noqa: PT017  other ends have whole states
            continue
        count = motion.time.size
        nodes = len(motion.ids)
        assert nodes == 3 or count == 1
        np.testing.assert_allclose(
            motion.displacements, MOVED[:count, :nodes], rtol=1e-4
        )


def test_states_with_other_nodes_are_refused_with_both_times() -> None:
    content = list_nodes(TIME[:2], MOVED[:2]) + list_nodes(
        TIME[2:], MOVED[2:, :2], IDS[:2]
    )
    with pytest.raises(FormatError, match=r"at 0\.2 it has other nodes than at 0:?"):
        read_nodes(content + list_nodes(TIME[3:] + 0.1, MOVED[3:]))


def test_a_nodout_is_used_with_the_energies_and_refused_alone(tmp_path: Path) -> None:
    table = tmp_path / "energy.csv"
    table.write_bytes(TABLE)
    nodout = tmp_path / "nodout"
    nodout.write_bytes(list_nodes())
    run = open_run([str(table), str(nodout)])
    assert run.sources == (str(table), str(nodout))
    for opened in (run, pickle.loads(pickle.dumps(run)), run.within(run.surroundings)):
        motion = require(opened.displacements([11, 99]))
        assert motion.ids == (11,)
        np.testing.assert_allclose(motion.displacements[:, 0], MOVED[:, 1], rtol=1e-4)
    with pytest.raises(FormatError, match="name the glstat, matsum or binout"):
        open_run([str(nodout)])
    nodout.write_bytes(list_nodes()[:300])
    assert open_run([str(table), str(nodout)]).displacements([11]) is None


def test_the_frame_of_a_body_by_nodout_is_that_by_the_nodes_of_radioss() -> None:
    content = list_nodes(BOX_TIME, BOX.corners - CORNERS, CORNER_IDS)

    def read_displacements(ids: Sequence[int]) -> NodeMotion | None:
        return read_listed_nodes([Source("nodout", content)], ids)

    turning = get_turning(find_drift_with_nodes(BOX, read_displacements))
    expected = get_turning(find_drift_of_box(BOX))
    size = np.abs(expected.place).max()
    np.testing.assert_allclose(turning.place, expected.place, atol=2e-3 * size)
    np.testing.assert_allclose(turning.frame, expected.frame, atol=1e-3)
    np.testing.assert_allclose(turning.rate, expected.rate, rtol=1e-2)
