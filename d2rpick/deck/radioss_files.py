"""Which files belong to a Radioss run, and what may be wrong with one: all that a deck of LS-DYNA needs to know."""

from __future__ import annotations

import os
import re
from typing import TYPE_CHECKING, Final

from d2rpick.base.tuples import NamedTuple

if TYPE_CHECKING:
    from d2rpick.deck.card import Field

THROUGH_WALL: Final = "body-through-wall"
AT_REST: Final = "body-without-velocity"
NOT_FOLLOWED: Final = "deck-not-followed"
LEFT_RIGID: Final = "body-left-rigid"
# What ruins a run, in a few words, and the rule that says more.
RUINS: Final = {
    THROUGH_WALL: "the deck lets rigid bodies go through a wall (D2R406)",
    AT_REST: "the deck lets rigid bodies begin at rest (D2R407)",
    LEFT_RIGID: "the deck keeps parts rigid that deform (D2R409)",
}


class Flaw(NamedTuple):
    """What is wrong, with a stable ``code``, and where; `NOT_FOLLOWED` tells what was not judged, and why."""

    code: str
    place: Field
    message: str


HEAD: Final = 256 * 1024  # bytes in which a file shows what it is
_KEYWORD: Final = re.compile(rb"^[*/]", re.MULTILINE)
# Those of files of Radioss are compiled where they are needed.
STARTER: Final = rb"(?mi)^/BEGIN"
ENGINE: Final = rb"(?mi)^/RUN/"
_NUMBERED: Final = r"(?is)(.+)_(\d{4})\.rad"
_NAME: Final = rb"(?mi)^/BEGIN[^\n]*\n(?:[#$][^\n]*\n)*([^\n]*)|^/RUN/([^/\n]+)"


def recognises(head: bytes) -> bool:
    """Whether a file that begins like this is a starter deck or an engine file."""
    first = _KEYWORD.search(head)
    return (
        first is not None
        and first[0] == b"/"
        and bool(re.search(STARTER, head) or re.search(ENGINE, head))
    )


def run_files(path: str) -> list[str]:
    """Files of the run that ``path`` belongs to; none where it is not a file of a Radioss run.

    The starter deck ``NAME_0000.rad`` and the engine files ``NAME_0001.rad`` and so on in its folder belong
    together; a file of another name goes by the name of the run that it holds.
    """
    try:
        if not os.path.isfile(path):  # noqa: PTH113  start-up
            return []  # a pipe gives its bytes once
        with open(path, "rb", buffering=0) as stream:  # noqa: PTH123
            # room for more than there is costs ten times the reading
            head = stream.read(min(HEAD, os.fstat(stream.fileno()).st_size))
        if not recognises(head):
            return []
        from pathlib import Path  # not above: start-up

        folder = Path(path).parent
        beside = sorted(os.listdir(folder))  # noqa: PTH208  nothing is asked of each file: there may be many runs
    except (OSError, ValueError):
        return []  # said by who reads it
    name = _run_name(path, head)
    numbered = (re.fullmatch(_NUMBERED, one) for one in beside if one.startswith(name))
    alike = (folder / match[0] for match in numbered if match and match[1] == name)
    files = [str(one) for one in alike if one.is_file()]
    return files if any(Path(path).samefile(one) for one in files) else [path, *files]


def root_of(path: str) -> str:
    """Give the name that all files of a run begin with, ``NAME`` of ``NAME_0001.rad``; empty if a file has none.

    The engine looks for the restart that begins like its own file, whatever the name in /RUN is.  Source: runs
    computed with OpenRadioss.
    """
    numbered = re.fullmatch(_NUMBERED, os.path.basename(path))  # noqa: PTH119  start-up
    return numbered[1] if numbered else ""


def _run_name(path: str, head: bytes) -> str:
    """Name of a run by that of its file, else by what stands in it."""
    if root := root_of(path):
        return root
    found = re.search(_NAME, head)
    return (found[1] or found[2] or b"").decode("latin-1").strip() if found else ""
