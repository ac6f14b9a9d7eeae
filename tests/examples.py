"""Find the examples in README.md and docs, and run them as a reader would type them.

``python -m tests.examples`` runs all sessions and writes their output into the pages, or only into the pages given as
arguments.  Check the difference before you commit it.
"""

import contextlib
import re
import shlex
import shutil
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from tests.command import ROOT, run

README = ROOT / "README.md"
PAGES = {
    str(path.relative_to(ROOT)): path
    for path in (README, *sorted((ROOT / "docs").rglob("*.md")))
}

_FENCED = re.compile(r"^```(\w*)\n(.*?)^```$", flags=re.DOTALL | re.MULTILINE)
_PROMPT = "$ d2rpick "  # lines of a card begin with "$ " too
# A command, continued if its line ends with a backslash, and the output down to the next prompt.
_SESSION = re.compile(
    r"^\$ (d2rpick (?:.*\\\n)*.*)\n((?:(?!\$ d2rpick ).*\n)*)", flags=re.MULTILINE
)
# The last digits of a number at full precision depend on the machine.
_FULL_PRECISION = re.compile(r"\d+\.\d{13,}(?:e[+-]\d+)?")
# The pages show what a terminal of this width shows.
_TERMINAL = {"COLUMNS": "100"}
_NEXT_TO_NOTHING = re.compile(r"\b\d\.\d+e-(?:0[5-9]|[1-9]\d)\b")


class Session(NamedTuple):
    """Command line, and the output that a page shows below it: first stderr, then stdout."""

    command: str
    shown: str


def read_page(page: str) -> str:
    """Return the text of a page, given its path from the root of the repository."""
    return PAGES[page].read_text("utf-8")


def find_blocks(text: str, language: str) -> list[str]:
    """Return the fenced blocks in a language."""
    return [
        block
        for block_language, block in _FENCED.findall(text)
        if block_language == language
    ]


def find_languages(text: str) -> set[str]:
    """Return the languages of the fenced blocks."""
    return {block_language for block_language, _ in _FENCED.findall(text)}


def strip_blocks(text: str) -> str:
    """Return the text without its fenced blocks."""
    return _FENCED.sub("", text)


def find_sessions(text: str) -> Iterator[Session]:
    """Yield the sessions of a page in order."""
    for block in find_blocks(text, "console"):
        assert block.startswith(_PROMPT), block
        yield from (
            Session(command, shown_output.rstrip("\n"))
            for command, shown_output in _SESSION.findall(block)
        )


def make_anchor(heading: str) -> str:
    """Return the anchor that GitHub gives a heading."""
    return re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-")


def run_shown_command(command: str) -> str:
    """Run a command line and return its output."""
    _, *args = shlex.split(command.replace("\\\n", ""))
    result = run(*args, env=_TERMINAL)
    return f"{result.stderr}{result.stdout}".rstrip("\n")


def round_numbers(text: str) -> str:
    """Drop the digits that depend on the machine: the last ones at full precision, and errors close to zero."""
    text = _FULL_PRECISION.sub(lambda number: f"{float(number[0]):.7g}", text)
    return _NEXT_TO_NOTHING.sub(lambda number: f"{float(number[0]):.3g}", text)


def renewed(text: str) -> str:
    """Replace the shown output of the sessions by today's, except for digits that depend on the machine."""

    def run_again(match: re.Match[str]) -> str:
        command, shown_output = match[1], match[2]
        printed_now = run_shown_command(command)
        if round_numbers(printed_now) == round_numbers(shown_output.rstrip("\n")):
            return match[0]
        return f"$ {command}\n{printed_now}\n" if printed_now else f"$ {command}\n"

    def of_block(match: re.Match[str]) -> str:
        return _SESSION.sub(run_again, match[0]) if match[1] == "console" else match[0]

    return _FENCED.sub(of_block, text)


@contextlib.contextmanager
def enter_reader_folder() -> Iterator[None]:
    """Change to a folder that contains only the sample data."""
    with tempfile.TemporaryDirectory() as folder:
        shutil.copytree(ROOT / "sample_data", Path(folder) / "sample_data")
        with contextlib.chdir(folder):
            yield


if __name__ == "__main__":
    chosen = {str(Path(name)) for name in sys.argv[1:]} or set(PAGES)
    for path in (PAGES[name] for name in PAGES if name in chosen):
        with enter_reader_folder():
            new = renewed(path.read_text("utf-8"))
        path.write_text(new, "utf-8")
