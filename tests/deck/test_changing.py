"""Decks that are cut, rewritten or replaced while they are read give one of their states or an error, never a mix."""

import builtins
import itertools
import os
import shutil
import time
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

from d2rpick.base.errors import DeckError
from d2rpick.deck import find_main_decks, read_inventory
from d2rpick.deck.printed_card import Printing
from d2rpick.deck.printing import print_cards
from d2rpick.deck.reader import read_deck
from d2rpick.deck.writing import write_deck
from d2rpick.rules import RULES, check_deck
from d2rpick.rules.example import PARTS
from d2rpick.rules.rule import BACK, GOOD, THERE
from tests.decks import list_spans, write
from tests.sample_deck import DECK

WINDOW = [(1, 0.02, 0.09)]
RUN = RULES["D2R401"].passing[0]
LATER = "$ moved\n" * 3 + GOOD.replace("0.09", "0.07").replace("door", "a long door")
CARDS, OTHER_CARDS = (
    {"cards.k": THERE + BACK},
    "$\n" + BACK + THERE.replace("0.02", "0.03"),
)
ONCE = f"*KEYWORD\n{PARTS}*INCLUDE\ncards.k\n*END\n"
TWICE = ONCE.replace(
    "*END", f"*INCLUDE_TRANSFORM\ncards.k\n{0:10d}{0:10d}{1:10d}\n*END"
)


# Sizes of comments added to a deck. A file above 256 KiB stays on disk; one above 4 MiB is searched by
# threads, and read in pieces.
SIZES = {"small": 0, "big": 300_000, "big, by threads": 5_000_000}

THREADED = (
    "deck",
    "elements",
)  # the reads of one file do not depend on the number of files


def grow_text(text: str, size: str) -> str:
    """Return a deck with comments of this size in its middle, so that a cut leaves half of the deck."""
    middle = text.index("\n", len(text) // 2) + 1
    sign = "#" if text[0] in "#/" else "$"
    return (
        text[:middle] + (sign + "x" * 98 + "\n") * (SIZES[size] // 100) + text[middle:]
    )


@contextmanager
def change_after(turns: int, change: Callable[[], None]) -> Iterator[list[int]]:
    """Change something before the file access number ``turns``; provide the number of accesses so far."""
    taken: list[int] = []

    def at_the_turn(function: Callable[..., Any]) -> Callable[..., Any]:
        def called(*args: Any, **options: Any) -> Any:
            taken.append(len(taken))
            if taken[-1] == turns:
                change()
            return function(*args, **options)

        return called

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(builtins, "open", at_the_turn(open))
        if hasattr(os, "preadv"):
            patch.setattr(os, "preadv", at_the_turn(os.preadv))
        yield taken


def cut_file(file: Path, _: str) -> None:
    os.truncate(file, file.stat().st_size // 2)


def clear_file(file: Path, _: str) -> None:
    os.truncate(file, 0)


def rewrite_file(file: Path, text: str) -> None:
    file.write_text(text)


def rewrite_in_place(file: Path, text: str) -> None:
    """Rewrite the file with a text of the same length."""
    size = file.stat().st_size
    with file.open("r+") as target:
        target.write(text[:size].ljust(size, "\n"))


def replace_file(file: Path, text: str) -> None:
    new = file.with_name("new")
    new.write_text(text)
    new.replace(file)


CHANGES = [cut_file, clear_file, rewrite_file, rewrite_in_place, replace_file]


def find_verdict(path: str) -> Hashable:
    checked = check_deck(path)
    return (
        tuple(
            (window.part, window.tr, window.td, window.place.line)
            for window in checked.windows
        ),
        tuple(
            (finding.rule, finding.file, finding.line, finding.message)
            for finding in checked.findings
        ),
    )


def read_parts_of(path: str) -> Hashable:
    inventory = read_inventory(path)
    return tuple(
        (part, *counts.items()) for part, counts in sorted(inventory.counts.items())
    ), inventory.notes


def find_answer(ask: Callable[[str], Hashable], path: str) -> Hashable:
    """Return the result, or the text of the error."""
    try:
        return ask(path)
    except DeckError as error:
        return str(error)


def make_older(folder: Path) -> None:
    """Make the files look old, so that any later change alters their times."""
    for file in folder.iterdir():
        os.utime(file, (1e9, 1e9))


CASES = {
    "deck": (find_verdict, GOOD, {}, "main.k", LATER),
    "include": (find_verdict, ONCE, CARDS, "cards.k", OTHER_CARDS),
    "included twice": (find_verdict, TWICE, CARDS, "cards.k", OTHER_CARDS),
    "starter": (find_verdict, RUN.deck, RUN.files, RUN.name, "#\n" + RUN.deck.replace("1808", "1809")),
    "engine": (find_verdict, RUN.deck, RUN.files, "box_0002.rad", "#\n" + RUN.files["box_0002.rad"].replace(".09",
    ".07")),
    "elements": (read_parts_of, DECK.read_text(), {}, "main.k", DECK.read_text().replace("*ELEMENT",
    "$\n*ELEMENT")[:9000]),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(
    ("case", "size", "change"),
    [
        *((case, "big", change) for case in CASES for change in CHANGES),
        *((case, "small", cut_file) for case in CASES),
        *(
            (case, "big, by threads", change)
            for case in THREADED
            for change in (cut_file, replace_file)
        ),
    ],
)
def test_a_change_at_any_moment_gives_one_of_the_states_or_an_error(
    case: str, change: Callable[[Path, str], None], size: str, tmp_path: Path
) -> None:
    ask, deck, files, changed, text = CASES[case]
    name = RUN.name if deck is RUN.deck else "main.k"
    texts = {**files, name: deck}
    texts[changed], text = grow_text(texts[changed], size), grow_text(text, size)
    path, file = write(tmp_path, texts[name], texts, name), tmp_path / changed
    first_state = find_answer(ask, path)
    change(file, text)
    second_state = find_answer(ask, path)
    assert first_state != second_state
    outcomes = set()
    for turn in itertools.count():
        write(tmp_path, texts[name], texts, name)
        make_older(tmp_path)
        with change_after(turn, lambda: change(file, text)) as taken:
            outcomes.add(find_answer(ask, path))
        if len(taken) <= turn:
            break  # the file was read before the change
    errors = {error for error in outcomes if isinstance(error, str)} - {
        first_state,
        second_state,
    }
    assert outcomes - errors <= {first_state, second_state}
    assert not [error for error in errors if "\n" in error]
    assert all(
        "rewritten or replaced while it was read" in error or "was found" in error
        for error in errors
    )
    if size != "small":
        assert any(
            "rewritten or replaced while it was read" in error for error in errors
        )


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("change", CHANGES)
def test_rows_that_are_read_late_are_those_of_the_keywords(
    change: Callable[[Path, str], None], size: str, tmp_path: Path
) -> None:
    deck = read_deck(write(tmp_path, grow_text(GOOD, size)))
    make_older(tmp_path)
    deck = read_deck(deck.path)
    change(tmp_path / "main.k", LATER)
    if size == "small":
        assert list_spans(deck) == WINDOW
    else:
        with pytest.raises(
            DeckError,
            match=r"main\.k: the file was rewritten or replaced while it was read; read it",
        ):
            list_spans(deck)


@pytest.mark.parametrize("size", ["small", "big"])
def test_what_is_written_is_what_was_checked(size: str, tmp_path: Path) -> None:
    """Both files may be rewritten at any time with cards that `write_deck` refuses."""
    mesh = grow_text("*NODE\n$ of a mesh\n", size)
    text, files = f"*KEYWORD\n{PARTS}{mesh}*INCLUDE\nmore.k\n*END\n", {"more.k": mesh}
    read_calls = (
        str(tmp_path / "main.k"),
        print_cards([(0.02, 0.09)], Printing(part=(1,))),
        str(tmp_path / "next"),
    )

    def change() -> None:
        rewrite_file(tmp_path / "main.k", LATER)
        rewrite_file(tmp_path / "more.k", THERE)

    refusals = set()
    for turn in itertools.count():
        write(tmp_path, text, files)
        make_older(tmp_path)
        with change_after(turn, change) as taken:
            try:
                written, _, added_part = write_deck(*read_calls)
            except DeckError as error:
                refusals.add(str(error).split(": ")[1])
                assert not (tmp_path / "next").exists()
            else:
                assert PARTS + mesh in Path(written).read_text()
                assert Path(added_part).read_text() == mesh
                shutil.rmtree(tmp_path / "next")
        if len(taken) <= turn:
            break
    assert {refusal.partition(";")[0] for refusal in refusals} == {
        "the file was rewritten or replaced while it was read",
        "the deck switches part 1 already",
    }


@pytest.mark.usefixtures("new_files")
@pytest.mark.parametrize("size", ["small", "big"])
@pytest.mark.parametrize("share", [0.0, 0.3, 0.99])
def test_a_deck_that_is_half_saved_is_read_when_it_is_whole(
    size: str, share: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = grow_text(GOOD, size)
    written = int(share * len(text))
    path = write(tmp_path, text[:written])

    def write_the_rest(_: float) -> None:
        if (tmp_path / "main.k").stat().st_size == written:
            write(tmp_path, text)

    monkeypatch.setattr(time, "sleep", write_the_rest)
    assert list_spans(read_deck(path)) == WINDOW


@pytest.mark.usefixtures("new_files")
@pytest.mark.parametrize("size", ["small", "big"])
def test_a_deck_that_changes_all_the_time_is_an_error(
    size: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text, number = grow_text(GOOD, size), itertools.count()
    path = write(tmp_path, text)
    monkeypatch.setattr(
        time, "sleep", lambda _: write(tmp_path, f"${'x' * next(number)}\n{text}")
    )
    with pytest.raises(
        DeckError,
        match=r"main\.k: the file keeps changing while it is read; read it again",
    ):
        read_deck(path)
    assert find_main_decks(str(tmp_path)) == [path]  # the file is not skipped


def test_an_engine_file_alone_in_a_folder_is_named(tmp_path: Path) -> None:
    engine = tmp_path / "car_0001.rad"
    engine.write_text("/RUN/car/1\n0.01\n/END\n")
    with pytest.raises(
        DeckError, match=r"only engine files.*or give the engine file .*car_0001\.rad$"
    ):
        find_main_decks(str(tmp_path))


def test_a_pipe_gives_its_bytes_once_and_hangs_no_folder(tmp_path: Path) -> None:
    main, pipe = write(tmp_path, GOOD), tmp_path / "pipe.k"
    os.mkfifo(pipe)
    assert find_main_decks(str(tmp_path)) == [main]
    writer = Thread(target=lambda: pipe.write_text(GOOD))
    writer.start()
    assert list_spans(read_deck(str(pipe))) == WINDOW
    writer.join()


@pytest.mark.usefixtures("new_files")
def test_no_folder_of_decks_waits_for_what_a_solver_writes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    main, waited = write(tmp_path, GOOD), list[float]()
    with (tmp_path / "d3plot").open("wb") as results:
        results.truncate(20 << 30)
    monkeypatch.setattr(time, "sleep", waited.append)
    assert find_main_decks(str(tmp_path)) == [main]
    assert sum(waited) < 1
