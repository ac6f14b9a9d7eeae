"""Decks written with cards: nothing else changes, and no existing file is lost."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from d2rpick.base.errors import DeckError
from d2rpick.deck.printed_card import PrintedCard, Printing
from d2rpick.deck.printing import print_cards
from d2rpick.deck.radioss_deck import RadiossLeg
from d2rpick.deck.radioss_run import read_run
from d2rpick.deck.writing import write_deck
from d2rpick.rules import RULES, check_deck
from d2rpick.rules.example import END, HEAD, PARTS
from d2rpick.rules.rule import GOOD, THERE
from tests.decks import write

WINDOWS = [(0.02, 0.09), (0.1, 0.15)]
CARD = print_cards(WINDOWS, Printing(part=(1,)))
INCLUDE = "*INCLUDE\nswitches.k\n"
RUN = RULES["D2R401"].passing[0]

IS_CUT = r"main\.k: the .* may be truncated\. The added cards would hide this: .*"
OTHER_SET = THERE.replace(
    "         1         0  ", "       901         0  ", 1
).replace("         1         0      PART", "         2         0      PART")
ENGINE = "/RUN/box/1\n 0.4\n/VERS/2022\n/RBODY/OFF\n1808\n/INIV/TRA/X/2\n6.0\n2\n/TFILE/4\n1e-5\n/DTIX\n1e-6 1e-4\n"
LEGS = Printing(node=(1808,), end=0.4, name="box")


def list_windows(path: str) -> list[tuple[int, float, float | None]]:
    checked = check_deck(path)
    assert [finding for finding in checked.findings if finding.severity != "info"] == []
    return [(window.unit.id, window.tr, window.td) for window in checked.windows]


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
@pytest.mark.parametrize("end", [END, "", "  *END\nleft over\n", "*end"])
def test_the_deck_is_the_same_but_for_one_include(
    tmp_path: Path, end: str, newline: str
) -> None:
    text_before, text_after = (
        (HEAD + PARTS).replace("\n", newline),
        end.replace("\n", newline),
    )
    main = write(tmp_path, (text_before + text_after).encode())
    written, switches = write_deck(main, CARD, str(tmp_path / "next"))
    assert (
        Path(written).read_bytes()
        == (text_before + INCLUDE.replace("\n", newline) + text_after).encode()
    )
    assert Path(switches).read_text() == CARD.text
    assert list_windows(written) == [(1, tr, td) for tr, td in WINDOWS]


def test_a_deck_in_long_format_gets_cards_that_are_not(tmp_path: Path) -> None:
    deck = "*KEYWORD LONG=Y\n*PART\ndoor\n" + f"{1:20d}{1:20d}{1:20d}\n" + END
    written, _ = write_deck(write(tmp_path, deck), CARD, str(tmp_path / "next"))
    assert [(w.part, w.tr, w.td) for w in check_deck(written).windows] == [
        (1, tr, td) for tr, td in WINDOWS
    ]


def test_part_sets_in_a_deck_in_long_format_keep_their_columns(tmp_path: Path) -> None:
    parts = range(1, 15)  # more than ten: the card names part sets
    rows = "".join(f"*PART\ndoor\n{part:20d}{1:20d}{1:20d}\n" for part in parts)
    card = print_cards(WINDOWS[:1], Printing(part=tuple(parts), merge=1))
    deck = write(tmp_path, f"*KEYWORD LONG=Y\n{rows}{END}")
    written, _ = write_deck(deck, card, str(tmp_path / "next"))
    checked = check_deck(written)
    assert "D2R002" not in {finding.rule for finding in checked.findings}
    assert {window.unit.id for window in checked.windows} >= {*parts}


def test_included_files_go_with_the_deck(tmp_path: Path) -> None:
    main = write(
        tmp_path, HEAD + "*INCLUDE\nparts/all.k\n" + END, {"parts/all.k": PARTS}
    )
    written = write_deck(main, CARD, str(tmp_path / "next"))
    assert [Path(name).name for name in written] == ["main.k", "switches.k", "all.k"]
    assert list_windows(written[0]) == [(1, tr, td) for tr, td in WINDOWS]


@pytest.mark.parametrize(
    ("deck", "files", "message"),
    [
        (GOOD, {}, r"main.k:14: the deck switches part 1 already"),
        (HEAD + PARTS + OTHER_SET + END, {}, "switch set 901"),
        (
            HEAD + INCLUDE + END,
            {"switches.k": PARTS},
            "with the name of the card file, 'switches.k'",
        ),
        (
            HEAD + "*INCLUDE\n../parts.k\n" + END,
            {"../parts.k": PARTS},
            "from outside its folder",
        ),
        ((HEAD + PARTS).rstrip("\n"), {}, IS_CUT + "end its last line"),
        (f"{HEAD}{PARTS}*NODE\n       1\n", {}, IS_CUT + r"add \*END"),
    ],
)
def test_what_cannot_be_written_is_refused_before_anything_is(
    tmp_path: Path, deck: str, files: dict[str, str], message: str
) -> None:
    (tmp_path / "deep").mkdir()
    check_refused(write(tmp_path / "deep", deck, files), CARD, message)


def check_refused(main: str, card: PrintedCard, message: str) -> None:
    """Check that the deck is refused with this message, and that no file is written."""
    folder = Path(main).parent / "next"
    with pytest.raises(DeckError, match=message):
        write_deck(main, card, str(folder))
    assert not list(folder.glob("*"))


def test_nothing_is_replaced_without_being_told(tmp_path: Path) -> None:
    main = write(tmp_path, HEAD + PARTS + END)
    folder = tmp_path / "next"
    write_deck(main, CARD, str(folder))
    (folder / "switches.k").write_text("mine")
    with pytest.raises(DeckError, match=r"main.k: the file exists"):
        write_deck(main, CARD, str(folder))
    assert (folder / "switches.k").read_text() == "mine"
    write_deck(main, CARD, str(folder), overwrite=True)
    assert (folder / "switches.k").read_text() == CARD.text
    with pytest.raises(DeckError, match="the folder of the deck"):
        write_deck(main, CARD, str(tmp_path), overwrite=True)


def test_no_link_leads_out_of_the_folder(tmp_path: Path) -> None:
    (tmp_path / "deck").mkdir()
    main = write(
        tmp_path / "deck",
        HEAD + "*INCLUDE\nparts/all.k\n" + END,
        {"parts/all.k": PARTS},
    )
    mine, folder = tmp_path / "mine", tmp_path / "next"
    mine.mkdir()
    folder.mkdir()
    (mine / "kept.k").write_text("mine")
    (folder / "parts").symlink_to(mine)
    (folder / "switches.k").symlink_to(mine / "kept.k")
    (folder / "main.k").symlink_to(mine / "new.k")
    for name, link in (
        ("main.k", "main.k"),
        ("switches.k", "switches.k"),
        ("all.k", "parts"),
    ):
        with pytest.raises(
            DeckError, match=rf"{name}: lies outside {folder}, because of a link"
        ):
            write_deck(main, CARD, str(folder), overwrite=True)
        (folder / link).unlink()
        assert [path.name for path in mine.iterdir()] == ["kept.k"]
    assert (mine / "kept.k").read_text() == "mine"
    (tmp_path / "named").symlink_to(folder)  # a link that was asked for
    assert (folder / "parts" / "all.k").samefile(
        write_deck(main, CARD, str(tmp_path / "named"))[2]
    )


# Radioss.


def write_radioss_run(folder: Path, engine: str = ENGINE) -> str:
    folder.mkdir(exist_ok=True)
    (folder / "box_0001.rad").write_text(engine)
    return write(folder, RUN.deck, name=RUN.name)


def test_a_run_gets_the_legs_with_its_own_keywords(tmp_path: Path) -> None:
    card = print_cards(
        WINDOWS, Printing(node=(1808,), end=0.4, name="box", solver="radioss")
    )
    starter, *legs = write_deck(
        write_radioss_run(tmp_path / "ref"), card, str(tmp_path / "next")
    )
    assert Path(starter).read_text() == RUN.deck
    assert list_windows(starter) == [(1, tr, td) for tr, td in WINDOWS]
    texts = [Path(leg).read_text() for leg in legs]
    assert ["/INIV" in text for text in texts] == [True, False, False, False, False]
    assert all("/TFILE/4\n1e-5\n" in text and "/VERS/2022" in text for text in texts)
    assert all(text.count("/DTIX") == text.count("/RUN") == 1 for text in texts)


def test_legs_are_named_after_the_files_of_the_run_by_which_the_engine_finds_its_restart(
    tmp_path: Path,
) -> None:
    """Source: runs computed with OpenRadioss, whose engine looks for NAME_0001.rst next to NAME_0002.rad."""
    main = write_radioss_run(tmp_path / "ref")
    for file in (tmp_path / "ref").iterdir():
        file.rename(file.with_name(file.name.replace("box_", "heavy_box_")))
    main = main.replace("box_0000", "heavy_box_0000")
    for name in ("box", "heavy_box"):  # the name in /RUN, or that of the files
        card = print_cards(
            WINDOWS, Printing(node=(1808,), end=0.4, name=name, solver="radioss")
        )
        names = [
            Path(written_file).name
            for written_file in write_deck(main, card, str(tmp_path / name))
        ]
        assert names == [f"heavy_box_{number:04d}.rad" for number in range(6)]
    card = print_cards(
        WINDOWS, Printing(node=(1808,), end=0.4, name="other", solver="radioss")
    )
    check_refused(main, card, "the cards are for run 'other', but this is run 'box'")


def test_a_run_of_several_legs_alike_is_cut_anew_at_the_switches(
    tmp_path: Path,
) -> None:
    """A later leg may lack keywords of the first leg, such as initial velocities, but has no others."""
    card = print_cards(
        WINDOWS, Printing(node=(1808,), end=0.8, name="box", solver="radioss")
    )
    ref = write_radioss_run(tmp_path / "ref")
    (tmp_path / "ref" / "box_0002.rad").write_text(
        "/RUN/box/2\n 0.8\n/VERS/2022\n/TFILE/4\n1e-5\n"
    )
    starter, *legs = write_deck(ref, card, str(tmp_path / "next"))
    assert [leg.stop.value for leg in read_run(starter).legs] == [
        *(time for window in WINDOWS for time in window),
        0.8,
    ]
    assert all("/TFILE/4\n1e-5\n" in Path(leg).read_text() for leg in legs)
    for added in ("/RBODY/ON\n1808\n", "/DT\n0.5 0.0\n", "/TFILE/4\n1e-4\n"):
        (tmp_path / "ref" / "box_0002.rad").write_text(
            "/RUN/box/2\n 0.8\n/VERS/2022\n" + added
        )
        with pytest.raises(
            DeckError, match=r"box_0002\.rad: /.* is not in the first engine file"
        ):
            write_deck(ref, card, str(tmp_path / "other"))


def test_bodies_that_the_run_keeps_off_stay_off_in_every_leg(tmp_path: Path) -> None:
    """Otherwise, they would be rigid from time 0, like the wheels of a car of which only the body is switched."""
    engine = ENGINE.replace("1808\n", "1808 1809\n1810\n") + "/END\nleft over\n"
    for starter_deck, name in (
        ((), "a"),
        ((1810, 1809), "b"),
    ):  # a card with these bodies, and one without them
        card = print_cards(
            WINDOWS,
            Printing(
                node=(1808,), off=starter_deck, end=0.4, name="box", solver="radioss"
            ),
        )
        starter, *legs = write_deck(
            write_radioss_run(tmp_path / "ref", engine), card, str(tmp_path / name)
        )
        leg_states = [dict(list_states(leg)) for leg in read_run(starter).legs]
        rigid = [
            {1808: False, 1809: False, 1810: False},
            {1808: True, 1809: False, 1810: False},
        ]
        assert leg_states == [rigid[0], rigid[1], rigid[0], rigid[1], rigid[0]]
        blocks = [Path(leg).read_text().count("/RBODY/OFF") for leg in legs]
        assert blocks == [1] * len(
            leg_states
        )  # the starter ignores a second block that follows the first


def list_states(leg: RadiossLeg) -> Iterator[tuple[int, bool]]:
    for _, rigid, nodes in leg.switched:
        yield from ((node.value, rigid) for node in nodes)


def test_a_card_names_all_that_is_off_in_one_block() -> None:
    """The starter of OpenRadioss ignores the second of two consecutive blocks."""
    card = print_cards(
        WINDOWS,
        Printing(node=(1808,), off=(1809,), end=0.4, name="box", solver="radioss"),
    )
    texts = list(card.files.values())
    assert [text.count("/RBODY/OFF") for text in texts] == [1] * 5
    assert [text.count("/RBODY/ON") for text in texts] == [0, 1, 0, 1, 0]
    assert "/RBODY/OFF\n1808 1809\n" in texts[0]


def print_sensor_card(**more: object) -> PrintedCard:
    printing = Printing(node=(1808,), end=0.4, name="box", **more)  # type: ignore[arg-type]
    return print_cards(WINDOWS, printing._replace(solver="radioss-sensors"))


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_all_windows_fit_one_engine_run_by_sensors(
    tmp_path: Path, newline: str
) -> None:
    main = write_radioss_run(tmp_path / "ref", ENGINE.replace("1808\n", "1808 1809\n"))
    Path(main).write_bytes(RUN.deck.replace("\n", newline).encode())
    starter, engine = write_deck(main, print_sensor_card(), str(tmp_path / "next"))
    assert [
        (first.part, first.tr, first.td) for first in check_deck(starter).windows
    ] == [(1, tr, td) for tr, td in WINDOWS]
    text = Path(engine).read_text()
    assert (
        "/RBODY/OFF\n1809\n" in text
    )  # bodies that the run keeps inactive; a body with a sensor has no leg
    assert (
        text.count("/DTIX\n5e-05 5e-05\n") == text.count("/DTIX") == 1
    )  # of the shortest window
    assert "/INIV" in text
    deck = Path(starter).read_bytes().decode()
    assert deck.count(newline) == deck.count("\n")
    same = [
        first == second
        for first, second in zip(RUN.deck.splitlines(), deck.splitlines(), strict=False)
    ]
    changed = [
        line
        for line, is_same in zip(deck.splitlines(), same, strict=False)
        if not is_same
    ]
    assert changed[:2] == [
        "      2023         0",
        "      1808       905         0         0                   0         7",
    ]
    assert changed[2] == "/SENSOR/TIME/901"  # in place of /END


def test_bodies_that_a_deck_lacks_get_their_sensor(tmp_path: Path) -> None:
    head, _, after_keyword = RUN.deck.partition("/RBODY/1\n")
    _, _, after_group = after_keyword.partition("7\n")
    main = write_radioss_run(tmp_path / "ref", ENGINE.replace("/RBODY/OFF\n1808\n", ""))
    Path(main).write_text(head + after_group)
    body = "/RBODY/1\nbox\n      1808         0         0         0                   0         7\n"
    starter, _ = write_deck(
        main, print_sensor_card(starter=body, sensor=4), str(tmp_path / "next")
    )
    assert list_windows(starter) == [(1, tr, td) for tr, td in WINDOWS]


@pytest.mark.parametrize(
    ("deck", "engine", "card", "message"),
    [
        (
            RUN.deck,
            ENGINE.replace("OFF", "ON"),
            print_cards(WINDOWS, LEGS._replace(solver="radioss")),
            "switches main node 1808 already",
        ),
        (
            RUN.deck,
            ENGINE,
            print_cards(
                WINDOWS, LEGS._replace(name="other")._replace(solver="radioss")
            ),
            "but this is run 'box'",
        ),
        (
            RUN.deck.replace("      1808         0", "      1808         4"),
            ENGINE,
            print_sensor_card(),
            "sensor 4 switches this /RBODY already",
        ),
        (
            RUN.deck.replace("/END", "/SENSOR/TIME/903\nown\n 1.0\n/END"),
            ENGINE,
            print_sensor_card(),
            "has sensor 903 of the cards already",
        ),
        (
            RUN.deck.replace("      1808 ", "      1807 "),
            ENGINE,
            print_sensor_card(),
            "main node 1808: no /RBODY",
        ),
        (RUN.deck, ENGINE, CARD, "another solver"),
    ],
)
def test_a_run_that_does_not_suit_is_refused(
    tmp_path: Path, deck: str, engine: str, card: PrintedCard, message: str
) -> None:
    main = write_radioss_run(tmp_path / "ref", engine)
    Path(main).write_text(deck)
    check_refused(main, card, message)


@pytest.mark.parametrize("solver", ["radioss", "radioss-sensors"])
def test_cards_of_radioss_do_not_go_into_a_deck_of_ls_dyna(
    tmp_path: Path, solver: str
) -> None:
    message = r"main\.k: an LS-DYNA deck, but the cards are for another solver"
    check_refused(
        write(tmp_path, HEAD + PARTS),
        print_cards(WINDOWS, LEGS._replace(solver=solver)),
        message,
    )
