"""Finished switched runs held against their reference: by a solver, and by the closed form; which parts count."""

import re
from collections.abc import Callable
from csv import DictReader
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from d2rpick.base.errors import RangeError
from d2rpick.choice.answers import Verdict, compare_with, verify_of
from d2rpick.choice.comparison import (
    MOST_MOMENTUM_ERROR,
    Comparison,
    compare_runs,
    times_of,
)
from d2rpick.choice.question import Settings
from d2rpick.choice.switched_run import rigid_parts, switched_history
from d2rpick.histories.history import History, Samples, Track
from d2rpick.histories.opening import Selection, open_run
from tests.command import (
    BOX,
    ENERGY,
    ROLLOVER,
    answer,
    put,
    refused,
    replayed as motion,
    run,
)
from tests.computed import results, stored
from tests.energies import sure
from tests.json_schemas import check_by_schema, checked
from tests.reading import read, solved

TR, TD = 0.0135867, 0.0687534
VERIFY = ("verify", "--no-verify", "--tr", "0.1", "--td", "0.37", "--part", "box")
LEGS = stored("rollover_r100_T0*.gz")


def scan(run_name: str) -> dict[str, float]:
    """Row of the table in which the solver's runs were evaluated when they were computed."""
    table = np.genfromtxt(
        results("rollover_scan.csv"),
        delimiter=",",
        names=True,
        dtype=None,
        encoding="utf-8",  # older versions of numpy take bytes, with a warning
    )
    assert table.dtype.names
    (row,) = table[table["run"].astype(str) == run_name]
    return {name: float(row[name]) for name in table.dtype.names[1:]}


def rollover(*options: str) -> dict[str, Any]:
    """Answer of verify for the rollover switched at 100 ms, its three legs given by a glob."""
    return answer(*VERIFY, BOX, "--switched", LEGS, *options)


# A rollover, computed by a solver whose rigid parts report neither kinetic energy nor momentum.


def test_a_switched_rollover_flies_as_its_reference_with_less_vibration() -> None:
    found, expected = rollover(), scan("r100")
    check_by_schema(found)
    switched = found["switched"]
    assert [name[-6:] for name in switched["source"]] == ["T01.gz", "T02.gz", "T03.gz"]
    assert switched["energy_frozen"] == pytest.approx(expected["IEfrozen_J"], rel=1e-5)
    # between two of every tenth state; of all of them 1.7492
    assert switched["energy_td"] == pytest.approx(1.7515, abs=1e-4)
    assert switched["level_ratio"] == switched["energy_frozen"] / switched["energy_td"]
    # that table's means reach to 380 ms and were taken of every tenth state; contact is at 381.9 ms
    assert switched["mean_after"] == pytest.approx(
        expected["IEmean_td_to_380ms_J"], rel=0.01
    )
    assert switched["mean_after_reference"] == pytest.approx(
        expected["IEmean_ref_J"], rel=0.06
    )
    assert switched["spread_after"] < switched["spread_after_reference"]
    assert switched["end"] == pytest.approx(0.3819, abs=5e-4)  # a state each 0.5 ms
    assert switched["momentum_error"] < 1e-6
    # of the centre at td, in mm; the largest distance afterwards is no smaller
    at_td = np.hypot(expected["dx_td_mm"], expected["dz_td_mm"]) / 1e3
    assert switched["displacement"] == pytest.approx(at_td, rel=0.15)
    assert switched["notes"] == []


def test_a_mean_energy_that_is_another_one_is_an_objection() -> None:
    found, expected = rollover(), scan("r100")
    share = found["switched"]["mean_after"] / found["switched"]["mean_after_reference"]
    assert share == pytest.approx(
        expected["IEmean_td_to_380ms_J"] / expected["IEmean_ref_J"], rel=0.06
    )
    assert share < 0.7
    assert not found["verified"]
    (reason,) = found["switched"]["objections"]
    assert (
        f"{share:.2g} times that of the reference, 0.7 to 1.3 were expected" in reason
    )
    assert rollover("--min-mean-energy", "0.6")["verified"]


def test_the_times_are_read_off_the_switched_run() -> None:
    """Its states are 0.5 ms apart; the option does not take the history that follows it."""
    found = answer("verify", "--part", "box", "--switched", LEGS, BOX)
    assert (found["tr"], found["td"]) == (
        pytest.approx(0.1, abs=5e-4),
        pytest.approx(0.37, abs=5e-4),
    )
    assert found["history"]["source"] == [BOX]
    at = answer("verify", "--td", "0.37", "--part", "box", "--switched", LEGS, BOX)
    assert (at["tr"], at["td"]) == (found["tr"], 0.37)
    assert (
        "the energies of the switched run and of the reference run are the same; give --tr and --td"
        in refused("verify", "--part", "box", "--switched", BOX, BOX)
    )
    assert (
        "give the time of the switch as --td"
        in run("verify", "--tr", "0.1", "--part", "box", BOX).stderr
    )


def test_a_run_without_rigid_times_is_refused_with_the_cause() -> None:
    swinging = history(2.0 + np.sin(40 * TIME) ** 2)
    other = history(2.0 + np.sin(41 * TIME) ** 2)
    constant = history(np.full_like(TIME, 2.0))
    with pytest.raises(RangeError, match="never stays constant"):
        times_of(other, swinging)
    with pytest.raises(RangeError, match="from 0 to 1, but that of the reference run"):
        times_of(constant, history(np.full_like(TIME, 3.0)))
    with pytest.raises(RangeError, match="are the same"):
        times_of(swinging, history(swinging.energy))


def test_a_leg_in_which_nothing_stands_still_names_those_beside_it(
    tmp_path: Path,
) -> None:
    first, later = tmp_path / "runT01.gz", tmp_path / "runT02.gz"
    first.write_bytes(Path(BOX).read_bytes())
    later.touch()
    told = run("verify", "--part", "box", "--switched", str(first), BOX).stderr
    assert f"in the same folder is {later}, a later leg of the run? Name it too" in told


@pytest.mark.slow
def test_of_a_fall_the_times_are_not_guessed_and_given_ones_verify(
    tmp_path: Path,
) -> None:
    """Nothing vibrates before the ground: the energies of both runs are round-off until then."""
    box = ("rollover", "--drop", "0.1", "--mesh", "4", "--t-end", "0.18")
    names = [str(tmp_path / f"{name}.matsum") for name in ("reference", "switched")]
    for name, switches in zip(names, ((), ("--tr", "0", "--td", "0.13")), strict=True):
        assert run(*box, *switches, "-o", name).exit_code == 0
    asked = ("verify", "--part", "box", names[0], "--switched", names[1])
    assert "or that of the reference does so too" in run(*asked).stderr
    assert answer(*asked, "--tr", "0", "--td", "0.13")["verified"] is True


def test_the_table_sets_the_switched_run_beside_the_reference() -> None:
    result = run(*VERIFY, BOX, "--switched", LEGS)
    lines = [line.split() for line in result.stdout.splitlines()]
    assert ["energy", "right", "after", "td", "1.45057", "1.75145"] in lines
    assert ["largest", "displacement", "after", "td", "0.000134"] in lines
    assert result.exit_code == 1


RIGHT = ("--part", "box", BOX, "--switched", LEGS)
AT_20 = ("--energy", "boxIE_J", ROLLOVER, "--switched", stored("rollover_r20.csv.gz"))


@pytest.mark.parametrize(
    ("tr", "td", "runs", "said"),
    [
        (
            "0.2",
            "0.37",
            RIGHT,
            "is rigid from 0.1 to 0.370008 by its energy, not from tr 0.2",
        ),
        ("0.1", "0.36", RIGHT, "not from tr 0.1 to td 0.36"),
        ("0.18", "0.37", RIGHT, "is not that of the reference at tr 0.18"),
        (
            "0.1",
            "0.37",
            (*RIGHT[:-1], BOX),
            "does not stand still",
        ),  # it was never rigid
        ("0.02", "0.37", AT_20, "locked in, 11.1"),
    ],
)
def test_a_run_that_was_not_switched_so_is_an_objection(
    tr: str, td: str, runs: tuple[str, ...], said: str
) -> None:
    found = answer("verify", "--no-verify", "--tr", tr, "--td", td, *runs)
    assert found["verified"] is False
    assert any(said in reason for reason in found["reasons"])


def test_csv_has_the_objections_as_one_text() -> None:
    asked = ("verify", "--no-verify", "--tr", "0.02", "--td", "0.37", *AT_20)
    (row,) = DictReader(StringIO(run(*asked, "-f", "csv").stdout))
    assert (
        row["switched_objections"]
        == "; ".join(answer(*asked)["switched"]["objections"])
        != ""
    )


def test_the_option_is_repeated_for_further_files_of_the_switched_run() -> None:
    spread = [LEGS.replace("*", leg) for leg in "123"]
    found = answer(
        *VERIFY, BOX, *(text for leg in spread for text in ("--switched", leg))
    )
    assert found["switched"]["source"] == spread
    assert found["history"]["source"] == [BOX]


# The floating oscillator of the paper, computed by a solver, as tables without momentum.


@pytest.mark.parametrize(
    ("name", "tr", "td", "frozen"),
    [
        ("13_64", 0.013, 0.064, 1.143063),
        ("6_80", 0.006, 0.080, 140.262),
        ("13p587_68p753", TR, TD, 6.07041),
    ],
)
def test_a_switched_table_is_compared_by_its_energy(
    name: str, tr: float, td: float, frozen: float
) -> None:
    reference, other = (
        stored(f"oscillator_{which}.csv.gz") for which in ("ref", f"d2r_{name}")
    )
    found = checked(
        *("verify", "--tr", str(tr), "--td", str(td), "--energy", "IE_J"),
        reference,
        "--switched",
        other,
    )
    switched = found["switched"]
    assert switched["energy_frozen"] == pytest.approx(frozen, rel=1e-9)
    assert (switched["momentum_error"], switched["displacement"]) == (None, None)
    means = []
    for path in (other, reference):
        table = np.genfromtxt(path, delimiter=",", names=True)
        means.append(
            table["IE_J"][
                (table["time_s"] >= td) & (table["time_s"] <= switched["end"])
            ].mean()
        )
    assert [switched["mean_after"], switched["mean_after_reference"]] == pytest.approx(
        means, rel=1e-12
    )
    assert switched["notes"] == []


# The closed form, written as a solver would.

SWITCHES = ("--tr", str(TR), "--td", str(TD))


@pytest.fixture
def replayed(tmp_path: Path) -> Callable[..., str]:
    """Write a replay as a matsum: with these options, and with a change of its text."""

    def write(
        name: str, *options: str, change: Callable[[str], str] = str, v0: str = "6"
    ) -> str:
        file = put(
            tmp_path / f"{name}.matsum",
            change(motion("matsum", *options, v0=v0).decode()),
        )
        return str(file)

    return write


def while_rigid(text: str, pattern: str, number: float) -> str:
    """Write ``number`` for what matches in the states between the switches."""
    head, *states = text.split("\n time =")
    rigid = re.compile(rf"({pattern}=) *[-+.\dE]+")
    new = [
        rigid.sub(rf"\g<1>{number:13.4E}", s)
        if TR < float(s.split()[0]) < TD + 1e-4
        else s
        for s in states
    ]
    assert new != states
    return "\n time =".join([head, *new])


def verified(reference: str, switched: str, *options: str) -> dict[str, Any]:
    return checked(
        "verify",
        "--tr",
        str(TR),
        "--td",
        str(TD),
        reference,
        "--switched",
        switched,
        *options,
    )


def test_a_right_switched_run_verifies_and_shows_what_was_locked_in(
    replayed: Callable[..., str],
) -> None:
    found = verified(
        replayed("reference"), replayed("switched", *SWITCHES), "--part", "spring"
    )
    switched = found["switched"]
    assert found["flight"]["source"] == "momentum"
    assert switched["level_ratio"] == pytest.approx(1, abs=1e-3)
    assert switched["mean_after"] == pytest.approx(
        switched["mean_after_reference"], rel=1e-3
    )
    assert switched["spread_after"] == pytest.approx(
        switched["spread_after_reference"], rel=1e-3
    )
    assert switched["momentum_error"] < 5e-4
    assert (switched["displacement"], switched["notes"]) == (None, [])
    assert found["verified"]


@pytest.mark.slow
def test_another_motion_of_the_switched_run_is_an_objection(
    replayed: Callable[..., str],
) -> None:
    reference, slower = replayed("reference"), replayed("slower", *SWITCHES, v0="5")
    args = ("verify", *SWITCHES, reference, "--switched", slower)
    assert run(*args).exit_code == 1
    assert run(*args, "--exit-zero").exit_code == 0
    found = verified(reference, slower)
    assert not found["verified"]
    assert found["tr_ok"]
    assert any(
        "its motion differs from the reference" in reason for reason in found["reasons"]
    )
    assert "not verified" in run(*args).stdout


def test_rigid_parts_that_report_no_motion_are_no_finding(
    replayed: Callable[..., str],
) -> None:
    silent = replayed(
        "silent",
        *SWITCHES,
        change=lambda text: while_rigid(text, "(?:z-mom|kinen)", 0.0),
    )
    found = verified(replayed("reference"), silent)
    assert (found["verified"], found["switched"]["notes"]) == (True, [])
    assert found["switched"]["momentum_error"] < 5e-4


@pytest.mark.slow
def test_a_wrong_energy_while_rigid_is_a_note_and_not_what_came_back(
    replayed: Callable[..., str],
) -> None:
    right = replayed("right", *SWITCHES)
    wrong = replayed(
        "wrong", *SWITCHES, change=lambda text: while_rigid(text, "inten", 55.5)
    )
    reference = replayed("reference")
    found, expected = (
        verified(reference, which, "--part", "3") for which in (wrong, right)
    )
    assert found["switched"]["energy_frozen"] == pytest.approx(
        expected["switched"]["energy_frozen"], rel=2e-3
    )
    (note,) = found["switched"]["notes"]
    assert "while rigid the run reports an energy of 55.5" in note
    assert found["verified"]
    shown = run(
        "verify", *SWITCHES, "--part", "3", reference, "--switched", wrong
    ).stdout
    assert f"note: {note}" in " ".join(shown.split())


def test_what_a_reader_has_to_say_of_the_switched_run_is_not_lost(
    replayed: Callable[..., str],
) -> None:
    cut = replayed("cut", *SWITCHES, change=lambda text: text[:-200])
    found = verified(replayed("reference"), cut, "--part", "3")
    assert any("ends within" in note for note in found["switched"]["notes"])
    assert found["history"]["notes"] == []


@pytest.mark.slow
def test_csv_and_markdown_hold_the_comparison_too(replayed: Callable[..., str]) -> None:
    args = (
        "verify",
        *SWITCHES,
        replayed("reference"),
        "--switched",
        replayed("switched", *SWITCHES),
    )
    switched = answer(*args)["switched"]
    head, row = (
        line.split(",") for line in run(*args, "-f", "csv").stdout.splitlines()
    )
    cells = dict(zip(head, row, strict=True))
    assert float(cells["switched_energy_frozen"]) == switched["energy_frozen"]
    assert cells["switched_displacement"] == ""
    assert (
        f"| switched_mean_after | {switched['mean_after']:.6g} |"
        in run(*args, "-f", "markdown").stdout
    )
    assert "switched" not in run(*args[:-2], "-f", "csv").stdout


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("", "the file is empty"),
        ("time,energy\n0,1\n0.01,1\n", "energy"),
        ("a,b\n1,x\n", "number"),
    ],
)
def test_what_is_wrong_with_the_switched_file_names_it(
    content: str, says: str, tmp_path: Path, replayed: Callable[..., str]
) -> None:
    bad = put(tmp_path / "bad.csv", content)
    told = refused(
        "verify",
        *SWITCHES,
        "--part",
        "3",
        replayed("reference"),
        "--switched",
        str(bad),
    )
    assert "bad.csv" in told
    assert says in told or "no parts" in told


def test_a_switched_run_that_lacks_a_part_that_flies_has_no_momentum_to_compare(
    replayed: Callable[..., str],
) -> None:
    def without_frame(text: str) -> str:
        pieces = re.split(
            r"(?= mat\.#=)", text.replace("        1     frame", "        2     frame")
        )
        return "".join(
            piece for piece in pieces if not piece.startswith(" mat.#=    1")
        )

    switched = replayed("switched", *SWITCHES, change=without_frame)
    found = verified(replayed("reference"), switched, "--part", "3")
    assert found["switched"]["momentum_error"] is None
    assert found["verified"]


# The comparison itself.

TIME: Samples = np.linspace(0.0, 1.0, 101)
NONE = (None, None)


def history(energy: Samples, time: Samples = TIME, name: str = "run") -> History:
    return History(time, energy, source=(name,), format="csv", channel="E")


def held(momenta: tuple[Track | None, Track | None], td: float = 0.5) -> Comparison:
    """Compare two runs of one energy by their momenta."""
    return compare_runs(
        history(1 + TIME), history(1 + TIME), (0.1, td), np.inf, 0.2, momenta, NONE
    )


def track(values: Samples) -> Track:
    return Track(TIME, np.stack([values, 0 * TIME, 0 * TIME], axis=1))


@pytest.mark.parametrize("share", [0.0, 0.04, 0.06, 2.0])
def test_the_momentum_error_is_relative_to_the_largest_momentum_of_the_reference_after_td(
    share: float,
) -> None:
    reference = track(np.where(TIME < 0.3, 20.0, 10.0))
    found = held((reference, track(reference.values[:, 0] + 10 * share * TIME)))
    assert found.momentum_error == pytest.approx(share)
    assert any("momentum" in one for one in found.objections) == (
        share > MOST_MOMENTUM_ERROR
    )


def test_what_has_come_to_rest_is_not_off_by_its_noise() -> None:
    reference = track(np.where(TIME < 0.3, 20.0, 1e-9))
    found = held((reference, track(3 * reference.values[:, 0])))
    assert not any("momentum" in one for one in found.objections)


@pytest.mark.parametrize(
    ("momenta", "error"),
    [
        # before td and at its first state it does not count
        ((track(0 * TIME + 10), track(np.where(TIME <= 0.5, 0.0, 10.0))), 0),
        (NONE, None), ((track(TIME), None), None), ((None, track(TIME)), None),
        ((track(0 * TIME), track(TIME)), None),
    ],
)  # fmt: skip
def test_a_momentum_that_is_right_or_that_one_run_does_not_have_is_no_error(
    momenta: tuple[Track | None, Track | None], error: float | None
) -> None:
    found = held(momenta)
    assert found.momentum_error == error
    assert not any("momentum" in one for one in found.objections)


def test_displacement_is_the_largest_distance_of_the_centres() -> None:
    places = np.stack([TIME, TIME**2, 0 * TIME], axis=1)
    moved = places + np.outer(TIME, [0.03, 0.0, 0.04])
    found = compare_runs(
        history(1 + TIME),
        history(1 + TIME),
        (0.1, 0.5),
        0.8,
        0.2,
        NONE,
        (Track(TIME, places), Track(TIME, moved)),
    )
    assert found.displacement == pytest.approx(0.8 * 0.05)


def test_a_reference_without_energy_at_td_has_no_ratio() -> None:
    assert (
        compare_runs(
            history(0 * TIME), history(1 + TIME), (0.1, 0.5), 1.0, 0.2, NONE, NONE
        ).level_ratio
        is None
    )


LONG: Samples = np.linspace(0.0, 1.0, 1001)


def crushed(vibration: float) -> Samples:
    """Energy of a body that was crushed, mostly plastic: it goes on falling and rising while it vibrates."""
    return np.asarray(29000 + vibration * np.sin(20 * LONG))


@pytest.mark.parametrize("vibration", [3.0, 300.0, 20000.0])
def test_a_right_switched_run_of_a_crushed_body_was_rigid_from_tr_to_td(
    vibration: float,
) -> None:
    """By 1e-4 of an energy that is plastic a vibration of 3 would stand still all along."""
    energy = crushed(vibration)
    frozen = np.interp(0.3, LONG, energy)
    after = np.where(LONG > 0.8, energy[800] - frozen, 0)
    switched = np.where((LONG >= 0.3) & (LONG <= 0.8), frozen, energy - after)
    found = compare_runs(
        history(energy, LONG),
        history(switched, LONG),
        (0.3, 0.8),
        np.inf,
        1.0,
        NONE,
        NONE,
    )
    assert found.rigid_from == pytest.approx(0.3, abs=2e-3)
    assert found.rigid_to == pytest.approx(0.8, abs=2e-3)
    assert found.objections == ()
    for pair in ((0.2, 0.8), (0.3, 0.9), (0.4, 0.8), (0.3, 0.7)):
        found = compare_runs(
            history(energy, LONG),
            history(switched, LONG),
            pair,
            np.inf,
            1.0,
            NONE,
            NONE,
        )
        assert any("is rigid from" in one for one in found.objections)


def test_where_the_reference_stands_still_too_a_longer_stillness_is_no_objection() -> (
    None
):
    """A body that flies in from the start, and hardly vibrates: its energy does not tell when it was switched."""
    energy = 5 + np.where(LONG > 0.9, LONG - 0.9, 0.0)
    found = compare_runs(
        history(energy, LONG), history(energy, LONG), (0.3, 0.8), 0.89, 1.0, NONE, NONE
    )
    assert found.rigid_from == 0.0
    assert found.objections == ()


@pytest.mark.parametrize("short", ["reference", "switched"])
def test_a_run_that_ends_at_td_is_named(short: str) -> None:
    runs = {name: history(1 + TIME, name=name) for name in ("reference", "switched")}
    runs[short] = history(1 + TIME[:52], TIME[:52], short)
    with pytest.raises(
        RangeError, match=rf"^{short}: fewer than 3 states from td 0.5 to 0.51; "
    ):
        compare_runs(
            runs["reference"], runs["switched"], (0.1, 0.5), np.inf, 0.2, NONE, NONE
        )
    runs[short] = history(1 + TIME[:40], TIME[:40], short)
    with pytest.raises(
        RangeError,
        match=rf"^{short}: ends at 0.39, not after td 0.5; give the later legs of the run",
    ):
        compare_runs(
            runs["reference"], runs["switched"], (0.1, 0.5), np.inf, 0.2, NONE, NONE
        )


def test_no_output_replaces_a_file_of_the_switched_run(tmp_path: Path) -> None:
    file, before = tmp_path / "switched.csv", motion("csv", *SWITCHES)
    file.write_bytes(before)
    asked = (
        "verify",
        *SWITCHES,
        ENERGY,
        "--overwrite",
        "--switched",
        str(tmp_path / "*.csv"),
    )
    for option in ("-o", "--report"):
        assert "this is an input" in run(*asked, option, str(file)).stderr
    assert file.read_bytes() == before


CAR_TR, CAR_TD = 0.0496, 0.1464


def legs(run: str) -> list[str]:
    """Legs of a run; until tr all runs are alike."""
    return [
        stored(name) for name in ("car_all_T01.gz", f"{run}_T02.gz", f"{run}_T03.gz")
    ]


def compared(run: str, *parts: str) -> Verdict:
    """Verdict on the car whose engine, battery and four wheels were six rigid bodies, or that was one."""
    asked = solved("carT01.gz", *parts)
    verdict = verify_of(asked, CAR_TR, CAR_TD, Settings())
    return compare_with(
        verdict,
        asked,
        asked.like(open_run(legs(run), Selection()), Selection(parts=parts)),
    )


def test_the_parts_that_were_rigid_are_recognised_in_several_bodies() -> None:
    heavy = open_run(legs("car_heavy"), Selection())
    rigid = sure(rigid_parts(heavy, heavy.parts[:17], heavy.part_time, CAR_TR, CAR_TD))
    assert [
        part.title for part, one in zip(heavy.parts, rigid, strict=False) if one
    ] == ["engine", "battery", "wheels"]
    every = open_run(legs("car_all"), Selection())
    rigid = sure(rigid_parts(every, every.parts[:17], every.part_time, CAR_TR, CAR_TD))
    assert rigid.all()
    assert (
        rigid_parts(every, every.parts[:17], every.part_time, CAR_TR, CAR_TR + 5e-4)
        is None
    )  # too few states


def test_a_run_of_which_all_parts_were_rigid_is_judged_by_its_energy() -> None:
    """Computed: 0.947 of the mean energy of shells and beams until the landing, all parts without springs here."""
    found = sure(compared("car_all", "1-17").switched)
    assert found.objections == ()
    assert found.mean_after / found.mean_after_reference == pytest.approx(
        0.957, abs=0.005
    )


def test_parts_that_were_not_rigid_are_named() -> None:
    found = sure(compared("car_heavy", "11,12").switched)
    assert (
        "not rigid from tr 0.0496 to td 0.1464 in the switched run: bows"
        in found.objections
    )


def test_energies_that_are_reported_wrongly_do_not_enter_the_comparison() -> None:
    """The battery reports 70 400 J for 21; shells and beams keep 1.019 of their mean energy."""
    found = sure(compared("car_heavy", "1-17").switched)
    assert found.mean_after / found.mean_after_reference == pytest.approx(
        1.019, abs=0.002
    )
    assert any(
        note.startswith("left out of the comparison: engine, battery, wheels,")
        for note in found.notes
    )


@pytest.mark.slow
@pytest.mark.parametrize("parts", [("12-14",), ()])
def test_where_all_energies_are_reported_wrongly_only_the_motion_is_judged(
    parts: tuple[str, ...],
) -> None:
    found = sure(compared("car_heavy", *parts).switched)
    (objection,) = found.objections
    assert objection.startswith(
        "the energies of engine, battery, wheels are reported wrongly after td"
    )
    assert sure(found.momentum_error) < 1e-5
    assert (parts == ()) == (
        "judged by the parts that were rigid: engine, battery, wheels" in found.notes
    )


def test_plans_go_on_from_a_run_of_which_some_parts_were_rigid() -> None:
    heavy = read(legs("car_heavy"), Selection(parts=("11-14",)))
    history, windows, cautions = switched_history(heavy, [(CAR_TR, CAR_TD)])
    assert windows == ((CAR_TR, CAR_TD),)
    (told,) = cautions
    assert told.code == "partly-rigid"
    assert "these parts were not rigid: bows;" in told.message
    assert not [one for one in history.momenta if one.parts is not None]
    assert not switched_history(
        read(legs("car_heavy"), Selection(parts=("12-14",))), [(CAR_TR, CAR_TD)]
    )[2]
