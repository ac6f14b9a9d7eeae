"""d3plots from other people, compared with lasso-python and with the glstat of the same run."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from d2rpick.histories.opening import Selection, open_run
from tests.real.files import real

if TYPE_CHECKING:
    from d2rpick.histories.run import OpenedRun

FAMILIES = (
    "one_shell",
    "ten_bricks_smp",
    "four_parts",
    "gaps_in_numbers",
    "projectile_double",
)


@cache
def opened(folder: str) -> OpenedRun:
    return open_run([real(f"d3plot/{folder}/d3plot")])


@pytest.mark.parametrize("folder", FAMILIES)
def test_states_are_those_that_were_read_before(folder: str) -> None:
    truth = json.loads(Path(real(f"d3plot/{folder}/truth.json")).read_text("utf-8"))
    (database,) = opened(folder).databases
    ids = [part.id for part in database.parts]
    assert ids == (
        truth["part_ids"] or list(range(1, len(ids) + 1))
    )  # if they are numbered consecutively
    assert database.time.size == truth["states"]
    for state in truth["at"]:
        state_number, parts = int(state["state"]), state["parts"]
        assert database.time[state_number] == state["time"]
        for name, value in (
            ("internal_energy", "internal"),
            ("kinetic_energy", "kinetic"),
            ("total_energy", "total"),
        ):
            assert database.channel(name)[state_number] == state[value]
        assert [
            database.channel(f"{axis}_velocity")[state_number] for axis in "xyz"
        ] == state["velocity"]
        quantities = {
            "internal_energy": "internal",
            "kinetic_energy": "kinetic",
            "mass": "mass",
        }
        for name, value in quantities.items():
            assert (
                database.part_channel(name, ids)[state_number].tolist() == parts[value]
            )
        velocities = [
            database.part_channel(f"{axis}_rbvelocity", ids)[state_number]
            for axis in "xyz"
        ]
        assert np.transpose(velocities).tolist() == parts["velocity"]


def test_energies_are_those_of_the_glstat_of_the_same_run() -> None:
    run, glstat = (
        opened("one_shell"),
        open_run([real("d3plot/one_shell/glstat")]).history(Selection()),
    )
    time = run.part_time
    nearest_states = np.abs(glstat.time[:, np.newaxis] - time).argmin(axis=0)
    same = np.abs(glstat.time[nearest_states] - time) < 1e-6 * time[-1]
    assert same.sum() == 11
    energies = run.part_energies(run.parts)[same, 0]
    np.testing.assert_allclose(
        energies, glstat.energy[nearest_states[same]], rtol=1e-5, atol=1e-18
    )  # of its six digits


@pytest.mark.parametrize("folder", FAMILIES)
def test_all_states_are_as_lasso_reads_them(folder: str) -> None:
    """A second reading of all states, where it is installed; it reads no hourglass energy of the first release."""
    lasso = pytest.importorskip("lasso.dyna")
    theirs: Any = lasso.D3plot(real(f"d3plot/{folder}/d3plot")).arrays
    (database,) = opened(folder).databases
    ids = [part.id for part in database.parts]
    np.testing.assert_array_equal(database.time, theirs["timesteps"])
    np.testing.assert_array_equal(
        database.channel("kinetic_energy"), theirs["global_kinetic_energy"]
    )
    np.testing.assert_array_equal(
        database.channel("internal_energy"), theirs["global_internal_energy"]
    )
    for name in ("internal_energy", "kinetic_energy", "mass", "hourglass_energy"):
        np.testing.assert_array_equal(
            database.part_channel(name, ids), theirs[f"part_{name}"]
        )
    momenta = theirs["part_velocity"] * theirs["part_mass"][:, :, np.newaxis]
    for axis, name in enumerate("xyz"):
        np.testing.assert_allclose(
            database.part_channel(f"{name}_momentum", ids),
            momenta[:, :, axis],
            rtol=1e-6,
        )
