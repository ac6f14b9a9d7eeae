"""Masses of parts: as a T01 has them, or momentum over rigid body velocity; unknown is NaN, nothing at all None."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from d2rpick.histories.opening import Selection, open_run
from tests.made_t01 import MadePart, t01, value
from tests.text_files import matsum_head, matsum_part

if TYPE_CHECKING:
    from pathlib import Path

    from d2rpick.histories.history import Samples

ZERO = "   0.0000E+00"


def masses(path: Path) -> Samples | None:
    return open_run([str(path)], Selection()).masses


def written(path: Path, parts: dict[int, tuple[float, float]], states: int = 4) -> Path:
    """Write a matsum of parts with momentum and velocity along y at the end, half of both in the middle, and so on."""
    text = matsum_head([*parts]).decode()
    for state in range(states):
        text += f" time ={0.1 * state:13.4E}\n"
        for id_, (momentum, velocity) in parts.items():
            block = matsum_part(id_, 1.0 + state).decode()
            for name, number in (("y-mom", momentum), ("y-rbv", velocity)):
                block = block.replace(f"{name}={ZERO}", f"{name}={number * state / states:13.4E}")
            text += block
    path.write_text(text)
    return path


def test_of_a_matsum_they_are_momentum_over_velocity(tmp_path: Path) -> None:
    found = masses(written(tmp_path / "matsum", {1: (30.0, 2.0), 2: (-4.0, -5.0), 7: (0.0, 0.0), 9: (6.0, 0.0)}))
    assert found is not None
    assert found[:3] == pytest.approx([15.0, 0.8, 0.0], rel=1e-4)
    assert np.isnan(found[3])  # a solver that does not write the velocity


def test_of_a_time_history_they_are_written(tmp_path: Path) -> None:
    (tmp_path / "RUNT01").write_bytes(t01(3, (MadePart(3, "box"), MadePart(12, "step"))).data)
    assert masses(tmp_path / "RUNT01") == pytest.approx([value(1, 3, 6), value(1, 12, 6)])  # the middle of all states
    (tmp_path / "ENERGYT01").write_bytes(t01(3, (MadePart(3, "box", codes=(1, 2)),)).data)
    assert masses(tmp_path / "ENERGYT01") is None
    (tmp_path / "MOTIONT01").write_bytes(t01(3, (MadePart(3, "box", codes=(1, 3, 4, 5)),)).data)
    assert masses(tmp_path / "MOTIONT01") is None
