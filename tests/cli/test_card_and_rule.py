"""The commands ``card`` and ``rule``, and ``suggest -f card``."""

import re
import shlex
from pathlib import Path

import pytest
from click.testing import Result

from d2rpick.report.formats import FORMATS
from d2rpick.report.rule_texts import explain_rules
from d2rpick.rules import RULES
from tests import paper
from tests.command import BOX, ENERGY, GLSTAT, read_refusal, run, run_json

GOOD = ("--tr", "0.0135867", "--td", "0.0687534")
OPPOSITE = ("--tr", "0.0122659", "--td", "0.064")


pytestmark = pytest.mark.usefixtures("here", "by_level")


def check_pasted(result: Result) -> list[tuple[int, float, float]]:
    """Return the windows that check finds in a printed card; it must find no problems."""
    Path("card.k").write_text(result.stdout)
    check_report = run_json("check", "card.k")
    assert check_report["findings"] == []
    return [
        (window["part"], window["tr"], window["td"])
        for window in check_report["windows"]
    ]


def join_comments(text: str) -> str:
    """Join all comments of a card in one line."""
    return " ".join(
        line.lstrip("$# ") for line in text.split("\n") if line.startswith(("$ ", "# "))
    )


# card, LS-DYNA.


def test_the_card_is_what_the_check_reads() -> None:
    result = run("card", *GOOD, "--part", "12,14-16", "--part", "11", "--merge", "11")
    assert result.exit_code == 0
    assert result.stderr == (
        "next: these times were not judged, because no history was given; add these cards to the main deck, then "
        "check it with d2rpick check DECK (main deck instead of DECK)\n"
    )
    assert check_pasted(result) == [
        (part, 0.0135867, 0.0687534) for part in (11, 12, 14, 15, 16)
    ]
    assert "        12        11      PART\n" in result.stdout
    assert all(len(line) <= 80 for line in result.stdout.split("\n"))


def test_options_of_the_card() -> None:
    text = run(
        "card", *GOOD, "--part", "1", "--step-cap", "1e-5", "--swset", "7", "8"
    ).stdout
    assert re.findall(r"^ +([78]) ", text, flags=re.MULTILINE) == ["7", "8"]
    assert "    1.0e-5         1         0" in text
    assert "DTMAX is 0" not in text


def test_the_times_are_judged_as_they_are_printed() -> None:
    good = run("card", *GOOD, "--part", "1", "--history", ENERGY)
    assert good.exit_code == 0
    assert (
        f"Verdict according to {ENERGY} (internal_energy): use. The flight is"
        in join_comments(good.stdout)
    )
    alone = run(
        "card",
        "--tr",
        "0.1",
        "--td",
        "0.37",
        "--part",
        "1",
        "--solver",
        "ls-dyna",
        "--history",
        BOX,
    )
    assert (
        ": use with care. It is unknown whether the parts are deformed"
        in join_comments(alone.stdout)
    )
    bad = run("card", *OPPOSITE, "--part", "1", "--history", ENERGY)
    assert bad.exit_code == 1
    assert (
        ": DO NOT USE. At tr the deformation has the opposite direction."
        in join_comments(bad.stdout)
    )
    assert "poor-td: 92%" in join_comments(bad.stdout)
    assert (
        "warning: not-verified: the times as printed: do not use: at tr the deformation has the opposite direction"
        in bad.stderr
    )
    assert check_pasted(bad) == [(1, 0.0122659, 0.064)]
    assert (
        run(
            "card", *OPPOSITE, "--part", "1", "--history", ENERGY, "--exit-zero"
        ).exit_code
        == 0
    )
    assert (
        run(
            "card", *GOOD, "--part", "1", "--history", ENERGY, "--after", "0.03"
        ).exit_code
        == 1
    )


def test_a_rounded_time_is_judged_as_printed() -> None:
    tr = paper.CROSSINGS[2][0] / 1e3
    result = run(
        "card", "--tr", repr(tr), "--td", "0.064", "--part", "1", "--history", ENERGY
    )
    assert "is rounded" not in result.stderr
    assert check_pasted(result) == [(1, 0.01288528, 0.064)]
    assert ": DO NOT USE. The vibration after td is wrong by 96%" in join_comments(
        result.stdout
    )
    assert result.exit_code == 1


def test_parts_are_those_of_the_history() -> None:
    result = run(
        "card",
        "--tr",
        "0.0886",
        "--td",
        "0.37",
        "--part",
        "box",
        "--history",
        BOX,
        "--solver",
        "ls-dyna",
    )
    box = next(
        part["id"] for part in run_json("info", BOX)["parts"] if part["title"] == "box"
    )
    assert check_pasted(result) == [(box, 0.0886, 0.37)]
    assert "internal energy of box" in join_comments(result.stdout)
    assert "no part 77" in read_refusal(
        "card", "--tr", "0.0886", "--td", "0.37", "--part", "77", "--history", BOX
    )


def test_a_named_energy_judges_whatever_the_part() -> None:
    args = ("--part", "1", "--history", ENERGY, "--energy", "internal_energy")
    assert run("card", *GOOD, *args).exit_code == 0


def test_the_card_has_no_colour_codes() -> None:
    result = run("card", *GOOD, "--part", "1", color=True, env={"FORCE_COLOR": "1"})
    assert "\x1b" not in result.stdout


def test_the_card_goes_to_a_file() -> None:
    result = run("card", *GOOD, "--part", "1", "-o", "card.k")
    assert (result.exit_code, result.stdout) == (0, "")
    assert run_json("check", "card.k")["findings"] == []
    assert run("card", *GOOD, "--part", "1", "-o", "card.k").exit_code == 2


def test_a_negative_zero_is_printed_as_zero() -> None:
    assert (
        "-0"
        not in run("card", "--tr", "-0.0", "--td", "0.02", "--part", "1").stdout.split(
            "*", 1
        )[1]
    )
    engine = run(
        "card",
        "--solver",
        "radioss",
        "--tr",
        "-0.0",
        "--td",
        "0.02",
        "--node",
        "1",
        "--end",
        "1",
    ).stdout
    assert "-0.0" not in engine


# card, Radioss.


def test_engine_files_of_radioss() -> None:
    args = (
        "--solver",
        "radioss",
        *GOOD,
        "--node",
        "1001,1003-1004",
        "--name",
        "box",
        "--step-cap",
        "1e-6",
    )
    text = run("card", *args, "--end", "0.2").stdout
    assert re.findall(
        r"^/RUN/box/(\d)\n +(\S+)\n/RBODY/(\S+)\n(.*)$", text, flags=re.MULTILINE
    ) == [
        ("1", "0.0135867", "OFF", "1001 1003 1004"),
        ("2", "0.0687534", "ON", "1001 1003 1004"),
        ("3", "0.2", "OFF", "1001 1003 1004"),
    ]
    assert "/DTIX\n1e-06 1e-06\n" in text
    judged = run("card", *args, "--history", ENERGY)
    assert judged.exit_code == 0
    assert "                0.15\n" in judged.stdout
    assert ": use. The flight" in join_comments(judged.stdout)


@pytest.mark.parametrize("solver", ["ls-dyna --part 1", "radioss --node 1 --end 0.2"])
def test_what_a_real_solver_does_at_the_switches_is_told(solver: str) -> None:
    comment_text = join_comments(
        run("card", "--solver", *shlex.split(solver), *GOOD).stdout
    )
    for phrase in (
        "first time step at or after",
        "co-rotational",
        "vibration is lost",
        "from a run that is rigid in it",
    ):
        assert phrase in comment_text


# suggest -f card.


def test_suggest_prints_the_card_of_its_pair() -> None:
    args = ("suggest", "--td", "0.37", "--part", "box", BOX)
    pair = run_json(*args)["recommended"]
    result = run(
        *args,
        "-f",
        "card",
        "--solver",
        "ls-dyna",
        "--step-cap",
        "1e-5",
        "--swset",
        "7",
        "8",
        "--merge",
        "3",
    )
    assert result.exit_code == 0
    ((part, tr, td),) = check_pasted(result)
    assert tr == pytest.approx(pair["tr"], abs=1e-8)
    assert re.findall(r"^ +([78]) ", result.stdout, flags=re.MULTILINE) == ["7", "8"]
    assert f"{part:10d}         3      PART" in result.stdout
    assert "    1.0e-5         1         0" in result.stdout
    assert td == 0.37
    assert f"--part {part} " not in result.stdout
    assert ": use with care. " in join_comments(result.stdout)


def test_the_card_is_that_of_the_solver_that_wrote_the_history() -> None:
    args = ("suggest", "--td", "0.37", "--part", "box", BOX, "-f", "card")
    engine = run(*args, "--node", "1001", "--name", "box")
    assert engine.exit_code == 0
    assert re.findall(r"^/RUN/box/(\d)", engine.stdout, flags=re.MULTILINE) == [
        "1",
        "2",
        "3",
    ]
    assert "a card for Radioss needs --node" in read_refusal(*args)
    lead = run(*args, "--node", "1001", "--merge", "3")
    assert "--merge is an option of --solver ls-dyna" in lead.stderr
    card = (
        "card",
        "--tr",
        "0.0886",
        "--td",
        "0.37",
        "--part",
        "box",
        "--history",
        BOX,
        "--node",
        "1001",
    )
    assert "/RBODY/ON" in run(*card).stdout


@pytest.mark.parametrize("form", [*FORMATS["suggestion"], "card"])
def test_parts_that_the_history_does_not_have_are_refused_in_every_form(
    form: str,
) -> None:
    for history in (GLSTAT, ENERGY):
        refused = [
            run("suggest", "--td", "0.064", "--part", "11", history, "-f", form_name)
            for form_name in ("table", form)
        ]
        assert [(result.exit_code, result.stdout) for result in refused] == [
            (2, "")
        ] * 2
        assert refused[0].stderr == refused[1].stderr
    page = run(
        "suggest", "--td", "0.064", "--part", "11", ENERGY, "--report", "page.html"
    )
    assert (page.exit_code, Path("page.html").exists()) == (2, False)


def test_a_card_says_whose_level_it_is_and_names_many_parts_by_sets() -> None:
    arguments = ("card", *GOOD, "--part", "101-130", "--history", ENERGY, "-o")
    assert (
        run(*arguments, "alone.k").exit_code
        == run(*arguments, "merged.k", "--merge", "101").exit_code
        == 0
    )
    assert "table does not name the parts of the internal energy" in join_comments(
        Path("alone.k").read_text()
    )
    of_solver = run("card", *GOOD, "--part", "1", "--history", GLSTAT, "--exit-zero")
    assert "that of the whole model" in join_comments(of_solver.stdout)
    assert "whole model" not in join_comments(run("card", *GOOD, "--part", "1").stdout)
    for card in ("alone.k", "merged.k"):
        assert Path(card).read_text().count("PSET") == 2
        assert sorted(
            window["part"] for window in run_json("check", card)["windows"]
        ) == [*range(101, 131)]
    assert "       902       101      PSET" in Path("merged.k").read_text()


def test_options_of_a_card_belong_to_a_card() -> None:
    assert (
        "is an option of the card"
        in run("suggest", "--td", "0.0687534", ENERGY, "--merge", "11").stderr
    )


def test_several_windows_are_one_card() -> None:
    windows = [(0.02, 0.09), (0.2, 0.3), (0.5, 0.75)]
    pairs = [text for tr, td in windows for text in ("--tr", str(tr), "--td", str(td))]
    result = run("card", *pairs, "--part", "11")
    assert [(tr, td) for _, tr, td in check_pasted(result)] == windows
    Path("switches.txt").write_text("".join(f"{tr} {td}\n" for tr, td in windows))
    assert (
        run("card", "--windows", "switches.txt", "--part", "11").stdout == result.stdout
    )
    assert (
        run(
            "card",
            "--windows",
            "-",
            "--part",
            "11",
            stdin=Path("switches.txt").read_bytes(),
        ).stdout
        == result.stdout
    )
    judged = run("card", *pairs, "--part", "1", "--history", ENERGY)
    assert judged.exit_code == 2  # 0.3 is outside the record
    two = ("--tr", "0.0135867", "--td", "0.0687534", "--tr", "0.0939", "--td", "0.119")
    assert (
        join_comments(
            run("card", *two, "--part", "1", "--history", ENERGY).stdout
        ).count("Verdict according to")
        == 2
    )


def test_suggest_without_a_pair_prints_no_card() -> None:
    result = run(
        "suggest", "--td", "0.37", "--part", "box", BOX, "-f", "card", "--margin", "0.3"
    )
    assert (result.exit_code, result.stdout) == (1, "")
    assert "no-candidate" in result.stderr


def test_suggest_needs_the_parts_for_a_card() -> None:
    message = read_refusal("suggest", "--td", "0.064", "-f", "card", ENERGY)
    assert "-f card needs --part" in message
    assert (
        "where the history has no parts: d2rpick card --tr T --td T --part IDS --history FILE"
        in message
    )


# rule.


def test_rules_are_listed() -> None:
    lines = run("rule").stdout.splitlines()
    assert [line.split()[0] for line in lines] == list(RULES)
    assert (
        "D2R105  error    a window whose times are both 0 (decimals lost in writing)"
        in lines
    )


@pytest.mark.parametrize("name", RULES)
def test_a_rule_is_explained_with_its_examples(name: str) -> None:
    text = run("rule", "-v", name.lower()).stdout
    rule = RULES[name]
    assert " ".join(text.split()).startswith(
        f"{name} ({rule.severity}): {rule.summary}"
    )
    assert f"{rule.explanation} Fix: {rule.fix} Passes" in " ".join(text.split())
    for example in (*rule.passing, *rule.failing):
        assert f"\n\n{example.deck.rstrip()}\n" in text
        assert all(f"with {file}:" in text for file in example.files)
    assert text.count("Passes") == len(rule.passing)
    assert text.count("Fails") == len(rule.failing)


def test_a_rule_without_its_examples_fits_on_a_screen() -> None:
    for name, rule in RULES.items():
        lines = explain_rules([name], 100).splitlines()
        assert len(lines) <= 24
        count = len(rule.passing) + len(rule.failing)
        assert lines[-1] == f"Example decks ({count}): d2rpick rule -v {name}"
    assert run("rule", "D2R406").stdout == f"{explain_rules(['D2R406'], 100)}\n"


def test_an_example_that_is_judged_by_a_history_says_how_to_run_it() -> None:
    text = run("rule", "-v", "D2R204").stdout
    example_command = (
        text.split("history of\n")[1].split("\nchecked")[0].replace("\\\n", "")
    )
    assert (
        "checked by d2rpick check main.k --history energy.csv --after 0.03:\n" in text
    )
    assert run(*shlex.split(example_command)[1:]).exit_code == 0
    assert Path("energy.csv").is_file()


def test_the_beginning_of_an_id_gives_all_of_them_and_near_misses_are_named() -> None:
    assert re.findall(
        r"^(D2R\d+) \(", run("rule", "D2R3").stdout, flags=re.MULTILINE
    ) == [f"D2R30{number}" for number in range(1, 8)]
    assert re.fullmatch(
        r"no rule 'D2R1O5', .* did you mean D2R1\d5\?", read_refusal("rule", "D2R1O5")
    )
