"""The indexes of the frequently asked questions: each question with a link, and the bold text of its answer.

``python -m tests.questions`` writes them to docs/how-to: start-faq.md (first steps), files-faq.md (files of a run),
faq.md (planning), model-faq.md (the model), switched-faq.md (cards and switched run) and scripts-faq.md (scripts, CI,
many runs), so that each can be scanned at a glance; a test holds them current.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final, NamedTuple

from tests.command import ROOT
from tests.examples import make_anchor

if TYPE_CHECKING:
    from collections.abc import Iterator

FOLDER: Final = ROOT / "docs" / "how-to"
_PREFIX: Final = "Frequently asked questions: "
# Titles of the indexes, and labels of their pages, in the order of the lists.
INDEXES: Final = {
    "start-faq": f"{_PREFIX}installation and first steps",
    "files-faq": f"{_PREFIX}the files of a run",
    "faq": f"{_PREFIX}planning a switch",
    "model-faq": f"{_PREFIX}your model",
    "switched-faq": f"{_PREFIX}cards and switched run",
    "scripts-faq": f"{_PREFIX}scripts, CI, many runs",
}
PAGES: Final = {
    "start-faq": {
        "faq-start": "Start",
        "faq-work": "Use at work",
    },
    "files-faq": {
        "faq-files": "Files",
        "faq-formats": "Formats",
        "faq-reading": "Reading the run",
    },
    "faq": {
        "faq-answer": "Verdicts and limits",
        "faq-terms": "Terms",
        "faq-times": "Times",
        "faq-flights": "Flights",
        "faq-saving": "Saving",
    },
    "model-faq": {
        "faq-models": "Model",
        "faq-usual": "Typical cases",
        "faq-options": "Solver options and loads",
        "faq-special": "Special cases",
    },
    "switched-faq": {
        "faq-solver": "Cards",
        "faq-constraints": "Constraints",
        "faq-rigid": "While rigid",
        "faq-run": "Switched run",
        "faq-finished": "Finished run",
    },
    "scripts-faq": {
        "faq-scripts": "Scripts and CI",
        "faq-output": "Output",
        "faq-many": "Many runs, first runs",
    },
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
        text = " ".join(found[1].split()).rstrip(",:") if found else ""
        return text if not text or text.endswith(".") else f"{text}."


def list_questions() -> Iterator[Question]:
    """Yield the questions of all pages in order."""
    for page in list_pages():
        topic = ""
        for entry in _ENTRY.finditer((FOLDER / f"{page}.md").read_text("utf-8")):
            if entry["topic"]:
                topic = entry["topic"]
            else:
                yield Question(page, topic, entry["title"], entry["answer"])


def list_pages() -> list[str]:
    """List the names of all pages in order."""
    return [page for pages in PAGES.values() for page in pages]


def make_index(index: str) -> str:
    """Return the page that lists the questions of an index by topic."""
    questions = [
        question for question in list_questions() if question.page in PAGES[index]
    ]
    lines = [f"# {INDEXES[index]}", "", _INTRODUCTION, ""]
    for page, label in PAGES[index].items():
        lines.append(f"* **{label}.** {', '.join(_link_topics(page))}")
    others = [
        f"[{title.removeprefix(_PREFIX)}]({other}.md)"
        for other, title in INDEXES.items()
        if other != index
    ]
    lines.append(f"* **Other lists.** {', '.join(others)}")
    topic = ""
    for question in questions:
        if question.topic != topic:
            topic = question.topic
            lines += ["", f"## {topic}", ""]
        link = f"{question.page}.md#{make_anchor(question.title)}"
        separator = "" if question.title.endswith("?") else ":"
        lines.append(f"* [{question.title}]({link}){separator} {question.short_answer}")
    return "\n".join(lines) + "\n"


def _link_topics(page: str) -> list[str]:
    """Return links to the topics of a page within the index that lists its questions."""
    topics = dict.fromkeys(
        question.topic for question in list_questions() if question.page == page
    )
    return [f"[{topic}](#{make_anchor(topic)})" for topic in topics]


if __name__ == "__main__":
    for name in INDEXES:
        (FOLDER / f"{name}.md").write_text(make_index(name), "utf-8")
