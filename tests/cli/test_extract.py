"""Histories written and read back: extract as csv and hdf5, replay as matsum and hdf5."""

import csv
import io
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st

from d2rpick.base.errors import FormatError, HistoryError
from d2rpick.histories.history import History
from d2rpick.histories.opening import Selection, open_run
from d2rpick.report.history_files import choose_history_format, write_table
from tests.command import (
    BOX as ROLLOVER_T01,
    ENERGY,
    GLSTAT,
    MATSUM,
    OSCILLATOR,
    ROLLOVER,
    ROOT,
    make_replay_file,
    put,
    read_refusal,
    run,
    run_json,
)
from tests.computed import locate_stored
from tests.energies import require
from tests.reading import read_history

SUFFIXES = ["csv", "h5", "hdf5"]
# Equal except for the sign of zeros, which sums do not keep.
NUMBERS = st.floats(-1e300, 1e300, allow_nan=False)

BOX = {"csv": (), "h5": (), "glstat": (), "matsum": ("--part", "box")}
QUANTITIES = ("kinetic_energy", "total_energy", "external_work", "contact_energy")
UNUSUAL = "time,IE,E2,M1,M2,M3\n" + "".join(
    f"{i},{i % 3},{i},1,2,{-i}\n" for i in range(30)
)


def is_same(first_history: History, second_history: History) -> bool:
    """Return True if two histories hold the same numbers bit for bit."""
    return (
        first_history.time.tobytes() == second_history.time.tobytes()
        and first_history.energy.tobytes() == second_history.energy.tobytes()
    )


# extract.


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize(
    ("source", "energy"), [(ENERGY, ()), (GLSTAT, ()), (ROLLOVER, ("stepIE_J",))]
)
def test_what_is_extracted_reads_back_bit_for_bit(
    source: str, energy: tuple[str, ...], suffix: str, tmp_path: Path
) -> None:
    file = tmp_path / f"energy.{suffix}"
    options = [option for name in energy for option in ("--energy", name)]
    result = run("extract", *options, source, "-o", str(file))
    assert (result.exit_code, result.stdout) == (0, "")
    assert result.stderr == (
        "next: choose times with this table, but print the cards from the run itself, because the table names neither "
        f"its solver nor all its parts: d2rpick suggest {file}\n"
    )
    again = read_history([str(file)])
    assert again.channel == "internal_energy"
    assert again.format == ("csv" if suffix == "csv" else "hdf5")
    assert is_same(again, read_history([source], Selection(energy=energy)))


def test_from_csv_to_hdf5_and_back_the_file_is_the_same(tmp_path: Path) -> None:
    names = [str(tmp_path / name) for name in ("first.csv", "second.h5", "third.csv")]
    for source, target in zip([GLSTAT, *names[:2]], names, strict=True):
        assert run("extract", source, "-o", target).exit_code == 0
    assert Path(names[0]).read_bytes() == Path(names[2]).read_bytes()


@pytest.mark.slow
@settings(max_examples=15, deadline=None)
@given(
    times=st.lists(NUMBERS, min_size=2, max_size=20, unique=True),
    energy=st.lists(NUMBERS, min_size=20, max_size=20),
)
def test_any_numbers_read_back_bit_for_bit(
    tmp_path_factory: pytest.TempPathFactory, times: list[float], energy: list[float]
) -> None:
    columns = {
        "time": np.sort(times) + 0.0,
        "internal_energy": np.array(energy[: len(times)]) + 0.0,
    }
    for name, form in {"any.csv": "csv", "any.h5": "hdf5"}.items():
        file = put(tmp_path_factory.mktemp("any") / name, write_table(form, columns))
        try:
            again = read_history([str(file)])
        except HistoryError as error:
            # A value far beyond all others counts as damaged.
            assume("in the single state" not in str(error))
            raise
        assert again.time.tobytes() == columns["time"].tobytes()
        assert again.energy.tobytes() == columns["internal_energy"].tobytes()


def test_several_parts_have_a_column_each_beside_their_sum(tmp_path: Path) -> None:
    source, file = ROLLOVER_T01, tmp_path / "parts.h5"
    text = run("extract", "--part", "box,step", source).stdout
    head, *rows = csv.reader(io.StringIO(text))
    assert head[:4] == ["time", "internal_energy", "part_1", "part_2"]
    table = np.array(rows, dtype=float)[:, :4]
    np.testing.assert_array_equal(table[:, 1], table[:, 2] + table[:, 3])
    expected = open_run([source])
    np.testing.assert_array_equal(
        table[:, 2:], expected.part_energies(expected.parts[:2])
    )
    assert run("extract", "--part", "box,step", source, "-o", str(file)).exit_code == 0
    for column in ("part_1", "part_2", "internal_energy"):
        again = read_history([str(file)], Selection(energy=(column,)))
        np.testing.assert_array_equal(again.energy, table[:, head.index(column)])


def test_one_part_needs_no_column_beside_the_energy() -> None:
    source = ROLLOVER_T01
    # The step flies with the box but was not chosen, so its energy has its own name.
    assert run("extract", "--part", "box", source).stdout.startswith(
        "time,internal_energy,not_chosen_part_2,kinetic_energy,"
    )


# Evidence of flights is extracted with the energy.


@pytest.fixture(scope="module")
def box(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Write the rollover box in every format, and return the file names."""
    folder = tmp_path_factory.mktemp("box")
    files = {suffix: str(folder / f"box.{suffix}") for suffix in BOX}
    for file in files.values():
        assert run("rollover", "--mesh", "4", "--dt", "5e-4", "-o", file).exit_code == 0
    return files


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["csv", "h5"])
def test_a_table_of_some_parts_has_the_verdict_of_its_run(
    suffix: str, tmp_path: Path
) -> None:
    # The step vibrates together with the box, so the energy of the box alone shows no direction of the deformation.
    table = str(tmp_path / f"box.{suffix}")
    extracted = run("extract", "--part", "box", MATSUM, "-o", table)
    assert "step" in extracted.stderr
    answers = [run_json("suggest", "--part", "box", MATSUM), run_json("suggest", table)]
    for key in ("verdict", "verdict_reason", "basis", "recommended"):
        assert answers[0][key] == answers[1][key], key
    assert "also make part 2 rigid" in answers[1]["cure"]


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["csv", "h5"])
def test_a_table_of_parts_on_springs_has_the_flight_of_its_run(
    suffix: str, tmp_path: Path
) -> None:
    """The dampers of the springs change the energy of the chosen parts, which does not show a load on the car."""
    table = str(tmp_path / f"car.{suffix}")
    source = ("--part", "1-14", locate_stored("carT01.gz"))
    assert run("extract", *source, "-o", table).exit_code == 0
    td = ("suggest", "--td", "0.1463")
    of_run, of_table = run_json(*td, *source), run_json(*td, table)
    for key in ("start", "end", "source"):
        assert of_table["flight"][key] == of_run["flight"][key]
    assert of_table["recommended"]["tr"] == of_run["recommended"]["tr"]
    for key in ("verdict", "verdict_reason", "cure", "basis"):
        assert of_table[key] == of_run[key], key


def test_springs_of_a_table_are_not_proposed_as_rigid(tmp_path: Path) -> None:
    columns = {
        "time": np.linspace(0, 1, 50),
        "internal_energy": 3 + np.sin(40 * np.linspace(0, 1, 50)),
        "not_chosen_part_2": np.linspace(1, 2, 50),
        "not_chosen_spring_15": np.linspace(3, 7, 50),
    }
    file = put(tmp_path / "parts.csv", write_table("csv", columns))
    evidence = read_history([str(file)]).evidence
    assert [part.id for part in evidence.not_chosen] == [2, 15]
    assert [part.id for part in evidence.springs] == [15]
    energies = require(evidence.internal_energies(evidence.not_chosen))
    np.testing.assert_array_equal(energies.values[[0, -1]], [[1, 3], [2, 7]])


def test_a_table_of_all_parts_that_vibrate_leaves_out_none(tmp_path: Path) -> None:
    table = str(tmp_path / "both.csv")
    run("extract", "--part", "1,2", MATSUM, "-o", table)
    assert "not_chosen" not in Path(table).read_text()
    assert run_json("suggest", table)["basis"] == "modal"


def test_the_sum_with_the_part_left_out_is_of_all_parts(tmp_path: Path) -> None:
    table = str(tmp_path / "box.csv")
    run("extract", "--part", "box", MATSUM, "-o", table)
    energies = ("--energy", "internal_energy", "--energy", "not_chosen_part_2")
    assert run_json("suggest", *energies, table)["basis"] == "modal"


def test_the_card_of_a_table_does_not_claim_the_whole_model(tmp_path: Path) -> None:
    table = str(tmp_path / "box.csv")
    run("extract", "--part", "box", MATSUM, "-o", table)
    times = ("--tr", "0.124169", "--td", "0.369799", "--part", "1", "--exit-zero")
    card = run("card", *times, "--history", table).stdout
    assert "that of the whole model" not in card
    assert "does not name the parts of the internal" in card


@pytest.mark.parametrize(
    ("source", "suffix"), [*((source, "csv") for source in BOX), ("matsum", "h5")]
)
def test_what_is_extracted_has_the_flight_and_the_choice_of_its_file(
    source: str, suffix: str, box: dict[str, str], tmp_path: Path
) -> None:
    file = str(tmp_path / f"extracted.{suffix}")
    assert run("extract", *BOX[source], box[source], "-o", file).exit_code == 0
    arguments = ("suggest", "--no-verify", "--td", "0.37")
    document, expected = (
        run_json(*arguments, file),
        run_json(*arguments, *BOX[source], box[source]),
    )
    for name in ("start", "end"):
        assert document["flight"][name] == pytest.approx(
            expected["flight"][name], abs=5.1e-4
        )  # one state
    assert document["flight"]["source"] == expected["flight"]["source"]
    assert document["recommended"]["tr"] == pytest.approx(
        expected["recommended"]["tr"], rel=1e-5
    )


@pytest.mark.parametrize(
    "name", ["rollover_box.binout", "rollover_box.glstat", "rolloverT01.gz"]
)
def test_what_is_extracted_is_as_healthy_as_its_file(name: str, tmp_path: Path) -> None:
    """Friction energy stays separate, and the energy ratio is that written by the solver."""
    source, file = str(ROOT / "sample_data" / name), str(tmp_path / "extracted.csv")
    assert (
        run(
            "extract",
            *(() if name.endswith("glstat") else ("--part", "box")),
            source,
            "-o",
            file,
        ).exit_code
        == 0
    )
    run_info, expected = (
        run_json("info", file)["health"],
        run_json("info", source)["health"],
    )
    for key in ("energy_ratio_min", "energy_ratio_max", "sliding_share"):
        assert run_info[key] == pytest.approx(expected[key], rel=1e-5, abs=1e-12)


@pytest.mark.slow
def test_the_box_has_one_flight_in_every_format_that_tells_its_momentum(
    box: dict[str, str],
) -> None:
    arguments = ("suggest", "--no-verify", "--td", "0.37")
    answers = [
        run_json(*arguments, *BOX[form], box[form]) for form in ("csv", "h5", "matsum")
    ]
    assert {box_answer["flight"]["source"] for box_answer in answers} == {"momentum"}
    for name in ("start", "end"):
        assert np.ptp([box_answer["flight"][name] for box_answer in answers]) < 5.1e-4
    assert np.ptp([box_answer["recommended"]["tr"] for box_answer in answers]) < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["csv", "h5"])
def test_quantities_of_the_whole_model_are_extracted_under_one_name(
    suffix: str, box: dict[str, str], tmp_path: Path
) -> None:
    file = str(tmp_path / f"extracted.{suffix}")
    assert run("extract", box["glstat"], "-o", file).exit_code == 0
    quantities, expected = (
        open_run([name]).databases[0] for name in (file, box["glstat"])
    )
    assert {*QUANTITIES, "x_velocity"} <= {*quantities.quantities}
    for quantity in QUANTITIES:
        assert quantities.quantities[quantity] == quantity
        numbers = (
            quantities.channel(quantity),
            expected.channel(expected.quantities[quantity]),
        )
        np.testing.assert_array_equal(*numbers)


def test_a_channel_of_an_unusual_name_is_named(tmp_path: Path) -> None:
    file = put(tmp_path / "unusual.csv", UNUSUAL)
    options = [
        f"--channel={axis}_momentum=M{number}" for number, axis in enumerate("xyz", 1)
    ]
    text = run("extract", *options, "--channel", "kinetic-energy=3", str(file)).stdout
    assert text.startswith(
        "time,internal_energy,kinetic_energy,x_momentum,y_momentum,z_momentum,mass\n0.0,0.0,0.0,1.0,2.0,"
    )


@pytest.mark.parametrize(
    ("given_options", "reason"),
    [
        (("kinetic_energy=E9",), "no column 'E9'; there are: 1 'time', 2 'IE'"),
        (
            ("E2",),
            "--channel E2: QUANTITY=NAME was expected, such as kinetic_energy=NAME",
        ),
        (
            ("spin=E2",),
            "unknown quantity 'spin', but one of kinetic_energy, total_energy",
        ),
        (("mass=E2", "mass=M1"), "--channel names a quantity twice"),
    ],
)
def test_a_channel_that_is_none_is_refused(
    given_options: tuple[str, ...], reason: str, tmp_path: Path
) -> None:
    file = put(tmp_path / "unusual.csv", UNUSUAL)
    assert reason in read_refusal(
        "info", *(f"--channel={option}" for option in given_options), str(file)
    )


@pytest.mark.slow
def test_without_a_file_csv_goes_to_standard_output_and_notes_do_not(
    tmp_path: Path,
) -> None:
    file = put(tmp_path / "matsum", make_replay_file("matsum"))
    result = run("extract", str(file))
    assert result.stdout.startswith(
        "time,internal_energy,x_momentum,y_momentum,z_momentum,mass\n0.0,0.0,"
    )
    assert "the energies of all parts were added" in result.stderr
    assert run("extract", "-q", str(file)).stderr == ""
    hdf5 = run("extract", "--write-as", "hdf5", "-q", str(file))
    assert hdf5.stdout_bytes.startswith(b"\x89HDF")


def test_the_format_asked_for_comes_before_that_of_the_name(tmp_path: Path) -> None:
    file = tmp_path / "energy.csv"
    run("extract", "--write-as", "hdf5", ENERGY, "-o", str(file))
    assert read_history([str(file)]).format == "hdf5"


@pytest.mark.parametrize(
    "name", ["energy.txt", "energy", "energy.glstat", "matsum", "csv"]
)
def test_a_name_that_tells_no_format_is_refused_before_anything_is_read(
    name: str, tmp_path: Path
) -> None:
    message = read_refusal("extract", "absent.csv", "-o", str(tmp_path / name))
    assert message.endswith("the suffix names no format; give --write-as: csv, hdf5")
    assert not (tmp_path / name).exists()


@pytest.mark.parametrize("asked", [(), ("--write-as", "csv")])
def test_a_workbook_is_refused_with_the_name_of_a_table(
    asked: tuple[str, ...], tmp_path: Path
) -> None:
    file = tmp_path / "box.xlsx"
    message = read_refusal("extract", *asked, ENERGY, "-o", str(file))
    assert "workbooks (.xlsx) are not written" in message
    assert f"write {file.with_suffix('.csv')}, which Excel reads" in message
    assert not file.exists()


def test_an_existing_file_and_an_input_are_kept(tmp_path: Path) -> None:
    file = put(tmp_path / "energy.csv", Path(ENERGY).read_bytes())
    assert run("extract", ENERGY, "-o", str(file)).exit_code == 2
    assert run("extract", str(file), "-o", str(file), "--overwrite").exit_code == 2
    assert file.read_bytes() == Path(ENERGY).read_bytes()
    assert run("extract", ENERGY, "-o", str(file), "--overwrite").exit_code == 0
    assert file.read_bytes() != Path(ENERGY).read_bytes()


def test_format_of_takes_only_what_can_be_written() -> None:
    assert choose_history_format("run.H5", ["csv", "hdf5"]) == "hdf5"
    with pytest.raises(
        FormatError, match=r"run\.h5: the suffix names no format; give `write_as`: csv"
    ):
        choose_history_format("run.h5", ["csv"])


# replay, written and read back.


def test_a_replayed_hdf5_holds_the_numbers_of_the_csv(tmp_path: Path) -> None:
    names = [str(tmp_path / name) for name in ("motion.csv", "motion.h5")]
    for name, form in zip(names, ("csv", "hdf5"), strict=True):
        Path(name).write_bytes(make_replay_file(form))
    for column in ("internal_energy", "kinetic_energy", "z", "vy"):
        first_history, second_history = (
            read_history([name], Selection(energy=(column,))) for name in names
        )
        assert is_same(first_history, second_history)


@pytest.mark.parametrize("switches", [(), ("--tr", "0.0135867", "--td", "0.0687534")])
def test_a_replayed_matsum_holds_the_motion_to_five_digits(
    switches: tuple[str, ...], tmp_path: Path
) -> None:
    file = put(tmp_path / "matsum", make_replay_file("matsum", *switches))
    opened = open_run([str(file)])
    table = np.genfromtxt(
        io.BytesIO(make_replay_file("csv", *switches)), delimiter=",", names=True
    )
    ids = [part.id for part in opened.parts]
    frame, suspended, spring = opened.parts
    matsum = opened.databases[0]
    np.testing.assert_allclose(
        opened.part_energies([spring])[:, 0], table["internal_energy"], rtol=5e-5
    )
    kinetic = matsum.part_channel("kinetic_energy", ids).sum(axis=1)
    np.testing.assert_allclose(kinetic, table["kinetic_energy"], rtol=5e-5)
    momentum = matsum.part_channel("z_momentum", [frame.id, suspended.id])
    np.testing.assert_allclose(
        momentum, np.stack([15.7 * table["vz"], 31.4 * table["vy"]], axis=1), rtol=5e-5
    )


def test_suggest_gives_the_same_pair_on_a_replayed_matsum(tmp_path: Path) -> None:
    file = put(tmp_path / "matsum", make_replay_file("matsum"))
    suggestion, expected = run_json("suggest", "--td", "0.064", "--part", "spring", str(file)), run_json(
        "suggest", "--td", "0.064", ENERGY
    )  # fmt: skip
    assert suggestion["recommended"]["tr"] == pytest.approx(
        expected["recommended"]["tr"], rel=1e-5
    )
    assert suggestion["better_td"]["td"] == pytest.approx(
        expected["better_td"]["td"], rel=1e-5
    )
    assert suggestion["better_td"]["tr"] == pytest.approx(
        expected["better_td"]["tr"], rel=1e-5
    )
    flight = suggestion["flight"]
    assert (flight["start"], flight["end"], flight["source"]) == (0.0, None, "momentum")
    assert [part["title"] for part in flight["parts"]] == [
        "frame",
        "suspended mass",
        "spring",
    ]
    assert suggestion["history"]["parts"] == [{"id": 3, "title": "spring"}]


def test_an_undamped_replay_flies_by_its_constant_momentum(tmp_path: Path) -> None:
    file = tmp_path / "matsum"
    undamped = ["0" if value == "50" else value for value in OSCILLATOR]
    assert (
        run(
            "replay", *undamped, "--t-end", "0.15", "--dt", "1e-4", "-o", str(file)
        ).exit_code
        == 0
    )
    flight = run_json("suggest", "--td", "0.064", "--part", "spring", str(file))[
        "flight"
    ]
    assert (flight["start"], flight["end"], flight["source"]) == (0.0, None, "momentum")


@pytest.mark.slow
@pytest.mark.parametrize("form", ["matsum", "binout"])
def test_an_extracted_sum_has_no_more_digits_than_its_terms(
    tmp_path: Path, form: str
) -> None:
    """Digits that are not known are taken for a vibration, which spoils the verdict."""
    source = str(ROOT / "sample_data" / f"rollover_box.{form}")
    table = str(tmp_path / "box.csv")
    assert run("extract", "--part", "flying", source, "-o", table).exit_code == 0
    extracted = run_json("suggest", table)
    original = run_json("suggest", "--no-deck", "--part", "flying", source)
    assert extracted["verdict"] == original["verdict"] == "use with care"
    residuals = [
        answer["candidates"][0]["residual"] for answer in (extracted, original)
    ]
    assert residuals[0] == pytest.approx(residuals[1], abs=0.05)
