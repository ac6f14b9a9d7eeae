"""JSON documents and pages name every file on which an answer is based, with its SHA-256."""

import hashlib
from pathlib import Path

import pytest

import d2rpick as d2
from tests.command import MATSUM, run, run_json
from tests.json_schemas import run_json_checked
from tests.sample_deck import DECK

WEIGHTS = 'source = "our cluster"\n[per_element]\nBT = 1\nQBAT = 2\n'
ASKED = {
    "suggest": ("--td", "0.37", "--part", "all", "--no-verify"),
    "verify": ("--tr", "0.1", "--td", "0.37", "--part", "all", "--no-verify"),
    "explore": ("--steps", "3", "--part", "all", "--no-verify"),
    "plan": ("--part", "all", "--no-verify"),
    "parts": (),
}


def compute_digest(file: Path | str) -> str:
    return hashlib.sha256(Path(file).read_bytes()).hexdigest()


@pytest.fixture(autouse=True)
def deck(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Write a deck of two files, one of which is included twice, and weights."""
    monkeypatch.chdir(tmp_path)
    main = DECK.read_text("utf-8").replace(
        "*END", "*INCLUDE\nnote.k\n*INCLUDE\nnote.k\n*END"
    )
    Path("main.k").write_text(main, "utf-8")
    Path("note.k").write_text("*TITLE\nnothing\n", "utf-8")
    Path("site.toml").write_text(WEIGHTS, "utf-8")


@pytest.mark.slow
@pytest.mark.parametrize("command", ASKED)
def test_a_deck_and_weights_that_took_part_are_named(command: str) -> None:
    args = (command, *ASKED[command], "--deck", "main.k", MATSUM)
    deck_origin = {
        "source": ["main.k", "note.k"],
        "sha256": [compute_digest("main.k"), compute_digest("note.k")],
    }
    by_file = {
        "source": "our cluster",
        "file": "site.toml",
        "sha256": compute_digest("site.toml"),
    }
    document = run_json_checked(*args, "--weights", "site.toml")
    assert {key: document["deck"][key] for key in deck_origin} == deck_origin
    assert {key: document["weights"][key] for key in by_file} == by_file
    run(*args, "--weights", "site.toml", "--report", "page.html")
    page = Path("page.html").read_text("utf-8")
    for file in (MATSUM, "main.k", "note.k", "site.toml"):
        assert page.count(f"{file}: {compute_digest(file)}") == 1


@pytest.mark.parametrize("command", ASKED)
def test_without_a_deck_none_is_named(command: str) -> None:
    document = run_json(command, *ASKED[command], MATSUM)
    assert (document["deck"], document["weights"]) == (None, None)


def test_what_took_no_part_is_not_named() -> None:
    weights = run_json("suggest", *ASKED["suggest"], "--deck", "main.k", MATSUM)[
        "weights"
    ]
    assert (weights["file"], weights["sha256"]) == (
        None,
        None,
    )  # the weights of the package
    arguments = ("suggest", "--td", "0.37", "--deck", "main.k", MATSUM)
    assert run_json(*arguments)["deck"] is None  # without parts, a deck is not used
    document = run_json(
        *arguments, "--part", "all", "--weights", "site.toml", "--cost-share", "0.5"
    )
    assert document["deck"]["source"] == ["main.k", "note.k"]
    assert document["weights"] is None


@pytest.mark.slow
def test_the_library_names_them_too() -> None:
    suggestion = d2.suggest(
        d2.read(MATSUM),
        td=0.37,
        parts="all",
        replay=False,
        deck="main.k",
        weights="site.toml",
    )
    assert suggestion.to_dict()["weights"]["sha256"] == compute_digest("site.toml")
    assert compute_digest("note.k") in suggestion.report("page.html").read_text("utf-8")


@pytest.mark.slow
def test_of_a_deck_of_many_files_a_page_names_the_first() -> None:
    names = [f"part{number}.k" for number in range(30)]
    for name in names:
        Path(name).write_text("*TITLE\nnothing\n", "utf-8")
    includes = "".join(f"*INCLUDE\n{name}\n" for name in names)
    Path("main.k").write_text(
        DECK.read_text("utf-8").replace("*END", f"{includes}*END"), "utf-8"
    )
    arguments = ("suggest", *ASKED["suggest"], "--deck", "main.k", MATSUM)
    assert run_json(*arguments, "--report", "page.html")["deck"]["source"] == [
        "main.k",
        *names,
    ]
    page = Path("page.html").read_text("utf-8")
    assert ("part18.k: " in page, "part19.k: " in page) == (True, False)
    assert "of 11 more files of the deck: in the JSON result" in page
