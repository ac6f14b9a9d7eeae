"""Continue reading growing files: a later read uses only the header of a file and its last states."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.base.tuples import NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping


class ResumePoint(NamedTuple):
    """The position at which a later read of a growing file can begin.

    ``head``, followed by the bytes of the file from ``begin`` on, is a file of the same format that contains only the
    last states. ``end`` is the offset after the last complete state; in a state that was read after it, some lines are
    missing.
    """

    head: bytes
    begin: int
    end: int

    def read_on(self, name: str) -> bytes:
        """Return the header of a file and its bytes after ``begin``; raise OSError if it cannot be read."""
        with open(name, "rb") as stream:  # noqa: PTH123  pathlib would slow down start-up
            stream.seek(self.begin)
            return self.head + stream.read()

    def locate(self, point: ResumePoint) -> ResumePoint:
        """Convert a resume point in the bytes that `read_on` returned to a resume point in the file."""
        skipped = self.begin - len(self.head)
        return ResumePoint(point.head, point.begin + skipped, point.end + skipped)


def join_resume_points(
    points_of_files: Iterable[Mapping[str, ResumePoint]],
) -> dict[str, ResumePoint]:
    """Return the resume points of several files by file name; empty for a file that is always read completely."""
    joined: dict[str, ResumePoint] = {}
    for points in points_of_files:
        if not points:
            return {}
        joined |= points
    return joined
