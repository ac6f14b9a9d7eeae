"""A run folder is sufficient input: its main deck is found, named and used, and cards are checked before printing."""

import re
import shutil
from pathlib import Path

import pytest

import d2rpick as d2
from d2rpick.base.errors import ArgumentError
from tests.command import MATSUM, ROOT, put, read_refusal, run, run_json
from tests.energies import require
from tests.sample_deck import DECK

pytestmark = pytest.mark.usefixtures("by_level")

DATABASES = "*DATABASE_MATSUM\n     0.001\n*DATABASE_GLSTAT\n     0.001\n"
NODAL_BODY = (
    "*SET_NODE_LIST\n         5\n         1         2\n"
    "*CONSTRAINED_NODAL_RIGID_BODY\n         9         0         5\n"
)

SAMPLE_GLSTAT = str(ROOT / "sample_data" / "rollover_box.glstat")
ENGINE = "/RUN/CAR/1\n0.26\n/VERS/2022\n/DT\n0.9 0.0\n/TFILE/4\n0.0001\n"


def write_run_folder(path: Path, extra_keywords: str = DATABASES) -> Path:
    """Write the sample run with its deck, with other keywords in place of those for the output."""
    path.mkdir(exist_ok=True)
    shutil.copy(MATSUM, path / "matsum")
    model = DECK.read_text("utf-8").partition("*DATABASE")[0]
    put(path / "main.k", f"{model}{extra_keywords}*END\n")
    return path


@pytest.fixture
def box(tmp_path: Path) -> Path:
    """Write the folder of the sample run."""
    return write_run_folder(tmp_path / "run")


def print_card(folder: Path, *options: str) -> tuple[str, str]:
    """Return the card of a plan, and the messages on stderr."""
    result = run("plan", str(folder), "--part", "flying", "-f", "card", *options)
    assert result.exit_code == 0
    return result.stdout, result.stderr


def check_with_card(folder: Path, card: str) -> str:
    """Return the output of ``check`` for the deck with the card in it."""
    main = (folder / "main.k").read_text("utf-8")
    pasted = put(folder.parent / "pasted.k", main.replace("*END", f"{card}*END"))
    result = run("check", "--fail-on", "warning", str(pasted))
    assert (result.exit_code == 0) == ("0 errors, 0 warnings" in result.stdout)
    return result.stdout


@pytest.mark.parametrize("command", ["plan", "suggest", "parts", "explore"])
def test_the_only_main_deck_is_used_and_named(command: str, box: Path) -> None:
    part = [] if command == "parts" else ["--part", "flying"]
    part += ["--steps", "3"] if command == "explore" else []
    alone = run_json(command, *part, str(box))
    (message,) = [
        warning["message"]
        for warning in alone["warnings"]
        if warning["code"] == "deck-in-folder"
    ]
    assert message.startswith(
        f"{box / 'main.k'} is the main deck in the folder of the run"
    )
    with_deck = run_json(command, *part, "--deck", str(box / "main.k"), str(box))
    without = [
        warning for warning in alone["warnings"] if warning["code"] != "deck-in-folder"
    ]
    same = {
        key: value for key, value in alone.items() if key not in ("command", "warnings")
    }
    assert same == {
        key: value
        for key, value in with_deck.items()
        if key not in ("command", "warnings")
    }
    assert without == with_deck["warnings"]


def test_python_uses_the_same_deck(box: Path) -> None:
    planned = d2.plan(d2.read(box), parts="flying", replay=False, min_quality="poor")
    assert (
        planned.windows
        == d2.plan(
            d2.read(box),
            parts="flying",
            replay=False,
            min_quality="poor",
            deck=box / "main.k",
        ).windows
    )
    assert "deck-in-folder" in [warning.code for warning in planned.warnings]
    without = d2.plan(
        d2.read(box), parts="flying", replay=False, min_quality="poor", deck=False
    )
    assert "deck-in-folder" not in [warning.code for warning in without.warnings]
    assert "--no-deck" in without.command
    assert "--deck" in planned.command  # because the command names the files of the run


def test_the_overview_reads_the_same_deck(box: Path) -> None:
    assert f"deck-in-folder: {box / 'main.k'}" in run("info", str(box)).stderr
    assert "deck-in-folder" not in run("info", "--no-deck", str(box)).stderr
    by_python, by_command = d2.read(box).overview(), run_json("info", str(box))
    assert [flight.start for _, flight in by_python.flights] == [
        flight_row["start"] for flight_row in by_command["flights"]
    ]
    shutil.copy(box / "main.k", box / "other.k")
    assert (
        d2.read(box).overview().flights
    )  # no question needs a deck here, so none is read


def test_parts_that_share_nodes_are_merged_and_the_pasted_card_is_clean(
    box: Path,
) -> None:
    card, messages = print_card(box)
    assert "         2         1      PART" in card
    assert "card-objection" not in messages
    assert "parts 1, 2: rigid" in check_with_card(box, card)


def test_a_deck_with_encrypted_elements_is_not_written_as_if_no_parts_shared_nodes(
    tmp_path: Path,
) -> None:
    head, _, rest = DECK.read_text("utf-8").partition("*ELEMENT_SHELL")
    encrypted = "-----BEGIN PGP MESSAGE-----\n\nhQEMA1\n-----END PGP MESSAGE-----\n"
    model = f"{head}{encrypted}*LOAD_BODY_Z{rest.partition('*LOAD_BODY_Z')[2]}"
    deck = str(put(tmp_path / "main.k", model))
    question = ("plan", MATSUM, "--part", "1,2", "--deck", deck)
    written = ("--write-deck", str(tmp_path / "written"))
    for form in (written, ("-f", "card")):
        messages = run(*question, *form).stderr
        assert "parts-not-joined: d2rpick could not read all elements" in messages
    alone = run("card", "--tr", "0.1", "--td", "0.3", "--part", "1,2", "--deck", deck)
    assert "parts-not-joined: d2rpick could not read all elements" in alone.stderr
    merged = run(*question, "--merge", "1", *written, "--overwrite")
    assert "parts-not-joined" not in merged.stderr


def test_without_a_deck_the_card_says_that_nobody_knows_what_is_joined(
    box: Path,
) -> None:
    card, messages = print_card(box, "--no-deck")
    assert "parts-not-joined: without a deck of the run" in messages
    assert "error D2R108" in check_with_card(box, card)
    assert (
        "parts-not-joined"
        not in run(
            "card", "--tr", "0.1", "--td", "0.3", "--history", MATSUM, "--part", "1"
        ).stderr
    )


def test_what_check_would_say_is_said_when_the_card_is_printed(tmp_path: Path) -> None:
    box = write_run_folder(tmp_path / "run", extra_keywords="")
    card, messages = print_card(box)
    assert "card-objection: check of the deck with this card, switches.k:" in messages
    assert "D2R111 (warning)" in messages
    assert "warning D2R111" in check_with_card(box, card)
    plan = d2.plan(d2.read(box), parts="flying", replay=False, min_quality="poor")
    (by_python,) = require(plan.card()).cautions
    assert by_python.code == "card-objection"
    assert (
        str(tmp_path) not in by_python.message
    )  # the message must not name the temporary folder


@pytest.mark.parametrize("command", ["card", "suggest", "plan"])
def test_a_card_with_an_error_is_no_success_and_is_not_recommended(
    command: str, box: Path
) -> None:
    times = {
        "card": ("--tr", "0.123689", "--td", "0.37", "--history"),
        "suggest": ("--td", "0.37", "-f", "card"),
        "plan": ("-f", "card"),
    }
    asked = (command, "--part", "1,2", "--deck", str(box / "main.k"), "--merge")
    expected = {"1": 0, "7": 1}
    for lead, exit_code in expected.items():
        result = run(*asked, lead, *times[command], MATSUM)
        assert result.exit_code == exit_code
        assert ("card-error" in result.stderr) == bool(exit_code)
    assert "lead part 7 not in the deck" in result.stderr
    assert "next: add these cards" not in result.stderr
    assert run(*asked, "7", "--exit-zero", *times[command], MATSUM).exit_code == 0


def test_the_step_after_a_card_with_an_error_is_to_correct_it(box: Path) -> None:
    deck, times = ("--deck", str(box / "main.k")), ("--tr", "0.123689", "--td", "0.37")
    asked = ("card", "--min-quality", "poor", "--history", MATSUM, *deck, *times)
    steps = {"1": "add these cards", "7": "correct the options of the card or the deck"}
    for lead, step in steps.items():
        result = run(*asked, "--part", "1,2", "--merge", lead)
        assert f"next: {step}" in result.stderr


def test_ids_of_the_deck_are_not_used_again(tmp_path: Path) -> None:
    first, second = (
        f"{901:10d}{0:10d}{0.01:10g}",
        f"{0:10d}{0:10d}{0:10d}{0.0:10g}{1:10d}",
    )
    taken = f"*DEFORMABLE_TO_RIGID_AUTOMATIC\n{first}\n{second}\n{3:10d}\n"
    box = write_run_folder(
        tmp_path / "run",
        f"{DATABASES}*SET_PART_LIST\n       950\n         1         2\n{taken}",
    )
    card, messages = print_card(box)
    assert "\n       951         0 " in card
    assert "\n       952         0 " in card
    assert "D2R004" not in messages + check_with_card(box, card)


def test_nodal_rigid_bodies_on_the_parts_are_deleted_while_these_are_rigid(
    tmp_path: Path,
) -> None:
    box = write_run_folder(tmp_path / "run", DATABASES + NODAL_BODY)
    card, _ = print_card(box)
    lines = card.splitlines()
    flags = [
        lines[line_index + 1][:20]
        for line_index, line in enumerate(lines)
        if line.startswith("$#    nrbf")
    ]
    assert flags == [f"{1:10d}{0:10d}", f"{2:10d}{0:10d}"]
    assert "D2R112" not in check_with_card(box, card)


@pytest.mark.parametrize(
    ("constraint", "flags"),
    [
        (NODAL_BODY, (1, 0)),
        ("*CONSTRAINED_SPOTWELD\n         1         2\n", (0, 1)),
        ("*CONSTRAINED_EXTRA_NODES_NODE\n         3         1\n", (0, 0)),
    ],
)
def test_a_card_needs_only_a_deck_and_parts_if_the_history_has_no_parts(
    tmp_path: Path, constraint: str, flags: tuple[int, int]
) -> None:
    """A glstat names no parts, so the parts of the card are merged, and constraints on them deleted."""
    box = write_run_folder(tmp_path / "run", DATABASES + constraint)
    asking = ("card", "--tr", "0.12", "--td", "0.37", "--part", "1,2", "--exit-zero")
    deck = ("--deck", str(box / "main.k"))
    result = run(*asking, *deck, "--history", SAMPLE_GLSTAT)
    assert re.findall(
        r"^ {9}([12]) +([01]) +PART$", result.stdout, flags=re.MULTILINE
    ) == [("1", "0"), ("2", "1")]
    lines = result.stdout.splitlines()
    first = lines[next(n for n, line in enumerate(lines) if "nrbf" in line) + 1]
    assert first[:20] == f"{flags[0]:10d}{flags[1]:10d}"
    assert "D2R108" not in result.stderr
    assert "D2R112" not in result.stderr


def test_of_several_main_decks_one_has_to_be_named(box: Path) -> None:
    shutil.copy(box / "main.k", box / "other.k")
    message = read_refusal("plan", str(box), "--part", "flying")
    assert "2 main decks" in message
    assert "--deck" in message
    assert "--no-deck" in message
    assert run("plan", str(box), "--part", "flying", "--no-deck").exit_code == 0
    with pytest.raises(ArgumentError, match="2 main decks"):
        d2.plan(d2.read(box), parts="flying")


def test_includes_restarts_and_cards_alone_are_no_main_decks(box: Path) -> None:
    put(box / "cards.k", "*KEYWORD\n*RIGID_DEFORMABLE_R2D\n         1\n*END\n")
    main = (box / "main.k").read_text("utf-8")
    put(box / "inner.k", main.replace("*END", ""))
    put(box / "main.k", "*KEYWORD\n*INCLUDE\ninner.k\n*END\n")
    assert "         2         1      PART" in print_card(box)[0]


def test_a_file_has_no_folder_whose_deck_is_used(box: Path) -> None:
    plan_answer = run_json("plan", "--part", "flying", str(box / "matsum"))
    assert "deck-in-folder" not in [
        warning["code"] for warning in plan_answer["warnings"]
    ]


def test_what_needs_a_deck_is_refused_where_the_folder_has_none(box: Path) -> None:
    assert (
        run("suggest", "--part", "flying", "--step-ratio", "2", str(box)).exit_code == 0
    )
    (box / "main.k").unlink()
    assert "--step-ratio needs --cost-share or --deck" in read_refusal(
        "suggest", "--step-ratio", "2", str(box)
    )
    assert "--deck and --no-deck exclude each other" in read_refusal(
        "plan", "--deck", "a.k", "--no-deck", str(box)
    )


def write_radioss_run(path: Path, root: str) -> Path:
    """Write a falling box of two plates, with the history of the sample box."""
    path.mkdir()
    head = "#RADIOSS STARTER\n/BEGIN\nCAR\n      2022         0\n/TITLE\nplates\n/MAT/ELAST/1\nsteel\n"
    rows = [
        f"{7850.0:20g}\n{2.1e11:20g}{0.3:20g}\n/PROP/SHELL/1\nshell\n        24\n\n"
    ]
    rows += [f"{3:10d}{0:10d}{0.005:20g}\n/NODE\n"]
    positions = [(x, y) for x in (0.0, 1.0, 2.0) for y in (0.0, 1.0)]
    rows += [
        f"{node_number:10d}{x:20g}{y:20g}{0.0:20g}\n"
        for node_number, (x, y) in enumerate(positions, start=1)
    ]
    for part, nodes in ((1, (1, 3, 4, 2)), (2, (3, 5, 6, 4))):
        rows += [
            f"/PART/{part}\n{('box', 'step')[part - 1]}\n{1:10d}{1:10d}\n/SHELL/{part}\n"
        ]
        rows += ["".join(f"{number:10d}" for number in (part, *nodes)) + "\n"]
    put(path / f"{root}_0000.rad", head + "".join(rows) + "/END\n")
    put(path / f"{root}_0001.rad", ENGINE.replace("0.26", "0.43"))
    shutil.copy(ROOT / "sample_data" / "rollover_boxT01", path / f"{root}T01")
    return path


def test_the_last_leg_ends_with_the_run_of_the_deck_under_the_name_of_its_files(
    tmp_path: Path,
) -> None:
    """The record ends one output interval before the run; the engine finds its restart file by name."""
    box = write_radioss_run(tmp_path / "run", "BOX")
    times = ("--tr", "0.1", "--td", "0.37", "--part", "1,2", "--after", "0.09")
    result = run("card", *times, "--history", str(box))
    assert "# ---- BOX_0003.rad\n/RUN/BOX/3\n                0.43\n" in result.stdout
    assert (
        "is new, for parts 1, 2" in result.stderr
    )  # one body, because they share nodes
    assert "card-objection" not in result.stderr


@pytest.mark.parametrize(
    "keywords",
    [
        "",
        DATABASES,
        "*DATABASE_GLSTAT\n      0.01\n*DATABASE_MATSUM\n      0.01\n",
    ],
    ids=["no output", "fine output", "coarse output"],
)
def test_a_written_deck_has_the_findings_that_check_finds_in_it_without_a_history(
    tmp_path: Path, keywords: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The deck is only to be run if its window can be used, which the vibration decides.
    monkeypatch.delenv("D2RPICK_PLAN_NO_VERIFY")
    monkeypatch.delenv("D2RPICK_PLAN_MIN_QUALITY")
    box = write_run_folder(tmp_path / "run", extra_keywords=keywords)
    folder = tmp_path / "next"
    command = ("plan", str(box), "--part", "flying", "--write-deck", str(folder))
    written = run(*command).stdout
    counted = re.search(r"\d+ errors?, \d+ warnings?", written)
    assert counted
    checked = run("check", str(folder / "main.k")).stdout
    assert counted[0] in checked
    assert ("D2R111" in written) == (keywords != DATABASES) == ("D2R111" in checked)
    assert "no energy history to choose" not in written
    assert ("read the warnings of the check below" in " ".join(written.split())) == (
        keywords != DATABASES
    )
