"""Decks that are cut, rewritten or replaced while they are read: one of their states or an error, never a mix."""

from __future__ import annotations

import itertools
import os
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING, Any

import pytest

from d2rpick.deck import marks, read_deck, source, stored, writing
from d2rpick.deck.folder import main_decks
from d2rpick.deck.inventory import read_inventory
from d2rpick.deck.printing import cards
from d2rpick.deck.printing.common import Printing
from d2rpick.errors import DeckError
from d2rpick.rules import RULES, check_deck
from d2rpick.rules.example_decks import BACK, GOOD, PARTS, THERE
from tests.decks import spans, write
from tests.sample_deck import DECK

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable

WINDOW = [(1, 0.02, 0.09)]
RUN = RULES["D2R401"].passing[0]
LATER = "$ moved\n" * 3 + GOOD.replace("0.09", "0.07").replace("door", "a long door")
CARDS, OTHER_CARDS = {"cards.k": THERE + BACK}, "$\n" + BACK + THERE.replace("0.02", "0.03")
ONCE = f"*KEYWORD\n{PARTS}*INCLUDE\ncards.k\n*END\n"
TWICE = ONCE.replace("*END", f"*INCLUDE_TRANSFORM\ncards.k\n{0:10d}{0:10d}{1:10d}\n*END")


@pytest.fixture(params=["small", "big", "big, by threads"])
def size(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Treat every file as a small one, or as a big one that is read in small pieces."""
    if request.param != "small":
        for module, name, value in ((stored, "_HELD", 0), (stored, "_WINDOW", 400), (source, "_PIECE", 300)):
            monkeypatch.setattr(module, name, value)
        monkeypatch.setattr(marks, "_PIECE", 200)
    if request.param.endswith("threads"):
        monkeypatch.setattr(marks, "_ALONE", 0)
        monkeypatch.setattr(marks, "_HELPERS", 2)
    return str(request.param)


def cut(file: Path, _: str) -> None:
    os.truncate(file, file.stat().st_size // 2)


def empty(file: Path, _: str) -> None:
    os.truncate(file, 0)


def rewrite(file: Path, text: str) -> None:
    file.write_text(text)


def rewrite_in_place(file: Path, text: str) -> None:
    """As long as before."""
    size = file.stat().st_size
    with file.open("r+") as target:
        target.write(text[:size].ljust(size, "\n"))


def replace(file: Path, text: str) -> None:
    new = file.with_name("new")
    new.write_text(text)
    new.replace(file)


CHANGES = [cut, empty, rewrite, rewrite_in_place, replace]


def verdict(path: str) -> Hashable:
    found = check_deck(path)
    return (
        tuple((window.part, window.tr, window.td, window.opened.by.card.line) for window in found.windows),
        tuple((one.rule, one.file, one.line, one.message) for one in found.findings),
    )


def parts(path: str) -> Hashable:
    found = read_inventory(path)
    return tuple((part, *counts.items()) for part, counts in sorted(found.counts.items())), found.notes


def answer(ask: Callable[[str], Hashable], path: str) -> Hashable:
    """What is found, or the error."""
    try:
        return ask(path)
    except DeckError as error:
        return str(error)


def age(folder: Path) -> None:
    """Let files look old, so that a change shows in their times however soon it comes."""
    for file in folder.iterdir():
        os.utime(file, (1e9, 1e9))


CASES = {
    "deck": (verdict, GOOD, {}, "main.k", LATER),
    "include": (verdict, ONCE, CARDS, "cards.k", OTHER_CARDS),
    "included twice": (verdict, TWICE, CARDS, "cards.k", OTHER_CARDS),
    "starter": (verdict, RUN.deck, RUN.files, RUN.name, "#\n" + RUN.deck.replace("1808", "1809")),
    "engine": (verdict, RUN.deck, RUN.files, "box_0002.rad", "#\n" + RUN.files["box_0002.rad"].replace(".09", ".07")),
    "elements": (parts, DECK.read_text(), {}, "main.k", DECK.read_text().replace("*ELEMENT", "$\n*ELEMENT")[:9000]),
}  # fmt: skip


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("case", CASES)
def test_a_change_at_any_moment_gives_one_of_the_states_or_an_error(
    case: str, change: Callable[[Path, str], None], size: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ask, deck, files, changed, text = CASES[case]
    name = RUN.name if deck is RUN.deck else "main.k"
    path, file = write(tmp_path, deck, files, name), tmp_path / changed
    before = answer(ask, path)
    change(file, text)
    after = answer(ask, path)
    assert before != after
    waiting = itertools.count()

    def at_the_turn(function: Callable[..., Any]) -> Callable[..., Any]:
        def called(*args: object) -> object:
            if next(waiting) == 0:
                change(file, text)
            return function(*args)

        return called

    monkeypatch.setattr(stored, "_opened", at_the_turn(stored._opened))
    monkeypatch.setattr(stored.OnDisk, "_fill", at_the_turn(stored.OnDisk._fill))
    found = set()
    step = 7 if ask is parts else 1
    for turn in itertools.count():
        write(tmp_path, deck, files, name)
        age(tmp_path)
        waiting = itertools.count(-turn * step)
        found.add(answer(ask, path))
        if next(waiting) <= 0:
            break  # it was read before the change
    errors = {one for one in found if isinstance(one, str)} - {before, after}
    assert found - errors <= {before, after}
    assert not [one for one in errors if "\n" in one]
    assert all("rewritten or replaced while it was read" in one or "was found" in one for one in errors)
    if size != "small":
        assert any("rewritten or replaced while it was read" in one for one in errors)


@pytest.mark.parametrize("change", CHANGES)
def test_rows_that_are_read_late_are_those_of_the_keywords(
    change: Callable[[Path, str], None], size: str, tmp_path: Path
) -> None:
    deck = read_deck(write(tmp_path, GOOD))
    age(tmp_path)
    deck = read_deck(deck.path)
    change(tmp_path / "main.k", LATER)
    if size == "small":
        assert spans(deck) == WINDOW
    else:
        with pytest.raises(DeckError, match=r"main\.k: the file was rewritten or replaced while it was read; read it"):
            spans(deck)


def test_what_is_written_is_what_was_checked(size: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = "*NODE\n" + "$ of a mesh\n" * 100
    main = write(tmp_path, f"*KEYWORD\n{PARTS}{mesh}*INCLUDE\nmore.k\n*END\n", {"more.k": mesh})
    age(tmp_path)
    look = writing._refuse_switched

    def then_change(*args: Any) -> None:
        look(*args)
        rewrite(tmp_path / "main.k", LATER)
        rewrite(tmp_path / "more.k", THERE)

    monkeypatch.setattr(writing, "_refuse_switched", then_change)
    asked = main, cards([(0.02, 0.09)], Printing(part=(1,))), str(tmp_path / "next")
    if size == "small":
        written, _, more = writing.write_deck(*asked)
        assert PARTS in Path(written).read_text()
        assert Path(more).read_text() == mesh
    else:
        with pytest.raises(DeckError, match="rewritten or replaced"):
            writing.write_deck(*asked)
        assert not (tmp_path / "next").exists()


@pytest.mark.usefixtures("size")
@pytest.mark.parametrize("share", [0.0, 0.3, 0.99])
def test_a_deck_that_is_half_saved_is_read_when_it_is_whole(
    share: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written = int(share * len(GOOD))
    path = write(tmp_path, GOOD[:written])

    def write_the_rest(_: float) -> None:
        if (tmp_path / "main.k").stat().st_size == written:
            write(tmp_path, GOOD)

    monkeypatch.setattr("d2rpick.file_state.time.sleep", write_the_rest)
    assert spans(read_deck(path)) == WINDOW


@pytest.mark.usefixtures("size")
def test_a_deck_that_changes_all_the_time_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, number = write(tmp_path, GOOD), itertools.count()
    monkeypatch.setattr("d2rpick.file_state.time.sleep", lambda _: write(tmp_path, f"${'x' * next(number)}\n{GOOD}"))
    with pytest.raises(DeckError, match=r"main\.k: the file keeps changing while it is read; read it again"):
        read_deck(path)
    assert main_decks(str(tmp_path)) == [path]  # it is not passed over


@pytest.mark.usefixtures("size")
def test_a_pipe_gives_its_bytes_once_and_hangs_no_folder(tmp_path: Path) -> None:
    main, pipe = write(tmp_path, GOOD), tmp_path / "pipe.k"
    os.mkfifo(pipe)
    assert main_decks(str(tmp_path)) == [main]
    writer = Thread(target=lambda: pipe.write_text(GOOD))
    writer.start()
    assert spans(read_deck(str(pipe))) == WINDOW
    writer.join()


def test_no_folder_of_decks_waits_for_what_a_solver_writes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    main, waited = write(tmp_path, GOOD), list[float]()
    with (tmp_path / "d3plot").open("wb") as results:
        results.truncate(20 << 30)
    monkeypatch.setattr("d2rpick.file_state.time.sleep", waited.append)
    assert main_decks(str(tmp_path)) == [main]
    assert sum(waited) < 1
