"""Cost and memory of finding the cards in a 50 MB deck, compared with a loop over lines; checks of many small decks."""

from __future__ import annotations

import os
import tracemalloc
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from d2rpick.api.checking import check as checked
from d2rpick.deck.ls_dyna_parts import read_parts
from d2rpick.deck.reader import read_deck
from d2rpick.deck.switching import find_windows, read_switching
from d2rpick.rules import check_deck
from d2rpick.rules.example import END, HEAD, PARTS
from d2rpick.rules.rule import BACK, GOOD, THERE
from tests.benchmarks.timing import measure_own_seconds, measure_ratio

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

NODES = ELEMENTS = 408_321
MEGABYTE = 1e6
_ROUNDS = 5


@contextmanager
def write_large_deck() -> Iterator[Path]:
    """Write 50 MB of mesh followed by the D2R cards; yield the path."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "large.k"
        with path.open("w", encoding="ascii") as deck:
            deck.write(HEAD + PARTS + "*NODE\n")
            deck.writelines(
                f"{n:8d}{n * 0.5:16.7f}{-n * 0.25:16.7f}{n % 641:16.7f}       0       0\n"
                for n in range(1, NODES + 1)
            )
            deck.write("*ELEMENT_SHELL\n")
            deck.writelines(
                f"{n:8d}{n % 2 + 1:8d}{n:8d}{n + 1:8d}{n + 641:8d}{n + 640:8d}\n"
                for n in range(1, ELEMENTS + 1)
            )
            deck.write(THERE + BACK)
        assert path.stat().st_size > 49 * MEGABYTE
        yield path


def count_by_line_loop(path: Path) -> None:
    """Count keywords as a plain loop does."""
    with path.open("rb") as deck:
        assert sum(line.startswith(b"*") for line in deck) == 10


def find_cards(path: Path) -> None:
    """Find the cards and derive the windows."""
    deck = read_deck(str(path))
    windows = find_windows(read_switching(deck), read_parts(deck)).windows
    assert [(window.part, window.tr, window.td) for window in windows] == [
        (1, 0.02, 0.09)
    ]


def number_cards(path: Path) -> None:
    """Find the cards, and determine the line number of each."""
    assert [card.line for card in read_deck(str(path)).cards][-1] == 2 * NODES + 22


def inventory(path: Path) -> None:
    """Count the elements of every part, with masses, time steps and shared nodes."""
    from d2rpick.deck import read_inventory
    from d2rpick.deck.geometry import compute_masses_and_steps

    inventory_found = read_inventory(str(path))
    assert sum(counts.total() for counts in inventory_found.counts.values()) == ELEMENTS
    assert inventory_found.neighbours[1] == {2}
    assert set(compute_masses_and_steps(inventory_found)) == {1, 2}


def check(path: Path) -> None:
    """Read the deck and apply all rules."""
    assert [window.td for window in check_deck(str(path)).windows] == [0.09]


def dynars_parser() -> Callable[[Path], None] | None:
    """Return the parser of dynars, which finds keywords and the first rows of their cards; None if not installed."""
    try:
        parse_deck = import_module("dynars").parse_deck
    except ImportError:
        return None

    def parse(path: Path) -> None:
        keywords = parse_deck(str(path)).keywords("DEFORMABLE_TO_RIGID_AUTOMATIC")
        assert [card.field("time1") for card in keywords] == [0.02, 0.09]

    return parse


def to_loop(task: str) -> float:
    """Return the cost of finding cards, line numbers, or parts and elements over that of a loop over all lines."""
    ours = {
        "cards": find_cards,
        "lines of cards": number_cards,
        "inventory": inventory,
    }[task]
    with write_large_deck() as path:
        return measure_ratio(
            lambda: ours(path), lambda: count_by_line_loop(path), _ROUNDS
        )


def troubled_to_loop(trouble: str) -> float:
    """Return the CPU time of checking a deck with 20,000 faults over that of a loop over its lines."""
    numbers = range(10, 20_010)
    deck = {
        "parts on one card": "*PART\n"
        + "".join(f"door\n{n:10d}{1:10d}{1:10d}\n" for n in numbers),
        "rigid bodies": "".join(
            f"*CONSTRAINED_NODAL_RIGID_BODY\n{n:10d}{0:10d}{n:10d}\n*SET_NODE_LIST\n{n:10d}\n{n:10d}\n"
            for n in numbers
        ),
        "boxes of comments": f"$ {'*' * 70}\n$ {'G' * 70}\n" * len(numbers),
    }[trouble]
    with TemporaryDirectory() as folder:
        path = Path(folder) / "main.k"
        path.write_text(HEAD + PARTS + THERE + deck + BACK + END, "ascii")
        return measure_ratio(
            lambda: check(path),
            lambda: sum(1 for _ in path.open("rb")),
            _ROUNDS,
            cost=measure_own_seconds,
        )


def check_to_dynars() -> float | None:
    """Return the cost of checking the deck over that of parsing it with dynars; None if it is not installed."""
    parse = dynars_parser()
    if parse is None:
        return None
    with write_large_deck() as path:
        return measure_ratio(
            lambda: check(path), lambda: parse(path), 5 * _ROUNDS
        )  # the times are only milliseconds


def many_to_parse() -> float:
    """Return the CPU time of checking 1000 small decks by command over that of finding their cards."""
    with TemporaryDirectory() as folder:
        names = [str(Path(folder) / f"{number}.k") for number in range(1000)]
        for name in names:
            Path(name).write_text(GOOD, "ascii")
            os.utime(name, (1e9, 1e9))
        return measure_ratio(
            lambda: checked(names),
            lambda: [*map(read_deck, names)],
            _ROUNDS,
            cost=measure_own_seconds,
        )


def memory() -> float:
    """Return the peak memory of finding the cards [MB]."""
    with write_large_deck() as path:
        tracemalloc.start()
        find_cards(path)
        peak_memory = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    return peak_memory / MEGABYTE
