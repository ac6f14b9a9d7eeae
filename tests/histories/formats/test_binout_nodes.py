"""Nodes whose motion LS-DYNA writes (branch nodout of a binout): displacements over their own times."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from d2rpick.histories.formats import binout
from d2rpick.histories.opening import Selection, open_run
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
from tests.made_binout import LsdaWriter
from tests.reading import open_contents

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from d2rpick.histories.history import Samples

IDS = (7, 11, 40)
TIME = np.linspace(0.0, 0.9, 10)
MOVED = np.arange(90.0).reshape(10, 3, 3)


def put_energies(writer: LsdaWriter, time: Samples) -> None:
    """Write the branch glstat."""
    writer.cd("/glstat/metadata")
    writer.put("title", b"made for tests".ljust(80), "i1")
    for state, moment in enumerate(time.tolist(), start=1):
        writer.cd(f"/glstat/d{state:06d}")
        writer.put("time", [moment], "f8")
        for name in ("kinetic_energy", "internal_energy", "total_energy"):
            writer.put(name, [1.0 + state], "f4")


def put_nodes(
    writer: LsdaWriter, time: Samples, ids: Sequence[int], moved: Samples
) -> None:
    """Write the branch nodout with displacements (n, nodes, 3)."""
    writer.cd("/nodout/metadata")
    writer.put("title", b"made for tests".ljust(80), "i1")
    writer.put("ids", [*ids], "i4")
    for state, moment in enumerate(time.tolist(), start=1):
        writer.cd(f"/nodout/d{state:06d}")
        writer.put("time", [moment], "f8")
        for axis, name in enumerate("xyz"):
            writer.put(f"{name}_displacement", moved[state - 1, :, axis], "f4")
            writer.put(f"{name}_coordinate", moved[state - 1, :, axis] + 5.0, "f4")


def make_binout(
    time: Samples = TIME, moved: Samples = MOVED, ids: Sequence[int] = IDS
) -> bytes:
    """Return a binout whose energies are written three times as often as its nodes."""
    writer = LsdaWriter()
    put_energies(writer, np.linspace(time[0], time[-1], 3 * time.size))
    put_nodes(writer, time, ids, moved)
    writer.table()
    return bytes(writer.data)


def test_nodes_have_their_own_times_and_unknown_nodes_are_left_out() -> None:
    run = open_contents(binout, make_binout())
    motion = require(run.displacements([40, 7, 99]))
    assert motion.ids == (7, 40)
    np.testing.assert_allclose(motion.time, TIME)
    np.testing.assert_array_equal(motion.displacements, MOVED[:, [0, 2]])
    assert run.displacements([99]) is None


def test_displacements_of_a_newer_restart_segment_replace_those_of_the_older(
    tmp_path: Path,
) -> None:
    names = []
    for leg, (time, moved) in enumerate([(TIME, MOVED), (TIME[6:] + 0.05, -MOVED[6:])]):
        folder = tmp_path / f"leg{leg}"
        folder.mkdir()
        (folder / "binout").write_bytes(make_binout(time, moved))
        names.append(str(folder / "binout"))
    motion = require(open_run(names, Selection()).displacements(IDS))
    np.testing.assert_allclose(motion.time, [*TIME[:7], *(TIME[6:] + 0.05)])
    joined = np.concatenate([MOVED[:7], -MOVED[6:]])
    np.testing.assert_array_equal(motion.displacements, joined)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b"/nodout", b"/elout_"),
        (b"x_displacement", b"x_displacemen_"),
        (b"/nodout/d000004", b"/nodout/d000006"),
    ],
)
def test_nodes_that_are_missing_or_damaged_are_no_obstacle_to_the_energies(
    old: bytes, new: bytes
) -> None:
    run = open_contents(binout, make_binout().replace(old, new))
    assert run.displacements(IDS) is None
    assert run.databases[0].channel("internal_energy").size == 30


def test_a_file_cut_at_any_byte_has_a_part_of_the_motion_or_none() -> None:
    content = make_binout(TIME[:4], MOVED[:4])
    begin = content.index(b"/nodout/metadata")
    counts = set()
    for end in range(begin, len(content), 29):
        motion = open_contents(binout, content[:end]).displacements(IDS)
        count = 0 if motion is None else motion.time.size
        if motion is not None:
            np.testing.assert_array_equal(motion.displacements, MOVED[:count])
        counts.add(count)
    assert counts >= {0, 3, 4}


def test_the_frame_of_a_body_by_nodout_is_that_by_the_nodes_of_radioss() -> None:
    moved = BOX.corners - CORNERS
    run = open_contents(binout, make_binout(BOX_TIME, moved, CORNER_IDS))
    turning = get_turning(find_drift_with_nodes(BOX, run.displacements))
    expected = get_turning(find_drift_of_box(BOX))
    for quantity in expected._fields:
        np.testing.assert_allclose(
            np.asarray(getattr(turning, quantity), dtype=float),
            np.asarray(getattr(expected, quantity), dtype=float),
            rtol=1e-3,
            atol=1e-3,
        )
