"""The one way from files to an answer: every user of it gets the same, and a record is examined once per question."""

from __future__ import annotations

import json
from functools import partial
from typing import TYPE_CHECKING

import pytest

from d2rpick.choice import examine
from d2rpick.choice.judged_card import CardRequest, judged_card
from d2rpick.choice.of_run import Reference, judge_of, read, suggest_of, verify_of
from d2rpick.choice.settings import Settings
from d2rpick.histories.opening import open_run
from d2rpick.histories.selection import Selection
from d2rpick.report.suggestion import as_json
from d2rpick.report.verdict import as_json as verdict_as_json
from d2rpick.rules.judgement import faults_of
from d2rpick.studies.study import Question, ask
from d2rpick.vibration.span import described_span
from tests.command import BOX as T01
from tests.command import ENERGY, GLSTAT, run

if TYPE_CHECKING:
    from collections.abc import Callable

BOX = Selection(parts=("box",))
PLAIN = Settings()


@pytest.fixture
def examined(monkeypatch: pytest.MonkeyPatch) -> Callable[[], int]:
    """Count how often an oscillator was looked for since the last call."""
    calls: list[None] = []

    def counted(*args: object, **options: object) -> object:
        calls.append(None)
        return described_span(*args, **options)  # type: ignore[arg-type]

    def count() -> int:
        number = len(calls)
        calls.clear()
        return number

    monkeypatch.setattr(examine, "described_span", counted)
    return count


@pytest.mark.parametrize(("file", "selection", "td"), [(ENERGY, Selection(), 0.064), (T01, BOX, 0.37)])
def test_the_command_line_and_a_study_answer_as_the_library_does(file: str, selection: Selection, td: float) -> None:
    parts = [text for part in selection.parts for text in ("--part", part)]
    args = ["suggest", "--td", str(td), *parts, "-f", "json", file]
    answer = suggest_of(read([file], selection), td, PLAIN)
    assert run(*args).stdout == f"{as_json(answer, args)}\n"
    row = ask(Question(td, PLAIN, selection), file)
    assert answer.recommended is not None
    assert (row.tr, row.residual) == (answer.recommended.tr, answer.recommended.residual)
    assert {caution.code for caution in answer.cautions} - {"no-better-td"} == set(row.warnings)
    tr = answer.recommended.tr
    args = ["verify", "--tr", repr(tr), "--td", str(td), *parts, "-f", "json", file]
    verdict = verify_of(read([file], selection), tr, td, PLAIN)
    assert verdict.verified
    assert json.loads(run(*args).stdout) == json.loads(verdict_as_json(verdict, args))


def test_the_health_of_the_run_comes_with_every_answer() -> None:
    whole = read([T01], BOX)
    answer, in_window = suggest_of(whole, 0.37, PLAIN), suggest_of(whole, (0.3, 0.38), PLAIN)
    assert answer.recommended is not None
    verdict = verify_of(whole, answer.recommended.tr, 0.37, PLAIN)
    assert answer.health is not None
    assert answer.health == verdict.health
    assert answer.health.window == (answer.recommended.tr, 0.37)
    assert in_window.health is not None
    assert suggest_of(read([ENERGY]), 0.064, PLAIN).health is None  # a table of two columns tells nothing of it


def test_the_momenta_come_with_every_history_and_know_the_chosen_part() -> None:
    opened = open_run([T01])
    whole, box = (Reference.of(opened, selection).history for selection in (Selection(), BOX))
    (of_whole, *_), (of_box, *_) = whole.momenta, box.momenta
    assert of_whole.parts == of_box.parts
    assert of_whole.parts is not None
    assert of_whole.chosen == tuple(range(len(of_whole.parts)))
    assert [of_whole.parts[i].title for i in of_box.chosen] == ["box"]
    assert of_whole.values is of_box.values  # read once


def test_a_record_is_examined_once_per_question(examined: Callable[[], int]) -> None:
    reference = read([GLSTAT])
    verdict = verify_of(reference, 0.02, 0.0687, PLAIN)  # a tr that does: it is named as the way out
    assert examined() == 1
    assert any("suits this td" in fault.message for fault in faults_of(verdict))
    assert examined() == 0
    reference = read([T01], BOX)
    box = suggest_of(reference, 0.37, PLAIN)
    examined()
    assert box.recommended is not None
    request = CardRequest("ls-dyna")
    situation = box.situation
    judge = partial(judge_of, reference, situation)
    assert judged_card([box.recommended[:2]], situation.history, judge, request)
    assert examined() == 0


def test_no_td_of_a_window_is_examined_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    from d2rpick.choice import suggest_td

    seen: list[float] = []

    def noted(history: object, td: float, settings: Settings, fits: object) -> object:
        seen.append(td)
        return examine.examine(history, td, settings, fits=fits)  # type: ignore[arg-type]

    monkeypatch.setattr(suggest_td, "examine", noted)
    suggest_of(read([ENERGY]), (0.06, 0.09), PLAIN)
    assert len(seen) == len(set(seen)) > 3
