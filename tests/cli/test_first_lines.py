"""The first lines of the output say what to decide, and on which limit the decision is based."""

import gzip
from dataclasses import replace
from pathlib import Path

import pytest

import d2rpick
from d2rpick.choice.options import Limit
from d2rpick.choice.switched.same_model import MOST_MOMENTUM_ERROR
from d2rpick.report.formats import DisplayOptions
from tests.command import MATSUM, ROOT, put, run, run_json

SAMPLES = ROOT / "sample_data"
T01 = str(SAMPLES / "rolloverT01.gz")
SWITCHED = (
    "verify",
    "--no-deck",
    "--switched",
    str(SAMPLES / "oscillator_switched"),
    str(SAMPLES / "oscillator"),
)


def join_lines(text: str) -> str:
    return " ".join(text.split())


def test_a_switched_run_passes_or_fails_with_its_limits_first() -> None:
    result = run(*SWITCHED)
    measures = run_json(*SWITCHED)["switched"]
    ratio = measures["mean_after"] / measures["mean_after_reference"]
    assert measures["objections"] == []
    assert result.exit_code == 0
    assert join_lines(result.stdout).startswith(
        f"comparison passed: mean energy after td {ratio:.0%} of the reference run (limits 70% to 130%), "
        f"momentum error after td {measures['momentum_error']:.2%} (limit {MOST_MOMENTUM_ERROR:.0%}) use "
    )


def test_a_switched_run_fails_by_the_limit_that_was_given() -> None:
    result = run(*SWITCHED[:2], "--min-mean-energy", "0.99", *SWITCHED[2:])
    assert result.exit_code == 1
    text = join_lines(result.stdout)
    assert text.startswith("comparison failed: mean energy after td 108% of the")
    assert "(limits 99% to 101%)" in text
    assert "do not use" in text


def test_parts_without_a_deck_are_unknown_and_the_deck_is_the_cure() -> None:
    lines = run("parts", T01).stdout.splitlines()
    assert (
        lines[0]
        == "make rigid  unknown: without the deck of the run no part can be judged"
    )
    assert lines[1] == "to improve  give the main deck with --deck"


def test_a_run_without_an_energy_balance_has_an_unknown_health() -> None:
    text = join_lines(run("info", MATSUM).stdout)
    assert text.startswith(
        "record suitable for choosing times: it contains flights (d2rpick plan judges the windows in them) "
        "why 1 free flight"
    )
    assert "the health of the run is unknown" in text


@pytest.mark.slow
def test_the_warning_about_few_states_says_which_line_the_verdict_rests_on() -> None:
    document = run_json("suggest", T01)
    (text,) = (
        warning["message"]
        for warning in document["warnings"]
        if warning["code"] == "coarse-record"
    )
    assert text.startswith(
        "the fastest line of the energy has 2 states per period, the fastest strong line "
    )
    assert "the verdict rests on the strong lines" in text


@pytest.mark.parametrize("value", [None, 0.7])
def test_the_limit_of_the_kinetic_fraction_uses_its_term(value: float | None) -> None:
    assert Limit("kinetic_share").explain(value, 0.5).startswith("kinetic fraction ")


def test_parts_begin_with_the_verdict_of_the_pair_that_plan_chooses() -> None:
    deck = ("--deck", str(SAMPLES / "rollover_box.k"))
    document = run_json("parts", *deck, MATSUM)
    (best,) = (answer for answer in document["sets"] if answer["recommended"])
    chosen = ",".join(map(str, best["parts"]))
    (planned,) = run_json("plan", *deck, "--part", chosen, MATSUM)["windows"]
    for key in ("verdict", "verdict_reason", "cure"):
        assert best[key] == planned[key]
    text = join_lines(run("parts", *deck, MATSUM).stdout)
    assert text.startswith(
        f"{best['verdict']} make rigid --part {chosen}, all eligible parts (one rigid body); "
        f"tr = {best['tr']:.6g}, td = {best['td']:.6g} why {best['verdict_reason']} to improve "
    )
    assert (
        "* the recommended set and its parts (d2rpick plan --part recommended)" in text
    )


@pytest.mark.parametrize(
    ("options", "cell"), [((), "next run"), (("--min-rigid", "0.3"), "no run")]
)
def test_a_plan_says_in_which_run_a_window_can_be_used(
    options: tuple[str, ...], cell: str
) -> None:
    lines = run("plan", *options, "-q", MATSUM).stdout.splitlines()
    head = next(
        at for at, line in enumerate(lines) if "flight" in line and "switch in" in line
    )
    assert lines[head].split()[-2:] == ["switch", "in"]
    assert lines[head + 1].endswith(cell)


def test_limits_that_are_kept_do_not_praise_a_pair_that_is_not_to_be_used() -> None:
    result = run(*SWITCHED[:2], "--max-residual", "0.01", *SWITCHED[2:])
    assert result.exit_code == 1
    text = join_lines(result.stdout)
    assert "passed" not in text
    compared, decided = text.split(" do not use tr = ")
    assert "why residual 0.0386 above the limit 0.01" in decided
    assert "next use at most the motion of this switched run, up to the next" in decided
    assert compared.startswith(
        "comparison within limits, although the pair was poor: mean energy after td 108% of the"
    )
    assert (
        "exit code 1: the comparison is within its limits, but the verdict is 'do not use'"
        in result.stderr
    )
    assert (
        "this does not show that the vibration is kept: standard deviation of the energy after td 2.12, in the "
        "reference run 2.08" in compared
    )


@pytest.mark.parametrize(
    ("ratio", "usable"),
    [(0.2, "only the motion"), (1, "the results"), (12, "only the motion")],
)
def test_a_switched_run_that_vibrates_differently_is_used_for_the_motion_only(
    ratio: float, usable: str
) -> None:
    reference = d2rpick.read(SAMPLES / "oscillator")
    computed = d2rpick.read(SAMPLES / "oscillator_switched")
    answer = d2rpick.verify(reference, switched=computed)
    switched = answer.switched
    assert switched
    spread = ratio * switched.spread_after_reference
    differing = replace(answer, switched=switched._replace(spread_after=spread))
    text = join_lines(differing.text("table", DisplayOptions()))
    assert f"use {usable} of the switched run" in text
    is_named = f"standard deviation of the energy after td {spread:.3g}, in" in text
    assert is_named is (ratio != 1)


@pytest.mark.parametrize(("grade", "care"), [("good", ""), ("fair", " with care")])
def test_the_next_step_does_not_allow_more_than_the_verdict(
    grade: str, care: str
) -> None:
    """A pair to use with care because of its motion is not a pair whose vibration alone is wrong."""
    reference = d2rpick.read(SAMPLES / "oscillator")
    computed = d2rpick.read(SAMPLES / "oscillator_switched")
    answer = d2rpick.verify(reference, switched=computed)
    quality = answer.decision.quality
    motion = quality.motion._replace(grade=grade)
    decision = answer.decision._replace(
        grade=grade, quality=quality._replace(motion=motion)
    )
    vars(answer)["decision"] = decision
    text = join_lines(answer.text("table", DisplayOptions()))
    assert f"use{care} tr = " in text
    assert f"next use the results of the switched run{care}; " in text


def test_the_accuracy_of_a_tr_that_is_read_is_that_of_the_switched_run() -> None:
    """The reference run determines its level far more accurately than the switched run shows when it was switched."""
    reference = d2rpick.read(SAMPLES / "oscillator")
    computed = d2rpick.read(SAMPLES / "oscillator_switched")
    read = d2rpick.verify(reference, switched=computed)
    text = join_lines(read.text("table", DisplayOptions()))
    interval = read.tr_interval
    assert interval == pytest.approx(5.3e-5, rel=0.02)
    assert (
        f"tr read from the switched run, to within one output interval, {interval:.2g}; timing tolerance ±"
        in text
    )
    given = d2rpick.verify(reference, read.tr, read.td, switched=computed)
    assert given.tr_interval is None
    assert "read from the switched run" not in given.text("table", DisplayOptions())


def cut_file(folder: Path, source: Path, size: int) -> str:
    """Write the first ``size`` bytes of a file, and return the path."""
    opened = gzip.open if source.suffix == ".gz" else open
    with opened(source, "rb") as file:
        return str(put(folder / source.stem, file.read(size)))


def test_a_window_of_a_cut_file_is_that_of_the_part_that_was_read(
    tmp_path: Path,
) -> None:
    cut = cut_file(tmp_path, SAMPLES / "energy.glstat", 100_000)
    plan = join_lines(run("plan", cut).stdout)
    assert plan.startswith("use: make the parts rigid from ")
    share, rest = plan.split("of the record that was read", 1)
    assert share.endswith("92% ")
    assert "note the record ends early, at 0.0316, within a state: " in rest
    assert "next copy the file again, or let the run finish. For the part " in rest
    times = ("--td", "0.031")
    judged = ("suggest", *times), ("verify", "--tr", "0.002", *times)
    for command in judged:
        text = join_lines(run(*command, cut).stdout)
        assert "the record ends early, at 0.0316, within a state" in text
        assert "next copy the file again" in text
        assert "of the simulated time" not in text


def test_no_flight_in_a_cut_file_is_a_reason_to_copy_it_again(tmp_path: Path) -> None:
    cut = cut_file(tmp_path, Path(T01), 60_000)
    for command in ("plan", "suggest", "explore", "info"):
        answer = run(command, cut)
        text = join_lines(answer.stdout + answer.stderr)
        assert "copy the file again, or let the run finish" in text
        assert "--after" not in text
        assert "has to write" not in text
        assert "without switching" not in text


@pytest.mark.slow
def test_a_switched_run_in_which_nothing_vibrated_passes(tmp_path: Path) -> None:
    """Round-off in the energies of a body that only falls does not show that it deformed while it was rigid."""
    reference, switched = (str(tmp_path / f"{name}.matsum") for name in "ab")
    fall = ("rollover", "--drop", "0.2", "--tilt", "25", "--mesh", "4")
    times = ("--tr", "0", "--td", "0.197104")
    run(*fall, "-o", reference)
    run(*fall, *times, "--with-step", "-o", switched)
    verify = ("verify", "--part", "flying", *times, "--switched", switched, reference)
    text = join_lines(run(*verify).stdout)
    assert text.startswith(
        "comparison passed: momentum error after td 0.00% (limit 5%); only the motion is compared, because nothing "
        "vibrates use tr = 0, td = 0.197104 "
    )
    assert run_json(*verify)["switched"]["level_ratio"] is None
