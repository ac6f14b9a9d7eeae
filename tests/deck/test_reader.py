"""The reader: places of keywords and fields, formats, comments, parameters, includes and truncated files."""

import gzip
from pathlib import Path

import pytest

from d2rpick.base.errors import DeckError
from d2rpick.deck.mesh import KINDS, NOT_COUNTED
from d2rpick.deck.reader import has_mesh, read_deck
from d2rpick.deck.source import Block, SourceFile, find_marks
from d2rpick.deck.stored import HeldInMemory
from d2rpick.deck.switching import read_switching
from d2rpick.rules.example import END, HEAD, PARTS, write_automatic_card
from d2rpick.rules.rule import BACK, GOOD, THERE
from tests.decks import count_findings, list_spans, read

WINDOW = [(1, 0.02, 0.09)]
LONG_CARDS = (
    "*DEFORMABLE_TO_RIGID_AUTOMATIC{0}\n"
    f"{1:20d}{0:20d}{'0.02':>20s}\n{'':80s}{1:20d}\n{1:20d}{0:20d}{'PART':>20s}\n"
    "*DEFORMABLE_TO_RIGID_AUTOMATIC{0}\n"
    f"{2:20d}{0:20d}{'0.09':>20s}\n{'':100s}{1:20d}\n{1:20d}{'PART':>20s}\n"
)
COMMA = (
    "*PARAMETER\nRa,0.01\n"
    "*DEFORMABLE_TO_RIGID_AUTOMATIC\n1,0,0.02\n,,,,1\n1,,PART\n"
    "*DEFORMABLE_TO_RIGID_AUTOMATIC\n2,0,<max(0.09,&a)>\n,,,,,1\n1,PART\n"
)
SAME = {
    "plain": GOOD,
    "lower case": GOOD.lower(),
    "mixed case": GOOD.title(),
    "byte order mark": "\xef\xbb\xbf" + THERE + GOOD.replace(THERE, ""),
    "CRLF": GOOD.replace("\n", "\r\n"),
    "no line end": GOOD.removesuffix(END).rstrip("\n"),
    "no *KEYWORD, no *END": GOOD.replace("*KEYWORD\n", "").replace(END, ""),
    "text after *END": GOOD + THERE.replace("0.02", "0.03"),
    "hint text": GOOD.replace("_AUTOMATIC", "_AUTOMATIC   (all doors) "),
    "indented keyword": GOOD.replace("*DEFORM", "  *DEFORM"),
    "comments anywhere": GOOD.replace("\n", "\n$ * 1.0, *END *COMMENT\n"),
    "short lines": GOOD.replace("         0         0         0\n", "\n").replace(
        "      PART\n", "\n"
    ),
    "trailing blanks": GOOD.replace("\n", "   \n"),
    "blank lines at the end": GOOD.replace(END, "\n\n" + END),
    "title that looks like data": GOOD.replace(
        PARTS, "*TITLE\n         1         2\n" + PARTS
    ),
    "dollar in a title": GOOD.replace("door", "door $1 *PART"),
    "Latin-1": GOOD.replace("door", "T\xfcr \xb5 \xff"),
    "comma": HEAD + PARTS + COMMA,
    "LONG=Y": "*KEYWORD LONG=Y\n" + LONG_CARDS.format(""),
    "long by suffix": "*KEYWORD\n" + LONG_CARDS.format("+"),
    "long by suffix apart": "*KEYWORD\n" + LONG_CARDS.format(" + "),
    "standard inside long": "*KEYWORD LONG=Y\n"
    + (THERE + BACK).replace("_AUTOMATIC", "_AUTOMATIC-"),
    "LONG=K reads standard": "*KEYWORD LONG=K\n" + THERE + BACK,
    "percent suffix": GOOD.replace("_AUTOMATIC", "_AUTOMATIC%"),
    "encrypted block after": GOOD.replace(
        END, "-----BEGIN PGP MESSAGE-----\nABC=\n-----END PGP MESSAGE-----\n"
    ),
    "parameters": HEAD
    + "*PARAMETER\nR     TR        0.02I one              1\n"
    + PARTS
    + write_automatic_card(1, "&tr", rigid=["&one"])
    + BACK,
    "left-aligned reference": HEAD
    + "*PARAMETER\nR tr          0.02\n"
    + PARTS
    + THERE.replace("      0.02", "&tr       ")
    + BACK,
    "minus reference": HEAD
    + "*PARAMETER\nR tr         -0.02\n"
    + write_automatic_card(1, "-&tr", rigid=["1"])
    + BACK,
    "expression": HEAD
    + "*PARAMETER_EXPRESSION\nR a       2.0/100\nI b       2/5+1\n"
    + write_automatic_card(1, "&a*1.0", rigid=["&b"])
    + BACK,
    "expression over two lines": HEAD
    + "*PARAMETER_EXPRESSION\nR a       2.0/\n          100\n"
    + write_automatic_card(1, "&a", rigid=["1"])
    + BACK,
    "comma in a parameter": HEAD
    + "*PARAMETER\nRtr, 0.02\n"
    + write_automatic_card(1, "&tr", rigid=["1"])
    + BACK,
}

CARDS = {"cards.k": THERE + BACK}


@pytest.mark.parametrize("deck", SAME.values(), ids=SAME.keys())
def test_the_same_window_however_it_is_written(tmp_path: Path, deck: str) -> None:
    assert list_spans(read(tmp_path, deck)) == WINDOW
    assert not {"D2R001", "D2R002"} & count_findings(tmp_path, deck).keys()


def test_fields_know_their_place(tmp_path: Path) -> None:
    deck = read(tmp_path, GOOD)
    first, second = (card.header for card in read_switching(deck))
    assert first
    assert second
    lines = GOOD.split("\n")
    time_field = first.time1.field
    assert lines[time_field.line - 1][time_field.column - 1 :].startswith("0.02")
    assert time_field.file == deck.path
    assert lines[second.swset.field.line - 1][second.swset.field.column - 1] == "2"


def test_comment_blocks_disable_the_rest_of_their_line_and_the_card_below(
    tmp_path: Path,
) -> None:
    deck = read(tmp_path, GOOD.replace("*DEFORM", "*COMMENT c:*Deform", 1))
    assert [card.line for card in deck.disabled] == [
        GOOD[: GOOD.index("*DEFORM")].count("\n") + 1
    ]
    assert list_spans(deck) == []


def test_encrypted_blocks_are_found_and_end_the_card_before(tmp_path: Path) -> None:
    deck = read(tmp_path, THERE + "-----BEGIN PGP MESSAGE-----\nhQEMA\n" + BACK)
    assert [block.line for block in deck.encrypted] == [THERE.count("\n") + 1]
    assert list_spans(deck) == WINDOW


@pytest.mark.parametrize("chunk", [37, 64, 100])
def test_no_cut_between_chunks_hides_a_keyword(chunk: int) -> None:
    text = (GOOD + "-----BEGIN PGP MESSAGE-----\nA\n").replace(END, "")
    whole = find_marks(HeldInMemory(text.encode()))
    assert len(whole) == text.count("\n*") + 2
    assert [*find_marks(HeldInMemory(text.encode()), chunk)] == [*whole]


def write_transform(
    offsets: str = "", further_offsets: str = "", factors: str = ""
) -> str:
    return f"*INCLUDE_TRANSFORM\ncards.k\n{offsets}\n{further_offsets}\n{factors}\n{'0':>10s}\n"


INCLUDES = {
    "beside": ("*INCLUDE\ncards.k\n", CARDS, WINDOW),
    "names between blank lines": (
        "*INCLUDE\n\nother.k\n   \ncards.k\n",
        CARDS | {"other.k": "*NODE\n"},
        WINDOW,
    ),
    "several names": (
        "*INCLUDE\nother.k\ncards.k\n",
        CARDS | {"other.k": "*NODE\n"},
        WINDOW,
    ),
    "name over two lines": (
        "*INCLUDE\nsub/long_ +\nname.k\n",
        {"sub/long_name.k": THERE + BACK},
        WINDOW,
    ),
    "backslashes": ("*INCLUDE\nsub\\cards.k\n", {"sub/cards.k": THERE + BACK}, WINDOW),
    "quoted": ('*INCLUDE\n"cards.k"\n', CARDS, WINDOW),
    "include path": (
        "*INCLUDE_PATH\nfar/away\n*INCLUDE\ncards.k\n",
        {"far/away/cards.k": THERE + BACK},
        WINDOW,
    ),
    "relative path": (
        "*INCLUDE_PATH_RELATIVE\nfar\n*INCLUDE\ncards.k\n",
        {"far/cards.k": THERE + BACK},
        WINDOW,
    ),
    "beside the include": (
        "*INCLUDE\nsub/a.k\n",
        {"sub/a.k": "*INCLUDE\nb.k\n", "sub/b.k": THERE + BACK},
        WINDOW,
    ),
    "parts move": (
        write_transform(f"{0:10d}{0:10d}{100:10d}"),
        CARDS,
        [(101, 0.02, 0.09)],
    ),
    "times scale": (
        write_transform(factors=f"{'1.0':>10s}{'0.5':>10s}"),
        CARDS,
        [(1, 0.01, 0.045)],
    ),
    "factor 0 is 1": (
        write_transform(factors=f"{'0.0':>10s}{'0.0':>10s}"),
        CARDS,
        WINDOW,
    ),
    "transforms nest": (
        write_transform(f"{0:10d}{0:10d}{100:10d}", factors=f"{'':10s}{'0.5':>10s}"),
        {
            "cards.k": write_transform(
                f"{0:10d}{0:10d}{10:10d}", factors=f"{'':10s}{'0.1':>10s}"
            ).replace("cards", "inner"),
            "inner.k": THERE + BACK,
        },
        [(111, 0.001, pytest.approx(0.0045))],
    ),
    "sets move": (
        PARTS
        + "*SET_PART\n        57\n         1\n"
        + write_transform(f"{0:40d}{50:10d}"),
        {
            "cards.k": (THERE + BACK)
            .replace("         1         0      PART", "         7         0      PSET")
            .replace("         1      PART", "         7      PSET")
        },
        WINDOW,
    ),
    "long format is inherited": (
        "*KEYWORD LONG=Y\n*INCLUDE\ncards.k\n",
        {"cards.k": LONG_CARDS.format("")},
        WINDOW,
    ),
    "parameters of the deck": (
        "*PARAMETER\nR tr          0.02\n*INCLUDE\ncards.k\n",
        {"cards.k": write_automatic_card(1, "&tr", rigid=["1"]) + BACK},
        WINDOW,
    ),
    "local masks outer": (
        "*PARAMETER\nR tr          0.05\n*INCLUDE\ncards.k\n",
        {
            "cards.k": "*PARAMETER_LOCAL\nR tr          0.02\n"
            + write_automatic_card(1, "&tr", rigid=["1"])
            + BACK
        },
        WINDOW,
    ),
    "local ends with its file": (
        "*INCLUDE\nlocal.k\n*PARAMETER\nR tr          0.02\n"
        + write_automatic_card(1, "&tr", rigid=["1"])
        + BACK,
        {"local.k": "*PARAMETER_LOCAL\nR tr          0.05\n"},
        WINDOW,
    ),
    "local masks the deck's in the same file": (
        "*PARAMETER\nR tr          0.05\n*PARAMETER_LOCAL\nR tr          0.02\n"
        + write_automatic_card(1, "&tr", rigid=["1"])
        + BACK,
        {},
        WINDOW,
    ),
    "a local one below a card does not mask for it": (
        "*PARAMETER\nR tr          0.02\n"
        + write_automatic_card(1, "&tr", rigid=["1"])
        + "*PARAMETER_LOCAL\nR tr          0.05\n"
        + BACK,
        {},
        WINDOW,
    ),
    "a mutable one changes between two cards": (
        "*PARAMETER_MUTABLE\nR t           0.02\n"
        + write_automatic_card(1, "&t", rigid=["1"])
        + "*PARAMETER_MUTABLE\nR t           0.09\n"
        + write_automatic_card(2, "&t", deformable=["1"]),
        {},
        WINDOW,
    ),
    "a parameter names the file": (
        "*PARAMETER\nCfile       cards\n*INCLUDE\n&file.k\n",
        {"cards.k": THERE + BACK},
        WINDOW,
    ),
    "a parameter names the folder": (
        "*PARAMETER\nCdir          sub\n*INCLUDE_PATH\n&dir\n*INCLUDE\ncards.k\n",
        {"sub/cards.k": THERE + BACK},
        WINDOW,
    ),
    "the first definition counts": (
        "*PARAMETER\nR tr          0.02\n*PARAMETER\nR tr          0.05\n"
        + write_automatic_card(1, "&tr", rigid=["1"])
        + BACK,
        {},
        WINDOW,
    ),
    "the last one when asked for": (
        "*PARAMETER_DUPLICATION\n         2\n*PARAMETER\nR tr          0.05\n*PARAMETER\nR tr          0.02\n"
        + write_automatic_card(1, "&tr", rigid=["1"])
        + BACK,
        {},
        WINDOW,
    ),
    "a mutable one": (
        "*PARAMETER\nR tr          0.05\n*PARAMETER_MUTABLE\nR tr          0.02\n"
        + write_automatic_card(1, "&tr", rigid=["1"])
        + BACK,
        {},
        WINDOW,
    ),
}


@pytest.mark.parametrize(
    ("deck", "files", "expected"), INCLUDES.values(), ids=INCLUDES.keys()
)
def test_includes(
    tmp_path: Path, deck: str, files: dict[str, str], expected: object
) -> None:
    main = read(tmp_path, deck, files)
    assert main.unread == []
    assert list_spans(main) == expected


def test_a_place_in_an_include_names_the_include(tmp_path: Path) -> None:
    (card, _) = read_switching(read(tmp_path, "*INCLUDE\ncards.k\n", CARDS))
    assert card.time_field.file == str(tmp_path / "cards.k")
    assert card.time_field.line == 3


@pytest.mark.parametrize(
    ("deck", "files", "reason"),
    [
        ("*INCLUDE\nnowhere.k\n", {}, "no such file"),
        ("*INCLUDE\nmain.k\n", {}, "itself"),
        (
            "*INCLUDE\na.k\n",
            {"a.k": "*INCLUDE\nb.k\n", "b.k": "*INCLUDE\na.k\n"},
            "itself",
        ),
        ("*INCLUDE\nsub\n", {"sub/a.k": ""}, "no such file"),
        ("*INCLUDE\n" + "x" * 5000 + "\n", {}, "no such file"),
        ("*INCLUDE\n\0\n", {}, "no such file"),
    ],
)
def test_includes_that_cannot_be_read(
    tmp_path: Path, deck: str, files: dict[str, str], reason: str
) -> None:
    main = read(tmp_path, deck + THERE + BACK, files)
    assert [reason in unread.reason for unread in main.unread] == [True]
    assert list_spans(main) == WINDOW


def test_a_chain_of_includes_ends(tmp_path: Path) -> None:
    files = {f"{n}.k": f"*INCLUDE\n{n + 1}.k\n" for n in range(100)}
    (unread,) = read(tmp_path, "*INCLUDE\n0.k\n", files).unread
    assert "deeper" in unread.reason


@pytest.mark.slow
def test_includes_that_multiply_are_an_error(tmp_path: Path) -> None:
    files = {f"{n}.k": f"*INCLUDE\n{n + 1}.k\n{n + 1}.k\n" for n in range(20)} | {
        "20.k": ""
    }
    with pytest.raises(DeckError, match="more than"):
        read(tmp_path, "*INCLUDE\n0.k\n", files)


def test_a_compressed_deck_is_named_as_such(tmp_path: Path) -> None:
    for name in ("main.k", "RUN_0000.rad"):
        (tmp_path / name).write_bytes(gzip.compress(b"*KEYWORD\n*END\n"))
        with pytest.raises(DeckError, match="compressed with gzip"):
            read_deck(str(tmp_path / name))


def test_lines_that_end_in_cr_alone_are_refused(tmp_path: Path) -> None:
    with pytest.raises(DeckError, match="CR alone"):
        read(tmp_path, GOOD.replace("\n", "\r"))


@pytest.mark.parametrize("name", ["absent.k", ".", "bad\0name"])
def test_a_deck_that_cannot_be_read(tmp_path: Path, name: str) -> None:
    with pytest.raises(
        DeckError,
        match=r"no such file; check|cannot be read .*; check|this is a folder; give the main deck",
    ):
        read_deck(f"{tmp_path}/{name}")


@pytest.mark.parametrize(
    ("deck", "told", "place"),
    [
        (
            "*PARAMETER_EXPRESSION\nR a       &b*2\n"
            + write_automatic_card(1, "&a", rigid=["1"]),
            "&b is not defined",
            "main.k:2",
        ),
        (
            write_automatic_card(1, "&a", rigid=["1"])
            + "*PARAMETER\nR a           0.02\n",
            "defined only below, at",
            "main.k:8",
        ),
    ],
)
def test_a_parameter_without_a_value_is_named_with_its_place(
    tmp_path: Path, deck: str, told: str, place: str
) -> None:
    ((field, problem),) = (
        problems
        for card in read_switching(read(tmp_path, deck))
        for problems in card.problems
    )
    assert field.text == "&a"
    assert told in problem
    assert place in problem


@pytest.mark.parametrize("keyword", [*KINDS, *sorted(NOT_COUNTED), "NODE"])
def test_all_elements_of_radioss_are_mesh(keyword: str) -> None:
    """The names are defined twice, because a check does not load the inventory."""
    assert has_mesh(Block(SourceFile("run_0000.rad", b""), 0, None, f"/{keyword}/1"))
