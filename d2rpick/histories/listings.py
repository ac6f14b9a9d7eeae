"""What the engine's listings beside the histories of a Radioss run tell of the engine that computed it.

Source: the published source of OpenRadioss (radioss_title.F, rbyonf.F, or_build_info.py), its pull request 4538 and its
commit 780156a9a, and listings of runs.
"""

from __future__ import annotations

import os
import re
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

_HISTORY: Final = re.compile(r"(?P<root>.+)T(?P<leg>\d\d)(\.csv)?(\.gz)?", re.DOTALL)
_HEAD, _TAIL = 1 << 20, 1 << 16  # bytes: the engine echoes its input, and tells when it ran at the end
_SWITCHED: Final = re.compile(rb"RIGID BODY: *\d+ +SET O(?:N|FF)")
_COMMIT: Final = re.compile(rb"CommitID: *([0-9a-f]{7,40})\b")
_BUILT: Final = re.compile(rb"COPYRIGHT \(C\) (?:\d{4}-)?(\d{4})")  # the year is that of the build
_RAN: Final = re.compile(rb"EXECUTION (?:STARTED|COMPLETED) *[.:]+ *(\d{4})/(\d\d)/(\d\d)")
_FIXED: Final = (2026, 1, 13)
# Commits from the last weeks before the fix, which may have been built in its year.
_BEFORE: Final = (
    "49d9807 fe00fc0 ec1d512 76c61f5 52050b0 e28e42b 2b7ab50 6068aa2 0043df5 20f7b7f 0387857 c43d89c c36006f 670017c "
    "df5cc2b 047586b c3dff92 3844b9a 8751b9d f7fed09 cb26b37 062cdd8 e6f5601 ddf0b52 36f7b44 bcc1391 835210e 379fcb2 "
    "9e0e860 26e6573 0905ab7 96c6242 055fbad 9344188 cdf7934 49ecd10 eb51543 c2cb8fa 534623f 46f299a 8de64c8 43562a9 "
    "0260a03 d136353 7ca05a4 abdd714 0fd23b1 898ac63 9e2cfb1"
)
_SHORT: Final = 7  # digits of a commit


def wrong_energies(histories: Iterable[str]) -> Iterator[str]:
    """Name the listings of restarts whose engine reports a wrong internal energy, and how that is seen.

    OpenRadioss before its fix of January 2026 counts the energy of elements wrongly that /RBODY/ON or /RBODY/OFF of a
    restart switches.  Nothing is told where the listing does not show when the engine was built.
    """
    for name in histories:
        found = _HISTORY.fullmatch(name)
        if found and int(found["leg"]) > 1:
            listing = f"{found['root']}_{int(found['leg']):04d}.out"
            old = _before_the_fix(*_ends(listing))
            if old:
                yield f"{listing}: {old}"


def _ends(path: str) -> tuple[bytes, bytes]:
    """Give the beginning and the end of a file; nothing of one that cannot be read."""
    try:
        with open(path, "rb") as stream:  # noqa: PTH123  start-up
            head = stream.read(_HEAD)
            stream.seek(max(os.fstat(stream.fileno()).st_size - _TAIL, 0))
            return head, stream.read()
    except (OSError, ValueError):
        return b"", b""


def _before_the_fix(head: bytes, tail: bytes) -> str:
    """Say what shows that an engine that switches bodies is from before the fix; nothing where nothing does."""
    if b"OpenRadioss" not in head or not _SWITCHED.search(head):
        return ""
    commit, built, ran = _COMMIT.search(head), _BUILT.search(head), _RAN.search(tail)
    if commit and commit[1][:_SHORT].decode() in _BEFORE:
        return f"commit {commit[1].decode()[:9]}"
    if built and int(built[1]) < _FIXED[0]:
        return f"built in {int(built[1])}"
    if ran and tuple(map(int, ran.groups())) < _FIXED:
        return f"run on {b'-'.join(ran.groups()).decode()}"
    return ""
