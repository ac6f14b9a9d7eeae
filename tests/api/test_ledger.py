"""A ledger returns the rows that were stored, unless files, options or version have changed; cut lines are skipped."""

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from d2rpick.api.studies import Ledger, compute_fingerprint, write_row
from d2rpick.base.errors import FormatError
from d2rpick.choice.question import Settings
from d2rpick.choice.runs import study
from d2rpick.choice.runs.study import Question, StudyRow, judge_run
from d2rpick.histories.opening import Selection
from tests import variants
from tests.command import put

QUESTION = Question(variants.TD, Settings())


def list_values(row: StudyRow | None) -> dict[str, object]:
    """Return all fields of a row as plain values."""
    assert row is not None
    field_values = {name: getattr(row, name) for name in row.__dataclass_fields__}
    for name in ("acceptable", "alike", "profile", "curve"):
        field_values[name] = (
            None if field_values[name] is None else field_values[name].tolist()
        )
    return field_values


def keep_run_in_ledger(
    folder: Path, question: Question = QUESTION
) -> tuple[str, str, StudyRow]:
    """Return a run, the ledger that contains it, and its row."""
    name, ledger = variants.write(folder / "run.csv"), str(folder / "ledger.ndjson")
    row = judge_run(question, name)
    Ledger(ledger, question).add(row)
    return name, ledger, row


@pytest.mark.parametrize("curve", [False, True])
def test_a_row_comes_back_to_the_last_digit(tmp_path: Path, curve: bool) -> None:
    question = replace(QUESTION, curve=curve)
    name, ledger, row = keep_run_in_ledger(tmp_path, question)
    again = Ledger(ledger, question)
    assert list_values(again.find(name)) == list_values(row)
    assert again.told(1) == f"1 of 1 runs reused from {ledger}"


def test_a_row_is_found_under_another_name_of_its_file(here: Path) -> None:
    _, ledger, row = keep_run_in_ledger(here)
    assert list_values(Ledger(ledger, QUESTION).find("./run.csv")) == {
        **list_values(row),
        "source": "./run.csv",
    }


@pytest.mark.parametrize(
    "question",
    [
        replace(QUESTION, td=0.064),
        replace(QUESTION, settings=Settings(tolerance=0.1)),
        replace(QUESTION, selection=Selection(energy=("internal_energy",))),
        replace(QUESTION, input_format="csv"),
        replace(QUESTION, curve=True),
        replace(QUESTION, tool_version="0.0.1"),
    ],
)
def test_a_row_of_another_question_is_not_taken(
    tmp_path: Path, question: Question
) -> None:
    name, ledger, _ = keep_run_in_ledger(tmp_path)
    again = Ledger(ledger, question)
    assert again.find(name) is None
    assert again.told(1).endswith(
        "; 1 have changed, or were computed with other options, and are computed again"
    )


def test_a_figure_changes_no_answer_but_needs_the_outline(tmp_path: Path) -> None:
    question = replace(QUESTION, curve=True)
    assert compute_fingerprint(question) == compute_fingerprint(QUESTION)
    name, ledger, _ = keep_run_in_ledger(tmp_path, question)
    assert list_values(Ledger(ledger, QUESTION).find(name))["curve"] is None


@pytest.mark.parametrize("change", ["touched", "longer", "gone", "more files"])
def test_a_row_of_changed_files_is_not_taken(tmp_path: Path, change: str) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    glstat = put(
        folder / "glstat",
        (
            Path(variants.__file__).parents[1] / "sample_data" / "energy.glstat"
        ).read_bytes(),
    )
    ledger = Ledger(str(tmp_path / "ledger.ndjson"), QUESTION)
    ledger.add(judge_run(QUESTION, str(folder)))
    assert Ledger(ledger.name, QUESTION).find(str(folder))
    state = glstat.stat()
    if change == "touched":
        os.utime(glstat, ns=(state.st_atime_ns, state.st_mtime_ns + 1))
    elif change == "longer":
        glstat.write_bytes(glstat.read_bytes() + b"\n")
        os.utime(glstat, ns=(state.st_atime_ns, state.st_mtime_ns))
    elif change == "gone":
        glstat.unlink()
    else:
        (folder / "matsum").write_bytes(b"")
    assert Ledger(ledger.name, QUESTION).find(str(folder)) is None


def test_what_could_not_be_read_is_asked_again(tmp_path: Path) -> None:
    ledger = Ledger(str(tmp_path / "ledger.ndjson"), QUESTION)
    name = str(tmp_path / "energy.csv")
    Path(name).write_text("nothing of use\n")
    ledger.add(judge_run(QUESTION, name))
    ledger.add(study.make_failed_row(name, MemoryError()))
    assert not Path(ledger.name).exists()  # the first row creates the file
    short = variants.write(tmp_path / "short.csv", end=0.05)
    ledger.add(judge_run(QUESTION, short))
    assert (
        list_values(Ledger(ledger.name, QUESTION).find(short))["status"]
        == "out-of-range"
    )


def test_a_line_that_was_cut_anywhere_is_passed_over_and_the_next_one_is_whole(
    tmp_path: Path,
) -> None:
    name, ledger, row = keep_run_in_ledger(tmp_path)
    whole = Path(ledger).read_bytes()
    other_file = variants.write(tmp_path / "other.csv", variants.make_variant(1.01))
    next_row = judge_run(QUESTION, other_file)
    for cut in range(0, len(whole) - 1, 97):
        Path(ledger).write_bytes(whole + whole[:cut])
        Ledger(ledger, QUESTION).add(next_row)
        again = Ledger(ledger, QUESTION)
        assert list_values(again.find(name)) == list_values(row)
        assert list_values(again.find(other_file)) == list_values(next_row)


@pytest.mark.parametrize(
    "content",
    ["time,energy\n0,1\n", '{"schema": "d2rpick/study/1"}\n', "\n", '{"a": 1}\n'],
)
def test_another_file_is_refused_and_stays_as_it_is(
    tmp_path: Path, content: str
) -> None:
    file = put(tmp_path / "file", content)
    with pytest.raises(FormatError, match="not a run of a study"):
        Ledger(str(file), QUESTION)
    assert file.read_text() == content


def test_a_ledger_that_cannot_be_written_is_refused_before_the_work(
    tmp_path: Path,
) -> None:
    for name in (tmp_path, tmp_path / "absent" / "ledger"):
        with pytest.raises(FormatError, match="cannot be written"):
            Ledger(str(name), QUESTION)


def test_a_line_is_json_with_the_windows_of_the_row(tmp_path: Path) -> None:
    row = judge_run(QUESTION, variants.write(tmp_path / "run.csv"))
    row_document = json.loads(write_row(row, "asked"))
    assert row_document["acceptable"] == [row.acceptable.tolist(), row.alike.tolist()]
    assert np.array(row_document["acceptable"][0]).size
