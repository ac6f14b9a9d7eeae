"""The index of the frequently asked questions: each question with a link, and the bold text that begins its answer.

``python -m tests.questions`` writes it to docs/how-to/faq.md; a test holds it current.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final, NamedTuple

from tests.command import ROOT
from tests.examples import make_anchor

if TYPE_CHECKING:
    from collections.abc import Iterator

FOLDER: Final = ROOT / "docs" / "how-to"
INDEX: Final = FOLDER / "faq.md"
# In the order of the index.
PAGES: Final = {
    "faq-start": "Start",
    "faq-answer": "Answer",
    "faq-models": "Model",
    "faq-solver": "Solver",
}

_INTRODUCTION: Final = "Click a question for the reason and the exceptions."
_ENTRY: Final = re.compile(
    r"^## (?P<topic>.+)$|^### (?P<title>.+)\n\n(?P<answer>.+(?:\n.+)*)",
    flags=re.MULTILINE,
)
_SHORT_ANSWER: Final = re.compile(r"\*\*(.+?)\*\*(?!\*)", flags=re.DOTALL)


class Question(NamedTuple):
    """A question with the first paragraph of its answer, under a topic of a page."""

    page: str
    topic: str
    title: str
    answer: str

    @property
    def short_answer(self) -> str:
        """The bold text that begins the answer; empty if there is none."""
        found = _SHORT_ANSWER.match(self.answer)
        text = " ".join(found[1].split()).rstrip(",") if found else ""
        return text if not text or text.endswith(".") else f"{text}."


def list_questions() -> Iterator[Question]:
    """Yield the questions of all pages in order."""
    for page in PAGES:
        topic = ""
        for entry in _ENTRY.finditer((FOLDER / f"{page}.md").read_text("utf-8")):
            if entry["topic"]:
                topic = entry["topic"]
            else:
                yield Question(page, topic, entry["title"], entry["answer"])


def make_index() -> str:
    """Return the page that lists all questions by topic."""
    questions = [*list_questions()]
    lines = ["# Frequently asked questions", "", _INTRODUCTION, ""]
    for page, label in PAGES.items():
        topics = dict.fromkeys(
            question.topic for question in questions if question.page == page
        )
        links = ", ".join(f"[{topic}](#{make_anchor(topic)})" for topic in topics)
        lines.append(f"* **{label}.** {links}")
    topic = ""
    for question in questions:
        if question.topic != topic:
            topic = question.topic
            lines += ["", f"## {topic}", ""]
        link = f"{question.page}.md#{make_anchor(question.title)}"
        separator = "" if question.title.endswith("?") else ":"
        lines.append(f"* [{question.title}]({link}){separator} {question.short_answer}")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    INDEX.write_text(make_index(), "utf-8")
