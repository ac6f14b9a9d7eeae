"""Finding the cards in a 50 MB deck against a plain line loop, with its memory; run as a module."""

from __future__ import annotations

import statistics
import sys
import time
import tracemalloc
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from d2rpick.deck import find_windows, read_deck, read_parts, read_switching
from d2rpick.rules import check_deck
from d2rpick.rules.example_decks import BACK, HEAD, PARTS, THERE

if TYPE_CHECKING:
    from collections.abc import Callable

NODES = ELEMENTS = 408_321
ROUNDS = 7
MEGABYTE = 1e6
GOAL_SHARE, GOAL_MEMORY = 1 / 3, 32


def write_deck(path: Path) -> None:
    """Write 50 MB of mesh with the switching cards behind it."""
    with path.open("w", encoding="ascii") as deck:
        deck.write(HEAD + PARTS + "*NODE\n")
        deck.writelines(
            f"{n:8d}{n * 0.5:16.7f}{-n * 0.25:16.7f}{n % 641:16.7f}       0       0\n" for n in range(1, NODES + 1)
        )
        deck.write("*ELEMENT_SHELL\n")
        deck.writelines(
            f"{n:8d}{n % 2 + 1:8d}{n:8d}{n + 1:8d}{n + 641:8d}{n + 640:8d}\n" for n in range(1, ELEMENTS + 1)
        )
        deck.write(THERE + BACK)


def line_loop(path: Path) -> int:
    """Count keywords as a plain loop does."""
    with path.open("rb") as deck:
        return sum(line.startswith(b"*") for line in deck)


def median_ms(action: Callable[[], object]) -> float:
    """Median of some runs."""
    times = []
    for _ in range(ROUNDS):
        start = time.perf_counter()
        action()
        times.append(time.perf_counter() - start)
    return 1e3 * statistics.median(times)


def find(path: Path) -> None:
    """Find the cards and derive the windows."""
    deck = read_deck(str(path))
    found = find_windows(read_switching(deck), read_parts(deck)).windows
    assert [(window.part, window.tr, window.td) for window in found] == [(1, 0.02, 0.09)]


def main() -> int:
    """Measure, print, and return 1 when a goal is missed."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "big.k"
        write_deck(path)
        assert line_loop(path) == 10
        loop, cards = median_ms(lambda: line_loop(path)), median_ms(lambda: find(path))
        whole = median_ms(lambda: check_deck(str(path)))
        lines = median_ms(lambda: [card.line for card in read_deck(str(path)).cards])
        tracemalloc.start()
        find(path)
        memory = tracemalloc.get_traced_memory()[1] / MEGABYTE
        tracemalloc.stop()
        print(f"deck {path.stat().st_size / MEGABYTE:.1f} MB")
    print(f"line loop {loop:.1f} ms; cards and windows {cards:.1f} ms = {cards / loop:.2f} of it (goal 0.33)")
    print(f"with the line numbers of all cards {lines:.1f} ms = {lines / loop:.2f} of it")
    print(f"whole check {whole:.1f} ms; memory for the cards {memory:.1f} MB (goal {GOAL_MEMORY})")
    return int(cards / loop > GOAL_SHARE or memory > GOAL_MEMORY)


if __name__ == "__main__":
    sys.exit(main())
