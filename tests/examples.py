"""The examples in README.md and docs: found, and run as a reader would type them.

``python -m tests.examples`` runs all sessions and writes what they print into the pages; read the difference before
you commit it.
"""

import contextlib
import re
import shlex
import shutil
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
# A command, continued where its lines end with a backslash, and what is shown up to the next prompt.
_SESSION = re.compile(
    r"^\$ (d2rpick (?:.*\\\n)*.*)\n((?:(?!\$ d2rpick ).*\n)*)", flags=re.MULTILINE
)
# The last digits of a number at full precision differ from machine to machine.
_FULL_PRECISION = re.compile(r"\d+\.\d{13,}(?:e[+-]\d+)?")
_NEXT_TO_NOTHING = re.compile(r"\b\d\.\d+e-(?:0[5-9]|[1-9]\d)\b")


class Session(NamedTuple):
    """A command line, and below it what a terminal shows: first stderr, then stdout."""

    command: str
    shown: str


def text_of(page: str) -> str:
    """Text of a page, by its name from the root of the repository."""
    return PAGES[page].read_text("utf-8")


def blocks(text: str, language: str) -> list[str]:
    """Fenced blocks in a language."""
    return [block for found, block in _FENCED.findall(text) if found == language]


def languages(text: str) -> set[str]:
    """Languages of the fenced blocks."""
    return {found for found, _ in _FENCED.findall(text)}


def prose(text: str) -> str:
    """Text without its fenced blocks."""
    return _FENCED.sub("", text)


def sessions(text: str) -> Iterator[Session]:
    """Sessions of a page in their order."""
    for block in blocks(text, "console"):
        assert block.startswith(_PROMPT), block
        yield from (
            Session(command, shown.rstrip("\n"))
            for command, shown in _SESSION.findall(block)
        )


def printed(command: str) -> str:
    """What a command line prints here."""
    _, *args = shlex.split(command.replace("\\\n", ""))
    result = run(*args)
    return f"{result.stderr}{result.stdout}".rstrip("\n")


def rounded(text: str) -> str:
    """Text with its numbers cut to what every machine gives: those at full precision, and errors next to nothing."""
    text = _FULL_PRECISION.sub(lambda number: f"{float(number[0]):.11g}", text)
    return _NEXT_TO_NOTHING.sub(lambda number: f"{float(number[0]):.3g}", text)


def renewed(text: str) -> str:
    """Text of a page with what its sessions print here; digits that differ by machine stay."""

    def run_again(found: re.Match[str]) -> str:
        command, shown = found[1], found[2]
        now = printed(command)
        if rounded(now) == rounded(shown.rstrip("\n")):
            return found[0]
        return f"$ {command}\n{now}\n" if now else f"$ {command}\n"

    def of_block(found: re.Match[str]) -> str:
        return _SESSION.sub(run_again, found[0]) if found[1] == "console" else found[0]

    return _FENCED.sub(of_block, text)


@contextlib.contextmanager
def folder_of_a_reader() -> Iterator[None]:
    """Work in a folder that holds the sample data alone."""
    with tempfile.TemporaryDirectory() as place:
        shutil.copytree(ROOT / "sample_data", Path(place) / "sample_data")
        with contextlib.chdir(place):
            yield


if __name__ == "__main__":
    for path in PAGES.values():
        with folder_of_a_reader():
            new = renewed(path.read_text("utf-8"))
        path.write_text(new, "utf-8")
