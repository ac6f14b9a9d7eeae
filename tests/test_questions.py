"""Frequently asked questions are found in one list, and each answer begins with the answer itself."""

import re

import pytest

from tests.examples import strip_blocks
from tests.questions import (
    FOLDER,
    INDEXES,
    PAGES,
    Question,
    list_pages,
    list_questions,
    make_index,
)

QUESTIONS = [*list_questions()]
LONGEST_QUESTION = 10  # [words]
LONGEST_SHORT_ANSWER = 25  # [words]
LONGEST_ANSWER = 70  # words of the first paragraph, without the targets of links


def count_words(text: str) -> int:
    """Count the words of a text as a reader sees it."""
    return len(re.sub(r"\]\([^)]*\)", "]", text).split())


@pytest.mark.parametrize("index", INDEXES)
def test_an_index_is_current(index: str) -> None:
    """Write it with ``python -m tests.questions``."""
    assert (FOLDER / f"{index}.md").read_text("utf-8") == make_index(index)


@pytest.mark.parametrize(
    ("index", "page"), [(index, page) for index in INDEXES for page in PAGES[index]]
)
def test_an_index_lists_every_question_of_a_page(index: str, page: str) -> None:
    text = strip_blocks((FOLDER / f"{page}.md").read_text("utf-8"))
    titles = re.findall(r"^### (.+)$", text, flags=re.MULTILINE)
    listed = [question.title for question in QUESTIONS if question.page == page]
    assert titles == listed
    assert all(f"* [{title}]({page}.md#" in make_index(index) for title in titles)


def test_every_page_of_questions_is_in_an_index() -> None:
    assert {path.stem for path in FOLDER.glob("faq-*.md")} == {*list_pages()}


@pytest.mark.parametrize(
    "question", QUESTIONS, ids=[question.title for question in QUESTIONS]
)
def test_an_answer_begins_with_the_answer_itself(question: Question) -> None:
    assert count_words(question.title) <= LONGEST_QUESTION
    assert 1 <= count_words(question.short_answer) <= LONGEST_SHORT_ANSWER
    assert count_words(question.answer) <= LONGEST_ANSWER
    assert not question.short_answer.endswith((":.", ",.", ";."))


def test_no_two_questions_are_the_same() -> None:
    titles = [question.title for question in QUESTIONS]
    assert len({*titles}) == len(titles) > 100
