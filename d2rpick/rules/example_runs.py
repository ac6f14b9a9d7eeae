"""Pieces that the examples of the rules for Radioss runs are put together from."""

from __future__ import annotations

from typing import Final

from d2rpick.rules.base import Example

GROUP: Final = "/GRNOD/PART/7\nbox\n         1\n"
_SHELL: Final = "/SHELL/1\n         1         1         2         3         4\n"
_BODY: Final = "/RBODY/1\nbox\n{}         0         0         0                   0         7\n"


def starter_deck(group: str = GROUP, body: str = "      1808", more: str = "") -> str:
    """Write a starter deck: a part that is one rigid body, by its group of nodes, and whatever there is ``more``."""
    head = "#RADIOSS STARTER\n/BEGIN\nbox\n      2022         0\n/TITLE\na box\n/PART/1\nbox\n         1         1\n"
    return f"{head}{_SHELL}{_BODY.format(body)}{group}{more}/END\n"


def engine_files(*legs: tuple[str, str], cap: str = "1e-5 1e-5", node: str = "1808") -> dict[str, str]:
    """Write engine files: end and state of every leg."""
    files = {}
    for number, (stop, state) in enumerate(legs, start=1):
        limit = f"/DTIX\n{cap}\n" if state == "ON" and cap else ""
        switch = f"/RBODY/{state}\n{node}\n" if state else ""
        files[f"box_{number:04d}.rad"] = f"/RUN/box/{number}\n{stop:>20}\n/VERS/2022\n{switch}{limit}"
    return files


def run_of(files: dict[str, str], deck: str = "") -> Example:
    """Put a starter deck and its engine files together."""
    return Example(deck or starter_deck(), files, name="box_0000.rad")


WINDOW: Final = (("0.02", "OFF"), ("0.09", "ON"), ("0.2", "OFF"))
GOOD_RUN: Final = run_of(engine_files(*WINDOW))
