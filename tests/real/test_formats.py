"""Content of files from other people, compared with numbers found by other means."""

from __future__ import annotations

import csv
import io
from typing import TYPE_CHECKING

import numpy as np
import pytest

from d2rpick.histories.formats import matsum
from d2rpick.histories.formats.radioss_th import TimeHistory
from d2rpick.histories.listings import find_printed_steps, read_timing, read_zone_times
from d2rpick.histories.opening import Selection, open_run
from tests.command import GLSTAT
from tests.histories.formats.test_glstat import assert_numbers_of_float
from tests.real.files import content, real

if TYPE_CHECKING:
    from pathlib import Path

QA = "OpenRadioss__miniqa-"


# file, states, global variables, parts with variables
REAL = [
    (f"{QA}AMS-boxbeam-reference-BOXBEAMT01", 801, 12, [(1, "SHELL2")]),
    (
        f"{QA}FLUIDE_NEW-EBCS-INIV-reference-INIVT01",
        69,
        12,
        [(2, "Solid part 2"), (3, "Solid part 3")],
    ),
    (
        f"{QA}FLUIDE_NEW-EBCS-INIV-reference-INIVT02",
        69,
        12,
        [(2, "Solid part 2"), (3, "Solid part 3")],
    ),
    (
        f"{QA}FLUIDE_NEW-EBCS-INIV-reference-INIVT03",
        552,
        12,
        [(2, "Solid part 2"), (3, "Solid part 3")],
    ),
    (
        f"{QA}INTERF-INT_7-igsti-small_boule_igsti-dtmin_02-reference-BOULE1V5T01",
        3,
        12,
        [(1, "BOULE"), (2, "COQUE ARRIERE")],
    ),
    (f"{QA}OPTIONS-NEW_BOX_V11-BOX_GRSHEL-reference-FOAM_GRSHELT01", 1, 12, []),
    (
        f"{QA}RESTART-cra2-reference-CRA2V44T01",
        50,
        12,
        [(1, "PID 1"), (2, "PID 2"), (3, "PID 3")],
    ),
    (
        f"{QA}RESTART-cra2-reference-CRA2V44T02",
        50,
        12,
        [(1, "PID 1"), (2, "PID 2"), (3, "PID 3")],
    ),
    (f"{QA}RUPTURE-FAIL_TAB-ELEM_SAMP-reference-1ELEM_SAMPT01", 258, 12, []),
    (f"{QA}SPH-WavesCompression-reference-CUBCT01", 45, 12, []),
    (
        f"{QA}onefile_rad-reference-CRA2AV4T01",
        400,
        12,
        [(1, "PID 1"), (2, "PID 2"), (3, "PID 3")],
    ),
    ("Yasu2019__ASSY_T01", 1, 22, []),
]


@pytest.mark.parametrize(("file", "states", "globals_", "parts"), REAL)
def test_real_files_have_the_numbers_of_the_solvers_own_converter(
    file: str, states: int, globals_: int, parts: list[tuple[int, str]]
) -> None:
    """th_to_csv prints seven digits of each number, in the order of the file whatever its header contains."""
    run = TimeHistory(content(file), file)
    assert [(part.id, part.title) for part in run.parts] == parts
    assert len(run.channels) == globals_
    assert run.complete
    text = content(f"{file}.csv").decode("latin-1")
    rows = [
        line.split(",")
        for line in text.splitlines()
        if line.count(",") > globals_ and '"' not in line
    ]
    table = np.array([[float(cell) for cell in row if cell] for row in rows])
    assert run.time.shape == (states,)
    np.testing.assert_allclose(run.time, table[:, 0], rtol=1e-6)
    for column_number, name in enumerate(run.channels, start=1):
        np.testing.assert_allclose(
            run.channel(name), table[:, column_number], rtol=1e-6
        )
    names = next(csv.reader(io.StringIO(text)))
    for part_id, title in parts:
        for short, quantity in (
            ("IE", "internal_energy"),
            ("KE", "kinetic_energy"),
            ("ZMOM", "z_momentum"),
        ):
            column = (
                names.index(f"{title.ljust(40)}  {short} ") - 3
            )  # the header names 15 globals, there are 12
            np.testing.assert_allclose(
                run.part_channel(quantity, [part_id])[:, 0], table[:, column], rtol=1e-6
            )


def test_each_part_of_a_real_file() -> None:
    """Numbers extracted from the file with awk: state (from 1), time and the internal energies of the parts."""
    run = matsum.Matsum(content("PILLARS-LSDyna__Bolt_B_Explicit-matsum"), "matsum")
    titles = {
        10: "Plate 1", 20: "Plate 2", 100: "Bolt", 110: "Bolt Head", 120: "Bolt Nut",
        101: "Contact Beam Bolt (imp only)", 310: "Contact Beams Plates",
    }  # fmt: skip
    assert {part.id: part.title for part in run.parts} == titles
    internal = run.part_channel("internal_energy", list(titles))
    assert {
        state: [run.part_time[state - 1], *internal[state - 1]]
        for state in (2, 50, 1001)
    } == {
        2: [4.8730e-03, 0.0, 0.0, 1.1260e-05, 1.2170e-06, 1.2170e-06, 0.0, 0.0],
        50: [2.4490e-01, 4.2235, 0.86697, 13.671, 0.94142, 0.92748, 0.0, 0.0],
        1001: [4.9999, 7.9869, 1.7680, 34.151, 6.2484, 6.1190, 0.0, 0.0],
    }
    assert run.part_channel("kinetic_energy", list(titles))[-1].tolist() == [
        9.9113e-02, 1.0965e-01, 1.5108e-02, 3.3402e-02, 4.0127e-02, 0.0, 0.0,
    ]  # fmt: skip
    momentum = [run.part_channel(f"{axis}_momentum", [110])[-1, 0] for axis in "xyz"]
    assert momentum == [2.1572e-02, -1.5911e-02, 1.7556e-04]


def test_titles_of_a_real_file_are_found_by_number() -> None:
    """The order of its legend differs from that of its blocks."""
    run = matsum.Matsum(
        content("lasso-python__sph_models-R7_1_2-binout.l2a-matsum"), "matsum"
    )
    assert [(part.id, part.title) for part in run.parts] == [
        (1, "null shells for visualization"),
        (101, ""),
    ]
    assert run.part_channel("internal_energy", [101])[[1, 49, 87], 0].tolist() == [
        0.0,
        2.3528,
        2.3516,
    ]


@pytest.mark.parametrize(
    "file",
    [
        "PILLARS-LSDyna__Bolt_B_Explicit-glstat",
        "PILLARS-LSDyna__test_parachute-windflow_v1_thru_v10-glstat",
        "ansys-example-data__result_files-binout-binout_glstat.l2a-glstat",
    ],
)
def test_all_numbers_of_a_glstat_are_those_of_float(file: str) -> None:
    assert_numbers_of_float(content(file), file)


def test_legs() -> None:
    """th_to_csv gives 50 states to 2.451106 and 50 from 2.50147; of the fluid 69, 69 and 552."""
    stem = f"histories/{QA}{{}}T0{{}}"
    crash = open_run(
        [real(stem.format("RESTART-cra2-reference-CRA2V44", n)) for n in (2, 1)]
    )
    history = crash.history(Selection())
    assert (history.time.size, history.notes) == (100, ())
    assert history.time[[49, 50]] == pytest.approx([2.451106, 2.50147], rel=1e-6)
    assert history.energy[[49, 50]] == pytest.approx([146200.3, 148146.4], rel=1e-6)
    fluid = open_run(
        [real(stem.format("FLUIDE_NEW-EBCS-INIV-reference-INIV", n)) for n in (1, 2, 3)]
    )
    assert fluid.history(Selection()).time.size == 690


def test_glstat_and_matsum_of_one_run_are_joined_by_their_printed_times() -> None:
    """94 of the 1001 times are printed identically with six and with five digits."""
    stem = "histories/PILLARS-LSDyna__Bolt_B_Explicit-"
    run = open_run([real(f"{stem}{kind}") for kind in ("matsum", "glstat")])
    assert run.notes == ()
    whole, bolt = (
        run.history(Selection()),
        run.history(Selection(parts=("bolt", "110-120"))),
    )
    assert (whole.format, whole.channel, whole.time.size) == (
        "glstat + matsum",
        "internal energy",
        1001,
    )
    assert bolt.channel == "internal energy of Bolt, Bolt Head, Bolt Nut"
    assert bolt.energy[-1] == pytest.approx(34.151 + 6.2484 + 6.1190, rel=1e-12)
    total_energy = run.part_energies(run.parts).sum(axis=1)
    assert np.abs(total_energy - whole.energy).max() < 6.1e-4


def test_a_real_d3hsp_is_read_by_the_clock_where_processor_times_are_rounded_to_nothing() -> (
    None
):
    timing = read_timing(real("histories/lasso-python__sph_models-R12_2_1-d3hsp"))
    assert (timing.cycles, timing.elements) == (640, 0.035)
    assert timing.total == pytest.approx(1.298 - 0.011 - 1.216)


@pytest.mark.parametrize(
    "name",
    ["lasso-python__sph_models-R12_2_1-d3hsp", "lasso-python__sph_models-R7_1_2-d3hsp"],
)
def test_smallest_steps_of_a_real_d3hsp_are_found_beside_the_history(
    tmp_path: Path, name: str
) -> None:
    (tmp_path / "d3hsp").write_bytes(content(name))
    expected = 5.4722e-5 if "R12" in name else 6.0802e-5
    assert find_printed_steps(open_run([GLSTAT]), str(tmp_path / "main.k"))[101] == (
        expected,
        "d3hsp",
    )


def test_the_part_that_controls_the_step_is_found_in_a_real_glstat() -> None:
    run = open_run([real("histories/PILLARS-LSDyna__Bolt_B_Explicit-glstat")])
    steps = find_printed_steps(run)
    assert {part: source for part, (_, source) in steps.items()} == {10: "glstat"}
    assert steps[10][0] == pytest.approx(1.97875e-4)


def test_times_per_zone_cycle_of_a_real_glstat() -> None:
    zone_times = read_zone_times(
        real("histories/Masters-Project__Steel_Explicit-glstat.head16000")
    )
    assert zone_times.time[0] == pytest.approx(5e-4, rel=1e-3)
    assert zone_times.per_zone[0] == pytest.approx(5134e-9)
