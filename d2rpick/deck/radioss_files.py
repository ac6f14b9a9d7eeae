"""Recognise the files of a Radioss run, and name its possible flaws without reading the deck."""

from __future__ import annotations

import os
import re
from typing import TYPE_CHECKING, Final

from d2rpick.base.tuples import NamedTuple

if TYPE_CHECKING:
    from d2rpick.deck.card import CardField

THROUGH_WALL: Final = "body-through-wall"
AT_REST: Final = "body-without-velocity"
NOT_FOLLOWED: Final = "deck-not-followed"
LEFT_RIGID: Final = "body-left-rigid"
# Short text of each flaw that ruins a run, with the rule that explains the flaw.
RUINS: Final = {
    THROUGH_WALL: "the deck lets rigid bodies go through a wall (D2R406)",
    AT_REST: "the deck lets rigid bodies begin at rest (D2R407)",
    LEFT_RIGID: "the deck keeps parts rigid that deform (D2R409)",
}

# Number of bytes at the beginning of a file from which the file is recognised.
HEAD: Final = 256 * 1024
# These patterns of keywords are compiled on first use to keep start-up fast.
_KEYWORD: Final = rb"(?m)^[*/]"
STARTER: Final = rb"(?mi)^/BEGIN"
ENGINE: Final = rb"(?mi)^/RUN/"
_NUMBERED: Final = r"(?is)(.+)_(\d{4})\.rad"
_NAME: Final = rb"(?mi)^/BEGIN[^\n]*\n(?:[#$][^\n]*\n)*([^\n]*)|^/RUN/([^/\n]+)"


class Flaw(NamedTuple):
    """A flaw of a Radioss run: a stable ``code``, its place and its message.

    The code `NOT_FOLLOWED` means that something could not be checked, which the message names.
    """

    code: str
    place: CardField
    message: str


def is_radioss(head: bytes) -> bool:
    """Return True if a file with these first bytes is a starter deck or an engine file."""
    first = re.search(_KEYWORD, head)
    return (
        first is not None
        and first[0] == b"/"
        and bool(re.search(STARTER, head) or re.search(ENGINE, head))
    )


def find_packed_starter(path: str) -> str:
    """Return the packed starter deck beside an engine file NAME_0001.rad; empty if there is none."""
    numbered = re.fullmatch(_NUMBERED, path)
    packed = f"{numbered[1]}_0000.rad.gz" if numbered else ""
    return packed if packed and os.path.isfile(packed) else ""  # noqa: PTH113  pathlib would slow down start-up


def list_run_files(path: str) -> list[str]:
    """Return the files of the run to which ``path`` belongs; empty if it is not a file of a Radioss run.

    The starter deck ``NAME_0000.rad`` and the engine files ``NAME_0001.rad`` and so on in one folder belong together. A
    file with a different name belongs to the run that it names in /BEGIN or /RUN.
    """
    try:
        if not os.path.isfile(path):  # noqa: PTH113  pathlib would slow down start-up
            return []  # A pipe can be read only once.
        with open(path, "rb", buffering=0) as stream:  # noqa: PTH123  pathlib would slow down start-up
            # Reading a file into a buffer larger than the file takes ten times as long.
            head = stream.read(min(HEAD, os.fstat(stream.fileno()).st_size))
        if not is_radioss(head):
            return []
        from pathlib import Path  # Imported here to keep start-up fast.

        folder = Path(path).parent
        file_names = sorted(os.listdir(folder))  # noqa: PTH208  pathlib is slow for many runs
    except (OSError, ValueError):
        return []  # The error is reported by the reader of the file.
    name = _find_run_name(path, head)
    numbered = (
        re.fullmatch(_NUMBERED, file_name)
        for file_name in file_names
        if file_name.startswith(name)
    )
    alike = (folder / match[0] for match in numbered if match and match[1] == name)
    files = [str(file_name) for file_name in alike if file_name.is_file()]
    if any(Path(path).samefile(file_name) for file_name in files):
        return files
    return [path, *files]


def find_root(path: str) -> str:
    """Return the common prefix of a run's file names, such as ``NAME`` for ``NAME_0001.rad``; empty if there is none.

    The engine looks for the restart file whose name has the same beginning as its own file, regardless of the name in
    /RUN. Source: runs computed with OpenRadioss.
    """
    numbered = re.fullmatch(_NUMBERED, os.path.basename(path))  # noqa: PTH119  pathlib would slow down start-up
    return numbered[1] if numbered else ""


def _find_run_name(path: str, head: bytes) -> str:
    """Return the run name from the name of a file or, failing that, from its content."""
    if root := find_root(path):
        return root
    match = re.search(_NAME, head)
    return (match[1] or match[2] or b"").decode("latin-1").strip() if match else ""
