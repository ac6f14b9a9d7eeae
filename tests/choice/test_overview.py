"""The overview of a run by info, for files of any content."""

import csv
import io
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from d2rpick.report.history_files import write_table
from tests.command import (
    BOX,
    ENERGY,
    GLSTAT,
    ROLLOVER,
    ROOT,
    join_wrapped_lines,
    make_replay_file,
    put,
    run,
    run_json,
)
from tests.json_schemas import run_json_checked
from tests.made_t01 import make_t01

FORMATS = ("table", "json", "csv", "markdown")


def run_info(*args: str) -> dict[str, Any]:
    """Run info and validate its answer."""
    return run_json_checked("info", *args)


@pytest.fixture
def matsum(tmp_path: Path) -> Path:
    """Write the paper's oscillator as a matsum of three parts."""
    return put(tmp_path / "matsum", make_replay_file("matsum"))


@pytest.mark.parametrize(
    ("source", "form", "states", "end", "channel", "unit"),
    [
        (ENERGY, "csv", 1501, 0.15, "internal_energy", ""),
        (GLSTAT, "glstat", 1501, 0.15, "internal energy", ""),
        (ROLLOVER, "csv", 900, 0.4495097, "boxIE_J", "s"),
    ],
)
def test_info_tells_format_states_span_and_channels(
    source: str, form: str, states: int, end: float, channel: str, unit: str
) -> None:
    document = run_info(source)
    assert (document["source"], document["format"], document["states"]) == (
        [source],
        form,
        states,
    )
    assert (document["time_start"], document["time_end"], document["time_unit"]) == (
        0.0,
        end,
        unit,
    )
    assert channel in document["channels"]
    assert (
        document["sampling"]["min"]
        <= document["sampling"]["median"]
        <= document["sampling"]["max"]
    )
    assert document["sampling"]["median"] == pytest.approx(end / (states - 1), rel=0.01)
    assert (document["complete"], document["parts"]) == (True, [])


def test_info_tells_version_parts_and_flight_of_a_matsum(matsum: Path) -> None:
    document = run_info(str(matsum))
    assert document["title"] == "floating oscillator"
    assert "layout of ls-dyna" in document["version"]
    assert [(part["id"], part["title"]) for part in document["parts"]] == [
        (1, "frame"), (2, "suspended mass"), (3, "spring"),
    ]  # fmt: skip
    assert [part["energy_max"] for part in document["parts"]] == [
        0.0,
        0.0,
        pytest.approx(140.36, rel=1e-4),
    ]
    assert document["flights"] == [{"start": 0.0, "end": None, "source": "momentum", "parts": [
        {"id": part["id"], "title": part["title"]} for part in document["parts"]
    ]}]  # fmt: skip


def test_info_lists_all_flights_of_the_parts_asked_for() -> None:
    document = run_info("--part", "box", BOX)
    first, second = document["flights"]
    assert [part["title"] for part in first["parts"]] == ["box", "step"]
    assert 0.087 <= first["start"] <= 0.093
    assert first["end"] == pytest.approx(0.3819, abs=0.002)
    assert first["end"] < second["start"]
    assert second["end"] is None
    assert "rotation_energy" in document["channels"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "args",
    [
        (str(ROOT / "sample_data/rollover_box.matsum"), "--part", "box"),
        (str(ROOT / "sample_data/rollover_box.glstat"),),
        (ENERGY,),
    ],
)
def test_info_lists_the_flights_that_plan_and_suggest_choose_from(
    args: tuple[str, ...],
) -> None:
    listed = run_info(*args)["flights"]
    planned = run_json("plan", *args)["windows"]
    assert listed
    for key in ("end", "source"):
        assert [flight_row[key] for flight_row in listed] == [
            row[f"flight_{key}"] for row in planned
        ]
    chosen = run_json("suggest", *args)["flight"]
    assert chosen["source"] in [flight_row["source"] for flight_row in listed]
    if chosen["source"] != "energy":  # the energy shows a different flight for each td
        assert [flight_row["start"] for flight_row in listed] == [
            row["flight_start"] for row in planned
        ]
        assert (chosen["start"], chosen["end"]) in [
            (flight_row["start"], flight_row["end"]) for flight_row in listed
        ]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("rolloverT01.gz", None),
        ("rollover_box.matsum", None),
        ("rollover_box.binout", None),
        (
            "rollover_box.glstat",
            "*DATABASE_MATSUM, with the DT of *DATABASE_GLSTAT: only part momenta show",
        ),
        ("rollover_box.csv", "LS-DYNA: *DATABASE_MATSUM): only part momenta"),
        (
            "energy.csv",
            "LS-DYNA: *DATABASE_MATSUM), at least columns x_momentum, y_momentum, z_momentum of the model:",
        ),
    ],
)
def test_info_says_in_the_solver_s_words_what_the_run_should_write(
    name: str, message: str | None
) -> None:
    source = str(ROOT / "sample_data" / name)
    document = run_info(source)["should_write"]
    text = join_wrapped_lines(run("info", source).stdout)
    if message is None:
        assert document is None
        assert "should write" not in text
    else:
        assert message in document
        assert f"should write {document}" in text


def test_a_t01_without_parts_should_have_them(tmp_path: Path) -> None:
    (tmp_path / "RUNT01").write_bytes(bytes(make_t01(40, parts=()).data))
    assert run_info(str(tmp_path / "RUNT01"))["should_write"].startswith(
        "/TH/PART with DEF, MASS and HE for all parts:"
    )


def test_companions_are_one_run(matsum: Path, tmp_path: Path) -> None:
    glstat = put(tmp_path / "glstat", make_replay_file("glstat"))
    document = run_info(str(tmp_path))
    assert document["format"] == "glstat + matsum"
    assert sorted(document["source"]) == [str(glstat), str(matsum)]
    assert "total energy" in document["channels"]
    assert len(document["parts"]) == 3


@pytest.mark.parametrize(
    "text", ["time,internal_energy\n0.5,1\n", "time,internal_energy\n0.5,1\n0.6,2\n"]
)
def test_a_history_may_have_any_number_of_states(text: str, tmp_path: Path) -> None:
    file = put(tmp_path / "few.csv", text)
    document = run_info(str(file))
    states = text.count("\n") - 1
    assert (
        document["states"],
        document["time_start"],
        document["sampling"] is None,
    ) == (
        states,
        0.5,
        states == 1,
    )
    assert {run("info", str(file), "-f", name).exit_code for name in FORMATS} == {0}


def test_columns_that_leave_the_choice_of_the_energy_open_are_listed(
    tmp_path: Path,
) -> None:
    time = np.linspace(0, 1, 20)
    file = put(
        tmp_path / "several.csv",
        write_table("csv", {"time": time, "left": time, "right": time**2}),
    )
    assert run("suggest", "--td", "0.5", str(file)).exit_code == 2
    document = run_info(str(file))
    assert (document["channels"], document["states"]) == (["left", "right"], 20)


def test_hdf5_columns_are_listed(tmp_path: Path) -> None:
    time = np.linspace(0, 1, 20)
    file = tmp_path / "run.h5"
    file.write_bytes(
        write_table(
            "hdf5", {"a/time": time, "a/internal_energy": time, "a/other": time**2}
        )
    )
    document = run_info(str(file))
    assert document["states"] == 20
    assert {"a/internal_energy", "a/other"} <= set(document["channels"])


def test_hdf5_columns_that_leave_the_choice_open_are_listed_with_the_reason(
    tmp_path: Path,
) -> None:
    time = np.linspace(0, 1, 20)
    file = tmp_path / "several.h5"
    groups = ("a/time", "a/internal_energy", "b/time", "b/internal_energy")
    file.write_bytes(write_table("hdf5", dict.fromkeys(groups, time)))
    document = run_info(str(file))
    assert set(groups) <= set(document["channels"])
    assert (document["states"], document["time_start"], document["sampling"]) == (
        None,
        None,
        None,
    )
    assert any(
        "2 columns for the internal energy" in note for note in document["notes"]
    )
    assert {run("info", str(file), "-f", name).exit_code for name in FORMATS} == {0}
    assert run_info("--energy", "b/internal_energy", str(file))["states"] == 20


def test_a_run_killed_before_its_first_state_has_none(matsum: Path) -> None:
    head, *_ = matsum.read_text().split("\n time =")
    matsum.write_text(head)
    document = run_info(str(matsum))
    assert (
        document["states"],
        document["time_start"],
        document["sampling"],
        document["flights"],
    ) == (0, None, None, [])
    assert document["title"] == "floating oscillator"


def test_a_part_that_comes_and_goes_has_no_highest_energy(matsum: Path) -> None:
    head, *states = matsum.read_text().split("\n time =")
    gone = [re.sub(r" mat\.#=    2.*?(?= mat\.#=    3)", "", s, flags=re.DOTALL) if i > 5 else s for i, s in
            enumerate(states)]  # fmt: skip
    matsum.write_text("\n time =".join([head, *gone]))
    document = run_info(str(matsum))
    assert [part["energy_max"] is None for part in document["parts"]] == [
        False,
        True,
        False,
    ]
    assert any("only some states have part 2" in note for note in document["notes"])


def test_a_killed_run_is_said_to_be_incomplete(tmp_path: Path) -> None:
    file = put(tmp_path / "glstat", Path(GLSTAT).read_bytes()[:-60])
    document = run_info(str(file))
    assert not document["complete"]
    assert document["states"] == 1500
    assert any("ends within" in note for note in document["notes"])
    assert "complete           no" in run("info", str(file)).stdout


def test_a_refused_record_is_not_called_complete(tmp_path: Path) -> None:
    text = Path(GLSTAT).read_text("utf-8")
    assert "complete           yes" in run("info", GLSTAT).stdout
    cut_out = text.replace(" internal energy", " nothing at all", 3)
    file = put(tmp_path / "glstat", cut_out.encode())
    screen = run("info", str(file)).stdout
    assert screen.startswith("record  do not use it")
    assert "complete" not in screen.partition("source")[2]


def test_every_format_tells_the_same(matsum: Path) -> None:
    table = run("info", str(matsum)).stdout
    assert "states             1501" in table
    assert table.startswith(
        "record  suitable for choosing times: it contains flights (d2rpick plan judges the windows in them)\n"
        "why     1 free flight; the longest lasts 0.15"
    )
    assert (
        "flight  frame, suspended mass, spring from 0 to the end of the record, 0.15"
        in table
    )
    assert "next d2rpick plan --part flying " in join_wrapped_lines(table)
    assert re.search(r"^   3  spring +140\.36$", table, flags=re.MULTILINE)
    markdown = run("info", "-f", "markdown", str(matsum)).stdout
    assert "| states | 1501 |" in markdown
    assert "| 3 | spring | 140.36 |" in markdown


def test_csv_is_one_row_under_the_keys_of_json() -> None:
    source = BOX
    document = run_info("--part", "box", source)
    (row,) = csv.DictReader(
        io.StringIO(run("info", "-f", "csv", "--part", "box", source).stdout)
    )
    assert set(document) - {
        "schema",
        "tool_version",
        "command",
        "warnings",
        "sampling",
    } == {name for name in row if not name.startswith("sampling_")}
    assert (int(row["states"]), float(row["time_end"])) == (
        document["states"],
        document["time_end"],
    )
    assert float(row["sampling_median"]) == document["sampling"]["median"]
    assert row["channels"].split("; ") == document["channels"]
    assert row["parts"] == "1 box; 2 step; 3 sled"
    assert [
        flight.startswith("box, step from ") for flight in row["flights"].split("; ")
    ] == [True, True]


@pytest.mark.parametrize(
    ("names", "when", "ratio"),
    [
        (("car_all_T02.gz",), "from 0.0496021 to 0.146302", None),
        (("car_heavy_T02.gz",), "from 0.0496021 to 0.146306", None),
        (("drop2_w123_T01.gz",), "from 0 to 0.2836", None),
        (
            ("car_all_T01.gz", "car_all_T02.gz", "car_all_T03.gz"),
            "from 0.0496021 to 0.146402",
            1.1,
        ),
    ],
)
def test_rigid_legs_are_called_so_and_raise_no_alarm(
    names: tuple[str, ...], when: str, ratio: float | None
) -> None:
    """While parts are rigid, Radioss writes masses and momenta of 0, and arbitrary energies of solids."""
    document = run_info(*(str(ROOT / "tests/data" / name) for name in names))
    (warning,) = document["warnings"]
    assert warning["code"] == "rigid-legs"
    assert when in warning["message"]
    highest = document["health"]["energy_ratio_max"]
    assert highest is None if ratio is None else highest <= ratio
    assert {flight["source"] for flight in document["flights"]} == {"momentum"}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["tests/data/carT01.gz", "tests/data/drop2T01.gz"])
def test_deformable_legs_are_not_called_rigid(name: str) -> None:
    assert "rigid-legs" not in {
        warning["code"] for warning in run_info(str(ROOT / name))["warnings"]
    }
