"""The samples of the rollover box are the same run in every format, and the energies of each are balanced."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

import d2rpick as d2
from d2rpick.histories.formats import READERS
from d2rpick.histories.history import History
from d2rpick.histories.opening import Selection, open_run
from d2rpick.models.box_model import Parameters
from d2rpick.models.box_run import Record, simulate
from tests import sample_box
from tests.command import ROOT, put, run_json
from tests.energies import require

KEPT = ROOT / "sample_data"
EXCEL = KEPT / "rollover_box_excel.csv"
NAMES = (*(f"rollover_box.{suffix}" for suffix in ("csv", "h5", "glstat", "matsum", "binout")), "rollover_boxT01",
         *(f"rollover_box.{suffix}" for suffix in ("d3plot", "d3thdt")))  # fmt: skip
LARGEST = 320_000  # largest sample [bytes]


@pytest.fixture(scope="module")
def computed() -> Record:
    """Compute the run now."""
    return simulate(Parameters(), sample_box.T_END, interval=sample_box.INTERVAL)


@pytest.fixture(scope="module")
def fresh(computed: Record) -> Mapping[str, bytes]:
    """Make the files of the run that is computed now."""
    return sample_box.make_files(computed)


def read_box_history(path: Path) -> History:
    """Read the energy of the box, or of box and step if the file does not distinguish them."""
    run = open_run([str(path)])
    return run.history(Selection(parts=("box",) if run.parts else ()))


def test_by_default_the_trip_is_over_and_the_ground_comes_when_they_do_in_the_study(
    computed: Record,
) -> None:
    assert 0.070 <= require(computed.released) <= 0.090
    assert require(computed.landed) == pytest.approx(0.380, abs=0.005)
    assert np.abs(computed.imbalance).max() < 0.01


@pytest.mark.slow
def test_every_format_has_its_sample(fresh: Mapping[str, bytes]) -> None:
    assert {*fresh} == {*NAMES}
    assert {run_json("info", str(KEPT / name))["format"] for name in NAMES} == {
        *READERS
    }


@pytest.mark.parametrize("name", NAMES)
def test_a_sample_is_what_the_model_gives(
    name: str, fresh: Mapping[str, bytes], tmp_path: Path
) -> None:
    stored_history, fresh_history = (
        read_box_history(KEPT / name),
        read_box_history(put(tmp_path / name, fresh[name])),
    )
    np.testing.assert_allclose(stored_history.time, fresh_history.time, rtol=1e-6)
    np.testing.assert_allclose(
        stored_history.energy, fresh_history.energy, rtol=1e-3, atol=1e-2
    )  # rounding errors grow with every contact
    assert (KEPT / name).stat().st_size < LARGEST


@pytest.mark.parametrize("name", NAMES)
def test_the_energies_of_a_sample_balance_and_its_health_is_right(name: str) -> None:
    health = run_json("info", str(KEPT / name))["health"]
    if not name.endswith(
        ("matsum", "d3plot", "d3thdt")
    ):  # these have no energies of the model, or no external work
        assert health["energy_ratio_min"] > 0.999
        assert health["energy_ratio_max"] < 1.001
        assert health["sliding_share"] < 1e-6


@pytest.mark.usefixtures("by_level")
@pytest.mark.parametrize(
    "name",
    [name for name in NAMES if name.endswith(("matsum", "binout", "d3plot", "d3thdt"))],
)
def test_one_run_has_one_answer_in_every_file_of_its_parts(name: str) -> None:
    suggestion = run_json("suggest", "--td", "0.37", "--part", "box", str(KEPT / name))
    assert suggestion["recommended"]["tr"] == pytest.approx(
        0.09703, abs=sample_box.INTERVAL
    )
    assert suggestion["flight"]["source"] == "momentum"
    assert suggestion["flight"]["start"] == pytest.approx(
        0.0865, abs=sample_box.INTERVAL
    )
    assert suggestion["flight"]["end"] == pytest.approx(0.379, abs=sample_box.INTERVAL)


def test_the_table_from_excel_shows_gravity_if_it_contains_the_mass(
    tmp_path: Path,
) -> None:
    """docs/how-to/recipes.md says so: without the mass, a constant force may be any load."""
    head, *rows = EXCEL.read_text("utf-8").splitlines()
    with_mass = tmp_path / "with_mass.csv"
    with_mass.write_text(
        "\n".join([f"{head};Mass [kg]", *(f"{row};356" for row in rows)])
    )
    verdicts = [
        require(d2.suggest(d2.read(str(path))).decision).verdict
        for path in (EXCEL, with_mass)
    ]
    assert verdicts == ["do not use", "use with care"]
