"""Comparison of many runs: spread, agreement, one tr for all or the reason against it, and outliers."""

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

from d2rpick.api.studies import find_runs
from d2rpick.choice.answers import suggest_in_history, verify_in_history
from d2rpick.choice.question import Settings
from d2rpick.choice.runs.study import (
    NONE,
    OK,
    UNREADABLE,
    Question,
    StudyRow,
    compare_rows,
    find_cut_runs,
    find_fewest_digits,
    find_outliers,
    find_repeated_runs,
    judge_run,
    make_failed_row,
    make_row,
)
from d2rpick.histories.opening import Selection
from d2rpick.report.formats import RepeatedQuestion
from d2rpick.report.study import (
    list_next_step,
    list_outcome,
    list_run_reasons,
    name_target_energy,
)
from tests import variants
from tests.command import BOX, ENERGY, GLSTAT, ROOT
from tests.computed import locate_stored
from tests.energies import make_energy_history, require
from tests.reading import read_history

ASKED = Question(variants.TD, Settings())


def make_study_row(
    source: str,
    *windows: tuple[float, float],
    tr: float = 2.0,
    width: float = 0.1,
    **other_fields: object,
) -> StudyRow:
    """Return a run with these windows of acceptable tr; its error falls linearly from 0 at 0 to 1 at td = 10."""
    acceptable = np.array(windows, float).reshape(-1, 2)
    study_row = StudyRow(
        source, OK, tr=tr, tr_low=tr - width, tr_high=tr + width, energy_td=1.0, residual=tr / 10, basis="oscillator",
        td=10.0, acceptable=acceptable, alike=acceptable, profile=np.array([[0.0, 10.0], [0.0, 1.0]]),
    )  # fmt: skip
    return replace(study_row, **other_fields)  # type: ignore[arg-type]


# One run.


def test_a_row_says_what_suggest_says(tmp_path: Path) -> None:
    name = variants.write(tmp_path / "run.csv")
    run_row = judge_run(ASKED, name)
    assert (run_row.status, run_row.message, run_row.basis, run_row.warnings) == (
        "ok",
        None,
        "oscillator",
        (),
    )
    assert run_row.tr == pytest.approx(0.0135866683619825, rel=1e-6)
    assert require(run_row.tr_low) < 0.0135866683619825 < (run_row.tr_high or 0)
    assert run_row.energy_td == pytest.approx(6.05508394485761, rel=1e-6)
    assert run_row.files == (
        (
            str(tmp_path / "run.csv"),
            Path(name).stat().st_size,
            Path(name).stat().st_mtime_ns,
        ),
    )


@pytest.mark.parametrize(
    ("content", "status", "message"),
    [
        (None, "unreadable", "no such file"),
        ("", "unreadable", "the file is empty"),
        ("time,energy\n0,1\n1,x\n2,3\n", "unreadable", ":3: "),
        ("time,energy\n0,1\n0.05,2\n0.06,3\n", "out-of-range", "outside the record"),
        ("time,energy\n0,1\n0.1,2\n", "out-of-range", "at least 3"),
        (
            "time,energy\n0,1\n0.05,2\n0.1,3\n0.2,4\n",
            "none",
            "neither reaches its value at td",
        ),
    ],
)
def test_what_is_wrong_with_a_run_is_said_in_its_row(
    tmp_path: Path, content: str | None, status: str, message: str
) -> None:
    file = tmp_path / "run.csv"
    if content is not None:
        file.write_text(content)
    run_row = judge_run(ASKED, str(file))
    assert (run_row.status, run_row.tr) == (status, None)
    assert message in (run_row.message or "")


def test_a_process_that_did_not_answer_is_a_row() -> None:
    failed_row = make_failed_row("run", MemoryError())
    assert (failed_row.source, failed_row.status) == ("run", "failed")
    assert (
        failed_row.message
        == "run: there is not enough memory; give it more, or name fewer files"
    )
    failed_row = make_failed_row("run", KeyError("time"))
    assert (failed_row.source, failed_row.status) == ("run", "internal-error")
    assert (
        failed_row.message == "run: internal error, please report it (KeyError: 'time')"
    )


def test_another_version_gives_no_answer() -> None:
    with pytest.raises(Exception, match=r"d2rpick 0\.0\.1 asks d2rpick"):
        judge_run(replace(ASKED, tool_version="0.0.1"), "run")


# Many runs.


def test_one_tr_for_all_verifies_in_each_run_and_so_do_the_ends_of_its_window(
    tmp_path: Path,
) -> None:
    names = variants.write_variants(tmp_path)
    answer = compare_rows(variants.TD, [judge_run(ASKED, name) for name in names])
    for name in names:
        for tr in (require(answer.common.tr), *require(answer.common.window)):
            assert verify_in_history(
                read_history([name]), tr, variants.TD, Settings()
            ).verified
    assert answer.spread is not None
    assert answer.spread.min < answer.spread.median < answer.spread.max
    assert answer.agree is False
    assert not answer.objection


@pytest.mark.slow
@pytest.mark.parametrize(
    ("energies", "basis"),
    [(("IE_spring1_J", "IE_spring2_J"), "modal"), (("IE_spring1_J",), "swings")],
)
@pytest.mark.parametrize(("td", "is_kept"), [(0.208, True), (0.238, False)])
def test_real_runs_share_a_tr_that_verifies_whatever_the_basis(
    energies: tuple[str, ...], basis: str, td: float, is_kept: bool
) -> None:
    """At the second td, every tr loses more than half of the vibration, so the right common tr is of no use."""
    name = locate_stored("chain_ref.csv.gz")
    question = Question(td, Settings(), Selection(energy=energies))
    run_row = judge_run(question, name)
    assert run_row.basis == basis
    answer = compare_rows(td, [run_row, run_row])
    history = read_history([name], question.selection)
    verdict = verify_in_history(history, require(answer.common.tr), td, Settings())
    assert verdict.admissible
    assert (require(run_row.residual) <= 0.5) is is_kept
    assert verdict.verified is is_kept


def test_the_same_run_twice_agrees_with_itself_and_a_single_run_too(
    tmp_path: Path,
) -> None:
    run_row = judge_run(ASKED, variants.write(tmp_path / "run.csv"))
    single_study, two = (
        compare_rows(variants.TD, [run_row]),
        compare_rows(variants.TD, [run_row, run_row]),
    )
    assert single_study.agree is two.agree is True
    assert (
        single_study.common._replace(errors=2 * single_study.common.errors)
        == two.common
    )
    assert single_study.common.tr == run_row.tr
    assert require(single_study.common.errors[0]) == pytest.approx(
        run_row.residual, abs=1e-3
    )


def test_a_run_given_twice_or_copied_is_called_a_repetition(tmp_path: Path) -> None:
    name = variants.write(tmp_path / "run.csv")
    copy = tmp_path / "copy.csv"
    copy.write_bytes(Path(name).read_bytes())
    link = tmp_path / "link.csv"
    link.symlink_to(name)
    for twin in (name, str(copy), str(link)):
        answer = compare_rows(
            variants.TD, [judge_run(ASKED, source) for source in (name, twin)]
        )
        (caution,) = (c for c in answer.cautions if c.code == "repeated-runs")
        assert "rests on 1 of 2 runs" in caution.message
        assert (
            "repeated",
            "1 run has the same content as another run",
        ) in list_outcome(answer)


def test_runs_with_other_content_are_no_repetitions(tmp_path: Path) -> None:
    """One digit that does not change the answer is enough to differ, even if the files have the same size."""
    name = variants.write(tmp_path / "run.csv")
    text = Path(name).read_text()
    other = tmp_path / "other.csv"
    other.write_text(text[:-2] + str((int(text[-2]) + 1) % 10) + text[-1:])
    assert other.stat().st_size == Path(name).stat().st_size
    answer = compare_rows(
        variants.TD, [judge_run(ASKED, source) for source in (name, str(other))]
    )
    assert not find_repeated_runs(answer.runs)
    assert "repeated-runs" not in {caution.code for caution in answer.cautions}
    # runs without files, such as those of a failed process, are not compared
    assert not find_repeated_runs([make_failed_row("a", OSError("x"))] * 2)


def test_a_poor_td_is_cured_by_the_pair_that_suggest_names() -> None:
    run_row = judge_run(replace(ASKED, td=0.064), ENERGY)
    decision = suggest_in_history(
        read_history([ENERGY], ASKED.selection), 0.064, Settings()
    ).decision
    assert run_row.verdict == "do not use"
    assert run_row.cure == require(decision).cure
    assert run_row.cure is not None
    assert run_row.cure.startswith("use tr = 0.0135867, td = 0.0687534")


def test_the_unit_of_energy_is_named_if_all_runs_name_it() -> None:
    table = str(ROOT / "sample_data/rollover_box_excel.csv")
    rows = [judge_run(replace(ASKED, td=370.0), table)]
    assert compare_rows(370.0, rows).energy_unit == "mJ"
    assert name_target_energy(compare_rows(370.0, rows)) == "E(td) [mJ]"
    rows.append(judge_run(ASKED, ENERGY))
    assert compare_rows(370.0, rows).energy_unit == ""
    assert name_target_energy(compare_rows(370.0, rows)) == "E(td)"


@given(st.lists(st.floats(1.95, 2.05), min_size=1, max_size=7))
def test_runs_that_agree_have_their_own_tr_in_common(times: list[float]) -> None:
    """No two times differ by more than their uncertainty."""
    rows = [make_study_row(str(i), (1, 3), tr=tr) for i, tr in enumerate(times)]
    common_tr = compare_rows(10.0, rows).common
    assert common_tr.tr == pytest.approx(float(np.median(times)))
    assert common_tr.keeps_tolerance
    without = replace(
        make_study_row("none", (1, 3)), status=NONE, tr=None, tr_low=None, tr_high=None
    )
    assert compare_rows(10.0, [*rows, without]).common.tr == 1.0


def test_a_run_that_was_cut_is_called_so(tmp_path: Path) -> None:
    whole = [variants.write(tmp_path / f"run{i}.csv") for i in range(3)]
    short, late = (
        variants.write(tmp_path / "short.csv", end=0.06),
        variants.write(tmp_path / "late.csv", end=0.1),
    )
    rows = [judge_run(ASKED, name) for name in (*whole, short, late)]
    assert [run_row.record_end for run_row in rows] == pytest.approx(
        [0.15] * 3 + [0.06, 0.1]
    )
    assert [run_row.status for run_row in rows] == [OK] * 3 + ["out-of-range", OK]
    messages = {
        caution.code: caution.message
        for caution in compare_rows(variants.TD, rows).cautions
    }
    ends = f"{short} (ends early, at 0.06), {late} (ends early, at 0.1)"
    assert (
        messages["cut-runs"]
        == f"2 of 5 runs were cut, or end earlier than the others: {ends}"
    )
    assert find_cut_runs([*rows[:3], replace(rows[0], warnings=("truncated-input",))])[
        0
    ].warnings == ("truncated-input",)
    assert "cut-runs" not in {
        caution.code for caution in compare_rows(variants.TD, rows[:3]).cautions
    }
    long = replace(rows[3], record_end=0.3)
    assert find_cut_runs([rows[0], long]) == []


@given(st.lists(st.tuples(st.floats(0, 1), st.floats(0, 0.3)), min_size=1, max_size=6))
def test_runs_agree_when_their_intervals_have_a_time_in_common(
    intervals: list[tuple[float, float]],
) -> None:
    rows = [
        make_study_row(str(i), (0, 3), tr=tr, width=width)
        for i, (tr, width) in enumerate(intervals)
    ]
    pairwise = all(abs(a - b) <= v + w for a, v in intervals for b, w in intervals)
    close = any(
        abs(abs(a - b) - v - w) < 1e-12
        for a, v in intervals
        for b, w in intervals
        if (a, v) != (b, w)
    )
    assert compare_rows(4.0, rows).agree == pairwise or close


def test_where_there_is_none_it_says_which_tr_suits_most_runs_and_which_it_does_not() -> (
    None
):
    rows = [
        make_study_row("a", (1, 2)),
        make_study_row("b", (1.5, 3)),
        make_study_row("c", (5, 6), (1.6, 1.7)),
        make_study_row("d", (8, 9)),
        make_study_row("e"),
    ]
    common_tr = compare_rows(10.0, rows).common
    assert (common_tr.tr, common_tr.window) == (None, None)
    assert (
        common_tr.reason
        == "no tr is admissible in all of 5 runs; tr = 1.6 is in 3, not in d, e: "
        "no tr at all is admissible in e"
    )
    assert (
        compare_rows(10.0, [make_study_row("e")]).common.reason
        == "no tr is admissible in the run that was judged"
    )
    assert (
        compare_rows(10.0, [make_failed_row("f", OSError())]).common.reason
        == "no run could be judged"
    )


def test_runs_that_were_not_judged_are_left_out_and_named() -> None:
    answer = compare_rows(
        10.0, [make_study_row("a", (1, 2)), make_failed_row("bad", OSError())]
    )
    assert answer.common.tr == 2.0
    assert list(answer.common.errors) == [pytest.approx(0.2), None]
    assert answer.objection
    (caution,) = answer.cautions
    assert (caution.code, "bad" in caution.message) == ("runs-left-out", True)


def make_equal_rows(
    *windows: tuple[float, float],
) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    return np.array(windows, float).reshape(-1, 2)


def test_the_common_tr_is_the_earliest_within_the_timing_tolerance_of_every_run() -> (
    None
):
    rows = [
        make_study_row("a", (1, 4), alike=make_equal_rows((1.2, 1.4), (1.5, 3))),
        make_study_row("b", (0, 6), tr=3.0, alike=make_equal_rows((1.45, 5))),
    ]
    common_tr = compare_rows(10.0, rows).common
    assert (common_tr.tr, common_tr.window, common_tr.keeps_tolerance) == (
        1.5,
        (1.0, 4.0),
        True,
    )
    assert common_tr.errors == pytest.approx([0.15] * 2)


def test_where_no_time_keeps_the_timing_tolerance_of_all_the_least_loss_counts_and_is_told() -> (
    None
):
    """One error falls from 0.2 to 0, the other grows from 0 to 0.2, so the larger one is smallest in the middle."""
    falling, growing = (
        np.array([[1.0, 3.0], [0.2, 0.0]]),
        np.array([[1.0, 3.0], [0.0, 0.2]]),
    )
    rows = [
        make_study_row(
            "a", (1, 3), tr=3.0, profile=falling, alike=make_equal_rows((2.5, 3))
        ),
        make_study_row(
            "b",
            (1, 3),
            tr=1.0,
            profile=np.insert(growing, 1, [2.0, 0.1], axis=1),
            alike=make_equal_rows((1, 1.5)),
        ),
    ]
    answer = compare_rows(10.0, rows)
    assert (answer.common.tr, answer.common.window, answer.common.keeps_tolerance) == (
        2.0,
        (1.0, 3.0),
        False,
    )
    assert answer.common.errors == pytest.approx([0.1, 0.1])
    (caution,) = answer.cautions
    assert caution.code == "timing-tolerance"
    assert "grows by more than 0.05" in caution.message
    (_, shared), *_ = list_outcome(answer)
    assert shared.startswith("no tr is within the timing tolerance of every run; ")
    assert "common tr" not in shared


@given(
    st.lists(
        st.tuples(st.floats(0, 5), st.floats(0.1, 4), st.floats(0, 1), st.floats(0, 1)).map(
            lambda one: make_study_row(
                "r", (one[0], one[0] + one[1]),
                alike=make_equal_rows(tuple(sorted(one[0] + share * one[1] for share in one[2:]))),  # type: ignore[arg-type]
            )
        ),
        min_size=1,
        max_size=5,
    )
)  # fmt: skip
def test_a_common_tr_lies_in_the_windows_of_all_runs(rows: list[StudyRow]) -> None:
    common_tr = compare_rows(10.0, rows).common
    if common_tr.tr is None:
        assert max(run_row.acceptable[0, 0] for run_row in rows) > min(
            run_row.acceptable[0, 1] for run_row in rows
        )
        return
    for run_row in rows:
        for windows in (
            run_row.acceptable,
            *[run_row.alike] * bool(common_tr.keeps_tolerance),
        ):
            assert windows[0, 0] <= common_tr.tr <= windows[0, 1]


def test_the_errors_at_the_common_tr_are_those_of_verify(tmp_path: Path) -> None:
    names = variants.write_variants(tmp_path)
    for question in (
        ASKED,
        replace(ASKED, settings=Settings(replay=False, after=0.01)),
    ):
        answer = compare_rows(
            variants.TD, [judge_run(question, name) for name in names]
        )
        tr = require(answer.common.tr)
        for name, error in zip(names, answer.common.errors, strict=True):
            verdict = verify_in_history(
                read_history([name]), tr, variants.TD, question.settings
            ).candidate.error
            assert error == pytest.approx(verdict, abs=1e-3)


def test_each_run_chooses_its_own_td_in_a_window(tmp_path: Path) -> None:
    names = variants.write_variants(tmp_path)
    window = (0.06, 0.07)
    rows = [judge_run(Question(window, Settings()), name) for name in names]
    answer = compare_rows(window, rows)
    assert (answer.td, answer.td_window) == (None, window)
    times = [run_row.td for run_row in rows if run_row.td is not None]
    assert len(set(times)) == len(names)
    assert all(window[0] <= td <= window[1] for td in times)
    for name, td in zip(names, times, strict=True):
        assert verify_in_history(
            read_history([name]), require(answer.common.tr), td, Settings()
        ).verified


def test_different_bases_and_units_are_told() -> None:
    rows = [
        make_study_row("a", (1, 2)),
        make_study_row("b", (1, 2), basis="energy", warnings=("energy-only",)),
        make_study_row("c", time_unit="ms"),
    ]
    messages = {
        caution.code: caution.message for caution in compare_rows(10.0, rows).cautions
    }
    assert messages == {
        "mixed-units": "the runs have different units of time, but td has only one: not named in 2 runs, ms in 1 run",
        "mixed-bases": "the basis of the choice differs between the runs: oscillator in 2 runs, energy in 1 run",
        "energy-only": "in 1 of 3 runs: b",
    }


def test_runs_judged_by_different_parts_are_told() -> None:
    rows = [
        make_study_row("a", (1, 2), parts=(1, 2)),
        make_study_row("b", (1, 2), parts=(1,)),
        make_study_row("c", (1, 2), parts=(1, 2)),
    ]
    (caution,) = compare_rows(10.0, rows).cautions
    assert caution.code == "mixed-parts"
    assert caution.message.endswith("parts 1, 2 in 2 runs, part 1 in 1 run")
    named = [replace(row, energy=f"energy of {row.parts}") for row in rows]
    outcome = dict(list_outcome(compare_rows(10.0, named)))
    assert outcome["judged"] == "energy of (1, 2) in 2 runs; energy of (1,) in 1 run"


@pytest.mark.parametrize(
    ("first", "second", "difference"),
    [
        (("1 box", "2 step"), ("1 box", "3"), "only a has part 2 'step'"),
        (("1 box",), ("1 box", "3"), "only b has part 3"),
        (("1 box", "2"), ("1 car", "2"), "part 1 is 'box' in a and 'car' in b"),
        (("1 box", "2 step"), ("1 BOX", "2 st"), ""),
        (("1 box",), (), ""),
    ],
)
def test_runs_with_other_parts_are_those_of_another_model(
    first: tuple[str, ...], second: tuple[str, ...], difference: str
) -> None:
    rows = [
        make_study_row(
            "a", (1, 2), parts_in_files=first, verdict="use", quality="good"
        ),
        make_study_row(
            "b", (1, 2), parts_in_files=second, verdict="use", quality="good"
        ),
    ]
    answer = compare_rows(10.0, rows)
    messages = [caution.message for caution in answer.cautions]
    ((_, step),) = list_next_step(answer, RepeatedQuestion(files=("a", "b")))
    assert len(messages) == bool(difference)
    assert difference in "".join(messages)
    assert ("each model separately" in step) == bool(difference)


@given(st.floats(1e-6, 1e3), st.floats(0, 1))
def test_the_shortest_number_lies_between(low: float, share: float) -> None:
    high = low * (1 + share)
    shortest = find_fewest_digits(low, high)
    assert low <= shortest <= high
    assert (
        len(repr(shortest)) <= len(repr(low))
        or share < 1e-3
        or len(repr(shortest)) <= 7
    )


# Names.


def test_a_folder_of_folders_of_runs_says_how_to_name_them(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / "var" / name).mkdir(parents=True)
    asked_question = replace(ASKED, td=0.064)
    assert require(judge_run(asked_question, str(tmp_path / "var")).message).endswith(
        "give the file"
    )
    for name in ("a", "b"):
        (tmp_path / "var" / name / "glstat").write_bytes(Path(GLSTAT).read_bytes())
    message = require(judge_run(asked_question, str(tmp_path / "var")).message)
    assert message.endswith(f"or all to study as '{tmp_path / 'var'}/*'")
    names = find_runs([message.split("'")[1]])
    assert [judge_run(asked_question, name).status for name in names] == [OK, OK]


@pytest.mark.usefixtures("here")
def test_every_match_of_a_pattern_is_a_run_and_what_matches_nothing_stays() -> None:
    for name in ("b", "a"):
        Path(name).mkdir()
        (Path(name) / "glstat").write_bytes(b"")
    Path("odd[1].csv").write_bytes(b"")
    assert find_runs(["*/glstat"]) == (
        os.path.join("a", "glstat"),  # noqa: PTH118
        os.path.join("b", "glstat"),  # noqa: PTH118
    )
    assert find_runs(["?"]) == ("a", "b")
    assert find_runs(["odd[1].csv", "no*", "a"]) == ("odd[1].csv", "no*", "a")


@pytest.mark.slow
def test_files_of_all_formats_are_rows_of_one_study() -> None:
    """One of the files ends before td."""
    samples = sorted(str(path) for path in Path(BOX).parent.iterdir() if path.is_file())
    sources = [
        *samples,
        *(
            locate_stored(name)
            for name in ("chain_ref.csv.gz", "load_L1_ref.csv.gz", "car_all_T01.gz")
        ),
    ]
    rows = [judge_run(Question(0.05, Settings()), source) for source in sources]
    answer = compare_rows(0.05, rows)
    assert [result_row.source for result_row in answer.runs] == sources
    assert {"ok", "unreadable", "out-of-range"} <= {
        result_row.status for result_row in rows
    }
    assert all(
        (result_row.message is None) == (result_row.status == OK) for result_row in rows
    )


def make_chosen_row(name: str, tr: float | None = None, status: str = OK) -> StudyRow:
    return StudyRow(name, status, tr=tr)


def test_runs_without_a_tr_and_far_ones_stand_out_the_farthest_first() -> None:
    near = [make_chosen_row(f"run{i}", 1.0 + i / 1000) for i in range(20)]
    far, farther = make_chosen_row("far", 1.1), make_chosen_row("farther", 0.5)
    none, lost = (
        make_chosen_row("none", None, NONE),
        make_chosen_row("x", None, UNREADABLE),
    )
    assert find_outliers([far, *near, lost, none, farther]) == (none, farther, far)
    assert find_outliers(near) == ()
    assert find_outliers([none]) == (none,)
    assert find_outliers([]) == ()
    other_row = make_chosen_row(
        "other", 2.1
    )  # if all times are equal, any other time is an outlier
    assert find_outliers(
        [*(make_chosen_row("same", 2.0) for _ in range(9)), other_row]
    ) == (other_row,)


def test_the_error_at_the_common_tr_of_a_run_is_its_residual() -> None:
    # Noise widens the error band of a small residual beyond zero, so the stated residual is the middle of the rest,
    # which is larger than the error of the deformations alone.
    record = read_history([locate_stored("chain_referenceT01.gz")])
    noise = np.random.default_rng(1).standard_normal(record.energy.size)
    energy = np.abs(record.energy + 0.1 * record.energy.std() * noise)
    noisy_history = make_energy_history(energy, record.time)
    answer = suggest_in_history(noisy_history, 0.2066, Settings(after=0.0))
    best = require(answer.chosen)
    residual = require(best.residual)
    (compared,) = answer.situation.errors(np.array([best.tr])).tolist()
    alone = np.hypot(compared, np.sqrt(require(answer.situation.kinetic_share)))
    assert residual - alone > 0.005
    run_row = make_row("noisy", answer)
    study = compare_rows(0.2066, [run_row])
    assert study.common.tr == run_row.tr == best.tr
    assert study.common.errors == pytest.approx((residual,), abs=5e-4)
    heading = dict(list_outcome(study))[require(run_row.verdict)]
    assert f"residual {residual:.3f}" in heading


@pytest.mark.parametrize(
    ("windows", "cause"),
    [
        (
            {"a": ((1, 2), (5, 6)), "b": ((3, 4),)},
            "tr is admissible in 1 interval of b from 3 to 4 and in 2 intervals of a from 1 to 6: they do not overlap",
        ),
        (
            {"a": ((1, 3),), "b": ((2, 5),), "c": ((1, 1.5), (4, 5))},
            "the intervals of b overlap those of each other run, but at different times",
        ),
    ],
)
def test_a_study_without_a_common_tr_says_why(
    windows: dict[str, tuple[tuple[float, float], ...]], cause: str
) -> None:
    rows = [make_study_row(name, *spans) for name, spans in windows.items()]
    reason = require(compare_rows(10.0, rows).common.reason)
    assert reason.endswith(f": {cause}")


def test_runs_that_need_their_own_tr_are_not_called_the_worst() -> None:
    good: dict[str, Any] = {
        "quality": "good",
        "verdict": "use",
        "verdict_reason": "kept",
        "cure": "",
    }
    rows = [make_study_row(name, (1, 2), **good) for name in ("a.csv", "b.csv")]
    rows[1] = make_study_row("b.csv", (3, 4), tr=3.5, **good)
    question = RepeatedQuestion(files=("a.csv", "b.csv"))
    own_td = compare_rows((5.0, 12.0), rows)
    assert own_td.common.tr is None
    # At a td of another run, the pairs of this run may be worse, and nothing shows that a common tr exists there.
    ((_, step),) = list_next_step(own_td, question)
    assert "its own tr and td" in step
    assert "d2rpick study" not in step
    ((_, step),) = list_next_step(compare_rows(10.0, rows), question)
    assert "its own tr" in step
    assert "worst" not in step


def test_a_single_judged_run_has_nothing_in_common_with_others() -> None:
    rows = [
        make_study_row("a.csv", (1, 3), quality="good", verdict="use"),
        StudyRow("b.csv", UNREADABLE, "b.csv: no such file"),
    ]
    answer = compare_rows(10.0, rows)
    lines = dict(list_outcome(answer))
    assert lines["use"].startswith("tr = 2, for 1 of 2 runs")
    assert lines["own tr"] == "2"
    ((_, step),) = list_next_step(answer, RepeatedQuestion(files=("a.csv", "b.csv")))
    assert "d2rpick suggest a.csv" in step


def test_a_large_error_has_its_reason_in_a_study_even_if_it_is_small_beside_the_next_contact() -> (
    None
):
    row = make_study_row("a.csv", (1, 3), quality="good", verdict="use")
    wrong = replace(row, residual=0.6, verdict_reason="wrong by 60%, but", cure="")
    assert list_run_reasons(compare_rows(10.0, [wrong])) == [
        ("why", "use in 1 run: wrong by 60%, but")
    ]
    assert not list_run_reasons(compare_rows(10.0, [row]))


def test_a_run_has_the_residual_that_suggest_gives_at_its_own_tr() -> None:
    """The interpolated error of a run at its own tr differed from its residual in the last digit."""
    row = replace(make_study_row("a", (0.0, 5.0), tr=2.0), residual=0.199)
    common = compare_rows(10.0, [row]).common
    assert (common.tr, common.errors) == (row.tr, (row.residual,))
