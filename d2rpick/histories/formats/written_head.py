"""The head of a glstat or matsum that we write."""

from __future__ import annotations

from d2rpick.version import __version__


def written_head(title: str, database: str) -> str:
    """Two lines as solvers write them; no release of a solver wrote this, its name alone tells the layout."""
    return f" {title}\n{' ' * 25}d2rpick {__version__}, layout of ls-dyna {database}\n"
