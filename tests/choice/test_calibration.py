"""Element weights fitted to the times of restart segments; ratios that the segments do not determine are kept."""

import shutil
from collections.abc import Mapping
from pathlib import Path

import pytest

from d2rpick.base.errors import ConfigurationError, DeckError, FormatError
from d2rpick.choice.parts.calibration import (
    Observation,
    fit_weights,
    read_observations,
    read_observations_of_runs,
)
from d2rpick.choice.parts.cost import MEASURED
from tests.deck.test_radioss_inventory import BEGIN, PROPS, write_nodes
from tests.decks import pad

TRUE = {"QBAT": 2.0, "BT": 0.9, "solid": 1.5}
REST, RIGID, NODES = 0.01, 0.1, 20_000
ALL = {"QBAT": 400.0, "BT": 500.0, "solid": 300.0}


def make_leg(
    counts: Mapping[str, float], rigid_nodes: float, *, elements: bool = True
) -> Observation:
    spent = sum(TRUE[name] * count for name, count in counts.items())
    total = spent + REST * NODES + RIGID * rigid_nodes
    return Observation(
        "leg", counts, NODES, rigid_nodes, total, spent if elements else None
    )


def make_legs(*, elements: bool = True) -> list[Observation]:
    one_less = [
        make_leg({**ALL, name: 0.0}, NODES // 2, elements=elements) for name in ALL
    ]
    return [
        make_leg(ALL, 0, elements=elements),
        *one_less,
        make_leg(dict.fromkeys(ALL, 0.0), NODES, elements=elements),
    ]


@pytest.mark.parametrize("elements", [True, False])
def test_weights_of_a_made_site_are_found(elements: bool) -> None:
    calibration = fit_weights(make_legs(elements=elements))
    assert calibration.misfit < 0.03
    for name, weight in TRUE.items():
        assert calibration.weights.per_element[name] == pytest.approx(weight, rel=0.1)
    assert calibration.weights.rigid_node == pytest.approx(RIGID, rel=0.15)
    assert calibration.weights.element_share == pytest.approx(
        1 - REST * NODES / make_leg(ALL, 0).total, abs=0.03
    )
    assert {*TRUE} <= {*calibration.told}


def test_what_one_run_does_not_tell_apart_keeps_its_ratio() -> None:
    calibration = fit_weights(
        [make_leg({"QBAT": 400.0, "BT": 1000.0, "solid": 180.0}, 0)]
    )
    ratios = {calibration.weights.per_element[name] / MEASURED[name] for name in ALL}
    assert max(ratios) / min(ratios) == pytest.approx(1, rel=0.02)
    assert "solid" not in calibration.told


def test_a_run_without_switching_is_needed() -> None:
    with pytest.raises(ConfigurationError, match="no run without rigid parts"):
        fit_weights([make_leg(ALL, 10)])


def write_listing(cycles: int, elements: float, total: float) -> str:
    """Return the end of an engine listing."""
    return (
        f" ** CUMULATIVE CPU TIME SUMMARY **\n CONTACT SORTING.............: .2224E+00     1.53 %\n"
        f" ELEMENT FORCES..............: {elements:.4E}    85.72 %\n"
        f" TOTAL.......................: {total:.4E}   100.00 %\n"
        f"     TOTAL NUMBER OF CYCLES  :   {cycles}\n"
    )


def run_folder(folder: Path) -> Path:
    """Write a run of two restart segments; part 1 of its two shells is rigid in the second."""
    parts = "".join(
        f"/PART/{n}\np{n}\n{pad(1, 1)}/SHELL/{n}\n{pad(n, *range(4 * n - 3, 4 * n + 1))}"
        for n in (1, 2)
    )
    body = f"/GRNOD/PART/1\ng\n{pad(1)}/RBODY/1\nbody\n{pad(9)[:-1]}{' ' * 50}{pad(1)}"
    deck = f"{BEGIN}{write_nodes(9)}{parts}{PROPS}{body}/END\n"
    (folder / "TEST_0000.rad").write_text(deck)
    (folder / "TEST_0001.rad").write_text("/RUN/TEST/1\n0.1\n/RBODY/OFF\n9\n")
    (folder / "TEST_0002.rad").write_text("/RUN/TEST/2\n0.2\n/RBODY/ON\n9\n")
    (folder / "TEST_0001.out").write_text(write_listing(100, 0.8e-3, 1.0e-3))
    (folder / "TEST_0002.out").write_text(write_listing(200, 0.8e-3, 1.4e-3))
    return folder


def test_legs_of_radioss_are_read_with_what_is_rigid_in_them(tmp_path: Path) -> None:
    free, rigid = read_observations(str(run_folder(tmp_path)))
    assert (free.counts, free.rigid_nodes) == ({"QEPH": 2.0, "point": 4.0}, 0.0)
    assert [free.elements, free.total] == pytest.approx([8.0, 10.0])
    assert (rigid.counts, rigid.rigid_nodes) == ({"QEPH": 1.0, "point": 2.0}, 4.0)
    assert [rigid.elements, rigid.total] == pytest.approx([4.0, 7.0])
    calibration = fit_weights([free, rigid]).weights.per_element
    assert calibration["QEPH"] + 2 * calibration["point"] == pytest.approx(
        4.0, rel=0.02
    )  # an element of three layers


def test_a_glstat_tells_by_its_time_per_zone_cycle(tmp_path: Path) -> None:
    windows = (
        "*DEFORMABLE_TO_RIGID_AUTOMATIC\n         1         0      0.02\n" + pad(0, 0, 0, 0, 1, 0) + pad(7, 0)
        + "*DEFORMABLE_TO_RIGID_AUTOMATIC\n         2         0      0.05\n" + pad(0, 0, 0, 0, 0, 1) + pad(7)
    )  # fmt: skip
    shells = "".join(
        f"{n:8d}{part:8d}       1       2       3       4\n"
        for n, part in ((1, 7), (2, 9))
    )
    section = "*SECTION_SHELL\n         1         2\n       1.0\n"
    parts = "".join(f"*PART\np\n{part:10d}{1:10d}{1:10d}\n" for part in (7, 9))
    mesh = (
        "*NODE\n"
        + "".join(f"{n:8d}\n" for n in range(1, 5))
        + f"*ELEMENT_SHELL\n{shells}"
    )
    (tmp_path / "main.k").write_text(f"*KEYWORD\n{parts}{section}{mesh}{windows}*END\n")
    states = "".join(
        f" time...........................   {time:.5E}\n time per zone cycle.(nanosec)..          {zone}\n"
        for time, zone in (
            (0.0, 0),
            (0.01, 5000),
            (0.02, 5000),
            (0.03, 3000),
            (0.05, 3000),
            (0.06, 5000),
        )
    )
    (tmp_path / "glstat").write_text(states)
    free, rigid = read_observations(str(tmp_path))
    assert (free.counts, free.elements) == ({"BT": 2.0, "point": 2.0}, None)
    assert (rigid.counts, rigid.rigid_nodes) == ({"BT": 1.0, "point": 1.0}, 4.0)
    assert [free.total, rigid.total] == pytest.approx([10.0, 6.0])


def test_folders_that_say_nothing_are_refused(tmp_path: Path) -> None:
    with pytest.raises(DeckError, match="no main deck"):
        read_observations(str(tmp_path))
    folder = run_folder(tmp_path)
    (folder / "TEST_0001.out").write_text("TOTAL NUMBER OF CYCLES : 7\n")
    with pytest.raises(FormatError, match="no times of elements"):
        read_observations(str(folder))
    for name in ("TEST_0001.out", "TEST_0002.out"):
        (folder / name).unlink()
    with pytest.raises(FormatError, match="no file contains the CPU time of the run"):
        read_observations(str(folder))


def test_a_run_that_is_given_twice_counts_once(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    folder = run_folder(tmp_path / "run")
    copy = shutil.copytree(folder, tmp_path / "copy")
    once = read_observations(str(folder))
    for again in (str(folder), f"{folder}/.", str(copy)):
        observations, cautions = read_observations_of_runs([str(folder), again])
        assert observations == once
        assert [caution.code for caution in cautions] == ["same-leg-twice"] * 2
        assert (
            "has the content of"
            if again == str(copy)
            else "is given twice; it is used once"
        ) in cautions[0].message
    (copy / "TEST_0002.out").write_text(write_listing(200, 0.8e-3, 1.3e-3))
    observations, cautions = read_observations_of_runs([str(folder), str(copy)])
    assert len(observations) == 3
    assert len(cautions) == 1
