"""Finished switched runs compared with their reference, from a solver and from closed forms."""

import re
from collections.abc import Callable
from csv import DictReader
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from d2rpick.base.errors import RangeError
from d2rpick.base.spans import Times
from d2rpick.choice.answers import PairVerdict, verify_run
from d2rpick.choice.question import Reference, Settings
from d2rpick.choice.switched.compared_verdict import add_comparison
from d2rpick.choice.switched.comparison import (
    Comparison,
    compare_runs,
)
from d2rpick.choice.switched.same_model import MOST_MOMENTUM_ERROR
from d2rpick.choice.switched.switch_times import (
    find_switched_windows,
    read_switch_times,
)
from d2rpick.choice.switched.switched_run import (
    detect_rigid_parts,
    prepare_switched_history,
)
from d2rpick.histories.history import History, Samples, Track
from d2rpick.histories.listings import find_listing_with_error
from d2rpick.histories.opening import OpenedRun, Selection, open_run
from tests.command import (
    BOX,
    ENERGY,
    ROLLOVER,
    ROOT,
    join_wrapped_lines,
    make_replay_file as motion,
    put,
    read_refusal,
    run,
    run_json,
)
from tests.computed import locate_results, locate_stored
from tests.energies import require
from tests.json_schemas import check_by_schema, run_json_checked
from tests.reading import read, read_solved

TR, TD = 0.0135867, 0.0687534
VERIFY = ("verify", "--no-verify", "--tr", "0.1", "--td", "0.37", "--part", "box")
LEGS = locate_stored("rollover_r100_T0*.gz")

RIGHT = ("--part", "box", BOX, "--switched", LEGS)
AT_20 = (
    "--energy",
    "boxIE_J",
    ROLLOVER,
    "--switched",
    locate_stored("rollover_r20.csv.gz"),
)
SWITCHES = ("--tr", str(TR), "--td", str(TD))
TIME: Samples = np.linspace(0.0, 1.0, 101)
NONE = (None, None)
LONG: Samples = np.linspace(0.0, 1.0, 1001)
CAR_TR, CAR_TD = 0.0496, 0.1464


def scan(run_name: str) -> dict[str, float]:
    """Return a row of the table with the results of the solver's switched runs."""
    table = np.genfromtxt(
        locate_results("rollover_scan.csv"),
        delimiter=",",
        names=True,
        dtype=None,
        encoding="utf-8",  # older numpy returns bytes and warns
    )
    assert table.dtype.names
    (row,) = table[table["run"].astype(str) == run_name]
    return {name: float(row[name]) for name in table.dtype.names[1:]}


def verify_rollover(*options: str) -> dict[str, Any]:
    """Return the answer of verify for the rollover switched at 100 ms; a glob names its three restart segments."""
    return run_json(*VERIFY, BOX, "--switched", LEGS, *options)


# A rollover computed by a solver whose rigid parts report neither kinetic energy nor momentum.


def test_a_switched_rollover_flies_as_its_reference_with_less_vibration() -> None:
    verdict, expected = verify_rollover(), scan("r100")
    check_by_schema(verdict)
    switched = verdict["switched"]
    assert [name[-6:] for name in switched["source"]] == ["T01.gz", "T02.gz", "T03.gz"]
    assert switched["energy_frozen"] == pytest.approx(expected["IEfrozen_J"], rel=1e-5)
    # Interpolated between every tenth state; between all states it is 1.7492.
    assert switched["energy_td"] == pytest.approx(1.7515, abs=1e-4)
    assert switched["level_ratio"] == switched["energy_frozen"] / switched["energy_td"]
    # The means in the table extend to 380 ms and use every tenth state; the contact occurs at 381.9 ms.
    assert switched["mean_after"] == pytest.approx(
        expected["IEmean_td_to_380ms_J"], rel=0.01
    )
    assert switched["mean_after_reference"] == pytest.approx(
        expected["IEmean_ref_J"], rel=0.06
    )
    assert switched["spread_after"] < switched["spread_after_reference"]
    assert switched["end"] == pytest.approx(0.3819, abs=5e-4)  # one state each 0.5 ms
    assert switched["momentum_error"] < 1e-6
    # Distance of the centre at td [mm]; the largest distance afterwards is no smaller.
    at_td = np.hypot(expected["dx_td_mm"], expected["dz_td_mm"]) / 1e3
    assert switched["displacement"] == pytest.approx(at_td, rel=0.15)
    assert switched["notes"] == []


def test_a_mean_energy_that_is_another_one_is_an_objection() -> None:
    verdict, expected = verify_rollover(), scan("r100")
    share = (
        verdict["switched"]["mean_after"] / verdict["switched"]["mean_after_reference"]
    )
    assert share == pytest.approx(
        expected["IEmean_td_to_380ms_J"] / expected["IEmean_ref_J"], rel=0.06
    )
    assert share < 0.7
    assert not verdict["verified"]
    (reason,) = verdict["switched"]["objections"]
    assert (
        f"{share:.0%} of that of the reference run, but 70% to 130% were expected"
        in reason
    )
    assert verify_rollover("--min-mean-energy", "0.6")["verified"]


@pytest.mark.parametrize("grade", ["poor", "fair"])
def test_a_failed_comparison_is_a_failure_whatever_grade_is_accepted(
    grade: str,
) -> None:
    accepting = (*VERIFY, BOX, "--switched", LEGS, "--min-quality", grade)
    failed = run(*accepting)
    assert failed.exit_code == 1
    assert "comparison failed" in join_wrapped_lines(failed.stdout)
    assert failed.stderr.count("exit code") == 1
    assert "the comparison with the switched run failed" in failed.stderr
    assert run(*accepting, "--exit-zero").exit_code == 0
    assert run(*accepting, "--min-mean-energy", "0.6").exit_code == 0


def test_the_times_are_read_off_the_switched_run() -> None:
    """Its states are 0.5 ms apart. The option must not take the following history argument as its value."""
    verdict = run_json("verify", "--part", "box", "--switched", LEGS, BOX)
    assert (verdict["tr"], verdict["td"]) == (
        pytest.approx(0.1, abs=5e-4),
        pytest.approx(0.37, abs=5e-4),
    )
    assert verdict["history"]["source"] == [BOX]
    verified_at = run_json(
        "verify", "--td", "0.37", "--part", "box", "--switched", LEGS, BOX
    )
    assert (verified_at["tr"], verified_at["td"]) == (verdict["tr"], 0.37)
    assert (
        "both runs have the same energies, so it may be the reference run again; "
        "give the run with the switching cards, or --tr and --td"
        in read_refusal("verify", "--part", "box", "--switched", BOX, BOX)
    )
    assert (
        "missing: --td T (or --switched FILE, a finished switched run)"
        in run("verify", "--tr", "0.1", "--part", "box", BOX).stderr
    )


def read_times(switched: History, reference: History) -> Times:
    """Return tr and td of a switched run of which only the energy is known."""
    read = Reference(OpenedRun((), ()), switched)
    windows = find_switched_windows(read, reference)
    return read_switch_times(read, reference, windows, None, None)


def test_a_run_without_rigid_times_is_refused_with_the_cause() -> None:
    swinging = make_history(2.0 + np.sin(40 * TIME) ** 2)
    other = make_history(2.0 + np.sin(41 * TIME) ** 2)
    constant = make_history(np.full_like(TIME, 2.0))
    with pytest.raises(RangeError, match="never stays constant"):
        read_times(other, swinging)
    with pytest.raises(RangeError, match="from 0 to 1, but that of the reference run"):
        read_times(constant, make_history(np.full_like(TIME, 3.0)))
    with pytest.raises(RangeError, match="the same energies"):
        read_times(swinging, make_history(swinging.energy))


def test_round_off_in_a_fall_counts_as_constant() -> None:
    """Before the landing, both runs contain only round-off, which differs from state to state."""
    landed = np.where(TIME > 0.705, np.sin(40 * TIME) ** 2, 0.0)
    noise = 1e-12 * np.random.default_rng(1).random((2, TIME.size))
    falling, rigid = (make_history(landed + values) for values in noise)
    with pytest.raises(RangeError, match=r"from 0 to 0\.7, but that of the reference"):
        read_times(rigid, falling)


def test_a_leg_in_which_nothing_stands_still_names_those_beside_it(
    tmp_path: Path,
) -> None:
    first, later = tmp_path / "runT01.gz", tmp_path / "runT02.gz"
    first.write_bytes(Path(BOX).read_bytes())
    later.touch()
    result = run("verify", "--part", "box", "--switched", str(first), BOX).stderr
    assert (
        f"in the same folder is {later}, a later restart segment of the run? Name it too"
        in result
    )


@pytest.mark.slow
def test_of_a_fall_the_times_are_not_guessed_and_given_ones_verify(
    tmp_path: Path,
) -> None:
    """Nothing vibrates before the landing, so the energies of both runs are round-off until then."""
    box = ("rollover", "--drop", "0.1", "--mesh", "4", "--t-end", "0.18")
    names = [str(tmp_path / f"{name}.matsum") for name in ("reference", "switched")]
    for name, switches in zip(names, ((), ("--tr", "0", "--td", "0.13")), strict=True):
        assert run(*box, *switches, "-o", name).exit_code == 0
    arguments = ("verify", "--part", "box", names[0], "--switched", names[1])
    refusal = run(*arguments).stderr
    assert "the energy stays constant from 0 to" in refusal
    assert (
        "but that of the reference run does too, so it does not show when the parts were rigid; give --tr and --td"
        in refusal
    )
    assert run_json(*arguments, "--tr", "0", "--td", "0.13")["verified"] is True


def test_the_table_sets_the_switched_run_beside_the_reference() -> None:
    result = run(*VERIFY, BOX, "--switched", LEGS)
    lines = [line.split() for line in result.stdout.splitlines()]
    assert ["energy", "right", "after", "td", "1.45057", "1.75145"] in lines
    assert ["largest", "displacement", "after", "td", "0.000134"] in lines
    assert result.exit_code == 1


@pytest.mark.parametrize(
    ("tr", "td", "runs", "message"),
    [
        (
            "0.2",
            "0.37",
            RIGHT,
            "is constant from 0.1 to 0.370008, not from tr 0.2",
        ),
        ("0.1", "0.36", RIGHT, "not from tr 0.1 to td 0.36"),
        ("0.18", "0.37", RIGHT, "is not the energy of the reference run at tr 0.18"),
        (
            "0.1",
            "0.37",
            (*RIGHT[:-1], BOX),
            "is not constant from",
        ),  # this run was never rigid
        ("0.02", "0.37", AT_20, "the frozen energy, 11.1"),
    ],
)
def test_a_run_that_was_not_switched_so_is_an_objection(
    tr: str, td: str, runs: tuple[str, ...], message: str
) -> None:
    verdict = run_json("verify", "--no-verify", "--tr", tr, "--td", td, *runs)
    assert verdict["verified"] is False
    assert any(message in reason for reason in verdict["reasons"])


def test_csv_has_the_objections_as_one_text() -> None:
    arguments = ("verify", "--no-verify", "--tr", "0.02", "--td", "0.37", *AT_20)
    (row,) = DictReader(StringIO(run(*arguments, "-f", "csv").stdout))
    assert (
        row["switched_objections"]
        == "; ".join(run_json(*arguments)["switched"]["objections"])
        != ""
    )


def test_the_option_is_repeated_for_further_files_of_the_switched_run() -> None:
    spread = [LEGS.replace("*", leg) for leg in "123"]
    document = run_json(
        *VERIFY, BOX, *(text for leg in spread for text in ("--switched", leg))
    )
    assert document["switched"]["source"] == spread
    assert document["history"]["source"] == [BOX]


# The floating oscillator of the paper, computed by a solver and written as tables without momentum.


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
    reference, switched_name = (
        locate_stored(f"oscillator_{which}.csv.gz") for which in ("ref", f"d2r_{name}")
    )
    document = run_json_checked(
        *("verify", "--tr", str(tr), "--td", str(td), "--energy", "IE_J"),
        reference,
        "--switched",
        switched_name,
    )
    switched = document["switched"]
    assert switched["energy_frozen"] == pytest.approx(frozen, rel=1e-9)
    assert (switched["momentum_error"], switched["displacement"]) == (None, None)
    means = []
    for path in (switched_name, reference):
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


# The closed form of the oscillator, written in the format of a solver.


@pytest.fixture
def replayed(tmp_path: Path) -> Callable[..., str]:
    """Return a function that writes a replay as a matsum, with options and with a change of its text."""

    def write(
        name: str, *options: str, change: Callable[[str], str] = str, v0: str = "6"
    ) -> str:
        file = put(
            tmp_path / f"{name}.matsum",
            change(motion("matsum", *options, v0=v0).decode()),
        )
        return str(file)

    return write


def replace_while_rigid(text: str, pattern: str, number: float) -> str:
    """Write ``number`` in place of each match in the states between the switches."""
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


def verify_switched(reference: str, switched: str, *options: str) -> dict[str, Any]:
    return run_json_checked(
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
    comparison = verify_switched(
        replayed("reference"), replayed("switched", *SWITCHES), "--part", "spring"
    )
    switched = comparison["switched"]
    assert comparison["flight"]["source"] == "momentum"
    assert switched["level_ratio"] == pytest.approx(1, abs=1e-3)
    assert switched["mean_after"] == pytest.approx(
        switched["mean_after_reference"], rel=1e-3
    )
    assert switched["spread_after"] == pytest.approx(
        switched["spread_after_reference"], rel=1e-3
    )
    assert switched["momentum_error"] < 5e-4
    assert (switched["displacement"], switched["notes"]) == (None, [])
    assert comparison["verified"]


@pytest.mark.slow
def test_another_motion_of_the_switched_run_is_an_objection(
    replayed: Callable[..., str],
) -> None:
    reference, slower = replayed("reference"), replayed("slower", *SWITCHES, v0="5")
    args = ("verify", *SWITCHES, reference, "--switched", slower)
    assert run(*args).exit_code == 1
    assert run(*args, "--exit-zero").exit_code == 0
    comparison = verify_switched(reference, slower)
    assert not comparison["verified"]
    assert comparison["tr_ok"]
    assert any("so it moves differently" in reason for reason in comparison["reasons"])
    text = " ".join(run(*args).stdout.split())
    assert text.startswith(
        "comparison failed: mean energy after td 69% of the reference run (limits 70% to 130%)"
    )
    verdict, why = text.split(f" do not use tr = {TR}, td = {TD} ")
    assert "(limits 70% to 130%)" in verdict
    assert "from that of the reference run, so it moves differently" in why
    cure = "give the switched run of this model, with the same loads and velocities"
    assert f"to improve {cure}" in why


def test_rigid_parts_that_report_no_motion_are_no_finding(
    replayed: Callable[..., str],
) -> None:
    silent = replayed(
        "silent",
        *SWITCHES,
        change=lambda text: replace_while_rigid(text, "(?:z-mom|kinen)", 0.0),
    )
    comparison = verify_switched(replayed("reference"), silent)
    assert (comparison["verified"], comparison["switched"]["notes"]) == (True, [])
    assert comparison["switched"]["momentum_error"] < 5e-4


@pytest.mark.slow
def test_a_wrong_energy_while_rigid_is_a_note_and_not_what_came_back(
    replayed: Callable[..., str],
) -> None:
    right_run = replayed("right", *SWITCHES)
    wrong_run = replayed(
        "wrong", *SWITCHES, change=lambda text: replace_while_rigid(text, "inten", 55.5)
    )
    reference = replayed("reference")
    comparison, expected = (
        verify_switched(reference, which, "--part", "3")
        for which in (wrong_run, right_run)
    )
    assert comparison["switched"]["energy_frozen"] == pytest.approx(
        expected["switched"]["energy_frozen"], rel=2e-3
    )
    (note,) = comparison["switched"]["notes"]
    assert "reports an energy of 55.5 while the parts are rigid" in note
    assert comparison["verified"]
    result = run(
        "verify", *SWITCHES, "--part", "3", reference, "--switched", wrong_run
    ).stdout
    assert f"note: {note}" in " ".join(result.split())


def test_what_a_reader_has_to_say_of_the_switched_run_is_not_lost(
    replayed: Callable[..., str],
) -> None:
    cut = replayed("cut", *SWITCHES, change=lambda text: text[:-200])
    comparison = verify_switched(replayed("reference"), cut, "--part", "3")
    assert any("ends within" in note for note in comparison["switched"]["notes"])
    assert comparison["history"]["notes"] == []


@pytest.mark.slow
def test_csv_and_markdown_hold_the_comparison_too(replayed: Callable[..., str]) -> None:
    args = (
        "verify",
        *SWITCHES,
        replayed("reference"),
        "--switched",
        replayed("switched", *SWITCHES),
    )
    switched = run_json(*args)["switched"]
    (cells,) = DictReader(StringIO(run(*args, "-f", "csv").stdout))
    assert float(cells["switched_energy_frozen"]) == switched["energy_frozen"]
    assert cells["switched_displacement"] == ""
    assert float(cells["switched_mean_after"]) == switched["mean_after"]
    means = f"{switched['mean_after']:.6g} | {switched['mean_after_reference']:.6g}"
    markdown = run(*args, "-f", "markdown").stdout
    assert "|  | switched | reference |" in markdown
    assert f"| mean energy after td | {means} |" in markdown
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
    message = read_refusal(
        "verify",
        *SWITCHES,
        "--part",
        "3",
        replayed("reference"),
        "--switched",
        str(bad),
    )
    assert "bad.csv" in message
    assert says in message or "no parts" in message


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
    comparison = verify_switched(replayed("reference"), switched, "--part", "3")
    assert comparison["switched"]["momentum_error"] is None
    assert comparison["verified"]


# A switched run that ended early.

ERRORS = {
    "d3hsp": "\n E r r o r   t e r m i n a t i o n                 01/01/2026\n",
    "messag": "\n E r r o r   t e r m i n a t i o n\n",
}
NORMAL = "\n N o r m a l    t e r m i n a t i o n                 01/01/2026\n"


def cut_after(end: float) -> Callable[[str], str]:
    """Return a function that removes the states of a matsum after a time."""

    def cut(text: str) -> str:
        head, *states = text.split("\n time =")
        kept = [state for state in states if float(state.split()[0]) <= end]
        return "\n time =".join([head, *kept])

    return cut


def verify_cut_run(
    replayed: Callable[..., str], end: float, *options: str
) -> tuple[int, str, str]:
    """Return the exit code, the answer and the messages for a switched run that ends at a time."""
    reference = replayed("reference")
    switched = replayed("switched", *SWITCHES, change=cut_after(end))
    arguments = ("--part", "3", reference, "--switched", switched, *options)
    answer = run("verify", *arguments)
    return answer.exit_code, answer.stdout, answer.stderr


def test_a_switched_run_that_ended_before_the_contact_does_not_pass(
    replayed: Callable[..., str],
) -> None:
    """Before, the comparison of what there was passed, with exit code 0."""
    for options, name in (
        ((), "the end of the reference run at 0.15"),
        (("--landing", "0.12"), "the next contact at 0.12"),
    ):
        code, answer, messages = verify_cut_run(replayed, 0.1, *options)
        ended = f"the switched run ended at 0.1, before {name}"
        assert code == 1
        assert f"warning: switched-run-ended: {ended}" in join_wrapped_lines(messages)
        assert "the comparison with the switched run is incomplete" in messages
        assert "incomplete for the reason below; within limits so far" in answer
        assert "finish the switched run" in answer
        assert "passed" not in answer
        failed = verify_switched(
            replayed("reference"),
            replayed("switched", *SWITCHES, change=cut_after(0.1)),
            *("--part", "3", *options),
        )
        assert failed["switched"]["objections"] == [ended]
        assert failed["verified"] is False


def test_a_switched_run_that_ended_after_the_contact_passes(
    replayed: Callable[..., str],
) -> None:
    code, answer, _ = verify_cut_run(replayed, 0.1, "--landing", "0.09")
    assert code == 0
    assert "passed" in answer


@pytest.mark.parametrize("listing", ERRORS)
def test_a_switched_run_that_ended_with_an_error_does_not_pass(
    listing: str, tmp_path: Path, replayed: Callable[..., str]
) -> None:
    (tmp_path / listing).write_text(NORMAL)
    assert verify_cut_run(replayed, 0.15)[0] == 0
    (tmp_path / listing).write_text(ERRORS[listing])
    for end in (0.1, 0.15):
        code, answer, messages = verify_cut_run(replayed, end)
        assert code == 1
        assert f"the switched run ended with an error at {end:g}" in answer
        assert f"{tmp_path / listing}" in join_wrapped_lines(messages)


def test_the_listing_of_radioss_shows_that_a_switched_run_ended_with_an_error(
    tmp_path: Path,
) -> None:
    histories = [str(tmp_path / f"runT{leg:02d}") for leg in (1, 2, 3)]
    (tmp_path / "run_0001.out").write_text("     ERROR TERMINATION\n")
    (tmp_path / "run_0003.out").write_text("     NORMAL TERMINATION\n")
    # The first engine run was repeated from its last restart file.
    assert find_listing_with_error(histories) is None
    listing = put(tmp_path / "run_0003.out", "     ERROR TERMINATION\n")
    for names in (histories, [f"{name}.gz" for name in histories]):
        assert find_listing_with_error(names) == str(listing)


# The comparison itself.


def make_history(energy: Samples, time: Samples = TIME, name: str = "run") -> History:
    return History(time, energy, source=(name,), format="csv", channel="E")


def compare_momenta(
    momenta: tuple[Track | None, Track | None], td: float = 0.5
) -> Comparison:
    """Compare two runs of the same energy by their momenta."""
    return compare_runs(
        make_history(1 + TIME),
        make_history(1 + TIME),
        (0.1, td),
        np.inf,
        0.2,
        momenta,
        NONE,
    )


def track(values: Samples) -> Track:
    return Track(TIME, np.stack([values, 0 * TIME, 0 * TIME], axis=1))


@pytest.mark.parametrize("share", [0.0, 0.04, 0.06, 2.0])
def test_the_momentum_error_is_relative_to_the_largest_momentum_of_the_reference_after_td(
    share: float,
) -> None:
    reference = track(np.where(TIME < 0.3, 20.0, 10.0))
    comparison = compare_momenta(
        (reference, track(reference.values[:, 0] + 10 * share * TIME))
    )
    assert comparison.momentum_error == pytest.approx(share)
    assert any("momentum" in objection for objection in comparison.objections) == (
        share > MOST_MOMENTUM_ERROR
    )


def test_what_has_come_to_rest_is_not_off_by_its_noise() -> None:
    reference = track(np.where(TIME < 0.3, 20.0, 1e-9))
    comparison = compare_momenta((reference, track(3 * reference.values[:, 0])))
    assert not any("momentum" in objection for objection in comparison.objections)


@pytest.mark.parametrize(
    ("momenta", "error"),
    [
        # states before td, and the first state at td, are not compared
        ((track(0 * TIME + 10), track(np.where(TIME <= 0.5, 0.0, 10.0))), 0),
        (NONE, None), ((track(TIME), None), None), ((None, track(TIME)), None),
        ((track(0 * TIME), track(TIME)), None),
    ],
)  # fmt: skip
def test_a_momentum_that_is_right_or_that_one_run_does_not_have_is_no_error(
    momenta: tuple[Track | None, Track | None], error: float | None
) -> None:
    comparison = compare_momenta(momenta)
    assert comparison.momentum_error == error
    assert not any("momentum" in objection for objection in comparison.objections)


def test_displacement_is_the_largest_distance_of_the_centres() -> None:
    centres = np.stack([TIME, TIME**2, 0 * TIME], axis=1)
    moved = centres + np.outer(TIME, [0.03, 0.0, 0.04])
    comparison = compare_runs(
        make_history(1 + TIME),
        make_history(1 + TIME),
        (0.1, 0.5),
        0.8,
        0.2,
        NONE,
        (Track(TIME, centres), Track(TIME, moved)),
    )
    assert comparison.displacement == pytest.approx(0.8 * 0.05)


def test_a_reference_without_energy_at_td_has_no_ratio() -> None:
    assert (
        compare_runs(
            make_history(0 * TIME),
            make_history(1 + TIME),
            (0.1, 0.5),
            1.0,
            0.2,
            NONE,
            NONE,
        ).level_ratio
        is None
    )


def make_crushed_energy(vibration: float) -> Samples:
    """Return the mostly plastic energy of a crushed body that vibrates in flight."""
    return np.asarray(29000 + vibration * np.sin(20 * LONG))


@pytest.mark.parametrize("vibration", [3.0, 300.0, 20000.0])
def test_a_right_switched_run_of_a_crushed_body_was_rigid_from_tr_to_td(
    vibration: float,
) -> None:
    """A threshold of 1e-4 of the plastic energy would call a vibration of 3 rigid throughout."""
    energy = make_crushed_energy(vibration)
    frozen = np.interp(0.3, LONG, energy)
    energy_after = np.where(LONG > 0.8, energy[800] - frozen, 0)
    switched = np.where((LONG >= 0.3) & (LONG <= 0.8), frozen, energy - energy_after)
    comparison = compare_runs(
        make_history(energy, LONG),
        make_history(switched, LONG),
        (0.3, 0.8),
        np.inf,
        1.0,
        NONE,
        NONE,
    )
    assert comparison.rigid_from == pytest.approx(0.3, abs=2e-3)
    assert comparison.rigid_to == pytest.approx(0.8, abs=2e-3)
    assert comparison.objections == ()
    for pair in ((0.2, 0.8), (0.3, 0.9), (0.4, 0.8), (0.3, 0.7)):
        comparison = compare_runs(
            make_history(energy, LONG),
            make_history(switched, LONG),
            pair,
            np.inf,
            1.0,
            NONE,
            NONE,
        )
        assert any(
            "is constant from" in objection for objection in comparison.objections
        )
        assert comparison.is_of_other_times


def test_a_run_that_was_switched_at_other_times_leads_to_the_window_of_that_run() -> (
    None
):
    """Before, the next command was explore, which called the same pair "use"."""
    switched = ROOT / "sample_data" / "oscillator_switched"
    compared = ("--switched", str(switched), ENERGY)
    asked = run("verify", "--tr", "0.0135867", "--td", "0.0687534", *compared)
    text = join_wrapped_lines(asked.stdout)
    cure = "to improve leave out --tr and --td to compare the window in which the switched run was rigid"
    assert cure in text
    assert (
        f"compare the window of the switched run with d2rpick verify --switched {switched} {ENERGY}"
        in text
    )
    assert run("verify", *compared).stdout.startswith("comparison  passed")


def test_where_the_reference_stands_still_too_a_longer_stillness_is_no_objection() -> (
    None
):
    """A body that flies from the start and hardly vibrates, so that its energy does not show when it was switched."""
    energy = 5 + np.where(LONG > 0.9, LONG - 0.9, 0.0)
    comparison = compare_runs(
        make_history(energy, LONG),
        make_history(energy, LONG),
        (0.3, 0.8),
        0.89,
        1.0,
        NONE,
        NONE,
    )
    assert comparison.rigid_from == 0.0
    assert comparison.objections == ()


@pytest.mark.parametrize("short", ["reference", "switched"])
def test_a_run_that_ends_at_td_is_named(short: str) -> None:
    runs = {
        name: make_history(1 + TIME, name=name) for name in ("reference", "switched")
    }
    runs[short] = make_history(1 + TIME[:52], TIME[:52], short)
    with pytest.raises(
        RangeError, match=rf"^{short}: fewer than 3 states from td 0.5 to 0.51; "
    ):
        compare_runs(
            runs["reference"], runs["switched"], (0.1, 0.5), np.inf, 0.2, NONE, NONE
        )
    runs[short] = make_history(1 + TIME[:40], TIME[:40], short)
    with pytest.raises(
        RangeError,
        match=rf"^{short}: ends at 0.39, not after td 0.5; give the later restart segments",
    ):
        compare_runs(
            runs["reference"], runs["switched"], (0.1, 0.5), np.inf, 0.2, NONE, NONE
        )


def test_no_output_replaces_a_file_of_the_switched_run(tmp_path: Path) -> None:
    file, content_before = tmp_path / "switched.csv", motion("csv", *SWITCHES)
    file.write_bytes(content_before)
    arguments = (
        "verify",
        *SWITCHES,
        ENERGY,
        "--overwrite",
        "--switched",
        str(tmp_path / "*.csv"),
    )
    assert "this is an input" in run(*arguments, "-o", str(file)).stderr
    assert file.read_bytes() == content_before
    page = file.rename(tmp_path / "switched.html")
    refused = run(*arguments[:-1], str(tmp_path / "*.html"), "--report", str(page))
    assert "this is an input" in refused.stderr
    assert page.read_bytes() == content_before


def list_legs(run: str) -> list[str]:
    """Return the restart segments of a run; up to tr, all runs share them."""
    return [
        locate_stored(name)
        for name in ("car_all_T01.gz", f"{run}_T02.gz", f"{run}_T03.gz")
    ]


def compare_car(run: str, *parts: str) -> PairVerdict:
    """Return the verdict on the car with engine, battery and wheels as six rigid bodies, or as one."""
    solved_run = read_solved("carT01.gz", *parts)
    verdict = verify_run(solved_run, CAR_TR, CAR_TD, Settings())
    switched = solved_run.like(
        open_run(list_legs(run), Selection()), Selection(parts=parts)
    )
    windows = find_switched_windows(switched, solved_run.history)
    return add_comparison(verdict, solved_run, switched, windows)


def test_the_parts_that_were_rigid_are_recognised_in_several_bodies() -> None:
    heavy = open_run(list_legs("car_heavy"), Selection())
    rigid = require(
        detect_rigid_parts(heavy, heavy.parts[:17], heavy.part_time, CAR_TR, CAR_TD)
    )
    assert [
        part.title
        for part, part_rigid in zip(heavy.parts, rigid, strict=False)
        if part_rigid
    ] == ["engine", "battery", "wheels"]
    one_run = open_run(list_legs("car_all"), Selection())
    rigid = require(
        detect_rigid_parts(
            one_run, one_run.parts[:17], one_run.part_time, CAR_TR, CAR_TD
        )
    )
    assert rigid.all()
    assert (
        detect_rigid_parts(
            one_run, one_run.parts[:17], one_run.part_time, CAR_TR, CAR_TR + 5e-4
        )
        is None
    )  # too few states


def test_a_run_of_which_all_parts_were_rigid_is_judged_by_its_energy() -> None:
    """Computed: 0.947 of the mean energy of shells and beams until the landing (here all parts without springs)."""
    switched_run = require(compare_car("car_all", "1-17").switched)
    assert switched_run.objections == ()
    mean_after = require(switched_run.mean_after)
    assert mean_after / switched_run.mean_after_reference == pytest.approx(
        0.957, abs=0.005
    )


def test_parts_that_were_not_rigid_are_named() -> None:
    switched_run = require(compare_car("car_heavy", "11,12").switched)
    assert (
        "not rigid from tr 0.0496 to td 0.1464 in the switched run: bows"
        in switched_run.objections
    )


def test_energies_that_are_reported_wrongly_do_not_enter_the_comparison() -> None:
    """The battery reports 70 400 J instead of 21 J; shells and beams keep 1.019 of their mean energy."""
    switched_run = require(compare_car("car_heavy", "1-17").switched)
    mean_after = require(switched_run.mean_after)
    assert mean_after / switched_run.mean_after_reference == pytest.approx(
        1.019, abs=0.002
    )
    assert any(
        note.startswith("left out of the comparison: engine, battery, wheels,")
        for note in switched_run.notes
    )


@pytest.mark.slow
@pytest.mark.parametrize("parts", [("12-14",), ()])
def test_where_all_energies_are_reported_wrongly_only_the_motion_is_judged(
    parts: tuple[str, ...],
) -> None:
    switched_run = require(compare_car("car_heavy", *parts).switched)
    assert switched_run.misreported == ("engine", "battery", "wheels")
    assert switched_run.objections == ()
    assert not switched_run.has_energy
    wrong = ("energy_frozen", "level_ratio", "mean_after", "spread_after")
    assert [getattr(switched_run, name) for name in wrong] == [None] * len(wrong)
    assert require(switched_run.momentum_error) < 1e-5
    assert (parts == ()) == (
        "judged by the parts that were rigid: engine, battery, wheels"
        in switched_run.notes
    )


def test_plans_go_on_from_a_run_of_which_some_parts_were_rigid() -> None:
    heavy = read(list_legs("car_heavy"), Selection(parts=("11-14",)))
    history, windows, cautions = prepare_switched_history(heavy, [(CAR_TR, CAR_TD)])
    assert windows == ((CAR_TR, CAR_TD),)
    (message,) = cautions
    assert message.code == "partly-rigid"
    assert "these parts deform: bows;" in message.message
    assert not [
        momenta_of_run
        for momenta_of_run in history.momenta
        if momenta_of_run.parts is not None
    ]
    assert not prepare_switched_history(
        read(list_legs("car_heavy"), Selection(parts=("12-14",))), [(CAR_TR, CAR_TD)]
    )[2]
