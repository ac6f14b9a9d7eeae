"""The page of keywords answers the words that analysts type, whatever d2rpick calls the thing."""

import re

import pytest

from tests.examples import make_anchor, read_page
from tests.questions import Question, list_questions

PAGE = "docs/reference/keywords.md"
WARNINGS = "docs/reference/warnings.md"
ROWS = re.findall(r"^\| \[(.+?)\]\((.+?)\) \| (.+) \|$", read_page(PAGE), re.MULTILINE)
LONGEST_SHORT_ANSWER = 20  # [words]
TYPED_BY_ANALYSTS = """
    added mass; airbag; airborne; bounce; crash; damping; d3hsp; d3plot; deformable to rigid; drop test; dummy;
    eigenfrequency; element deletion; encrypted; ENDTIM; exit code; FFT; filter; freeze; friction; glstat; hourglass;
    HyperStudy; initial velocity; joint; kg mm ms; kinetic energy; landing; license; LS-OPT; mass scaling; messag; MPP;
    nodal rigid body; nodout; oscillation; output interval; plastic strain; plateau; preload; rebound; restart; ringing;
    rollover; rotation; sampling rate; second impact; section force; sensor; Slurm; sloshing; spotweld; springback;
    time saving; time step; ton mm s; tyre; UMAT; verdict; wheel; Windows; --after; --done; --landing; --margin;
    belt; changed part id; energy rises; FMVSS; initial speed; load case; quasi-static; second flight; seat belt;
    spot weld; td fixed; two flights; ±; --min-quality; --step-cap; --write-deck; /FAIL; /SECT; *CONTROL_TERMINATION;
    *MAT_RIGID; *SET_PART; HIC; pre-commit
"""


def sort_key(words: str) -> str:
    """Return the first word of a row without the characters that begin a keyword card."""
    return re.sub(r"^[^a-z0-9]+", "", words.lower())


def test_the_rows_are_in_alphabetical_order_and_short() -> None:
    keys = [sort_key(words) for words, _, _ in ROWS]
    assert len(keys) > 100
    assert keys == sorted(keys)
    assert all(len(answer.split()) <= LONGEST_SHORT_ANSWER for *_, answer in ROWS)


@pytest.mark.parametrize(
    "word", [word.strip() for word in TYPED_BY_ANALYSTS.split(";")]
)
def test_a_word_that_analysts_type_is_found(word: str) -> None:
    assert any(
        word.lower() in words.lower().replace("\\*", "*") for words, _, _ in ROWS
    )


@pytest.mark.parametrize(
    "question", [*list_questions()], ids=lambda question: question.title
)
def test_every_frequent_question_has_a_row(question: Question) -> None:
    answer = f"../how-to/{question.page}.md#{make_anchor(question.title)}"
    assert answer in {target for _, target, _ in ROWS}


@pytest.mark.parametrize(
    "code", re.findall(r"^### (.+)$", read_page(WARNINGS), re.MULTILINE)
)
def test_a_warning_code_is_found(code: str) -> None:
    assert any(code in re.split(r"[`, ]+", words) for words, _, _ in ROWS)
