"""Refused input gives one line with place, cause and cure; a record without an answer is reported as a problem."""

import gzip
import json
import math
import re
import shlex
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.command import (
    ENERGY,
    GLSTAT,
    list_warning_codes,
    put,
    read_refusal,
    run,
    run_json,
)
from tests.json_schemas import run_json_checked

HEAD = "time,internal_energy\n"


def tabulate(energy: Callable[[float], float], states: int = 101) -> bytes:
    """Return a CSV file with an energy at every 0.01 s."""
    return (
        HEAD + "".join(f"{i / 100!r},{energy(i / 100)!r}\n" for i in range(states))
    ).encode()


def replace_line(number: int, line: str) -> bytes:
    """Return a good CSV file with another line ``number``."""
    lines = tabulate(lambda t: t * t).decode().split("\n")
    lines[number - 1] = line
    return "\n".join(lines).encode()


# Files that are not histories: content, further arguments, and parts of the message.
FILES = {
    "empty": (b"", (), ["input: the file is empty", "wait until the run has written some"]),
    "binary": (bytes(range(256)) * 20, (), ["input: binary data", "csv", "glstat", "export"]),
    "prose": (b"Dear all,\nplease find enclosed\n", (), ["input:1: 'Dear all,'", "a table of time and energy"]),
    "header only": (HEAD.encode(), (), ["input:1: ", "no rows"]),
    "one state": (tabulate(lambda _: 1.0, 1), (), ["input: 1 state", "at least 3"]),
    "two states": (tabulate(lambda t: 1 + t, 2), (), ["input: 2 states", "at least 3"]),
    "nan": (replace_line(7, "0.05,nan"), (), ["input:7: 'internal_energy' is 'nan'", "a number was expected", "line"]),
    "infinite": (replace_line(7, "0.05,inf"), (), ["input:7: 'internal_energy' is 'inf'", "a number was expected"]),
    "a word": (replace_line(7, "0.05,stop"), (), ["input:7: 'internal_energy' is 'stop'", "a number was expected"]),
    "an empty cell": (replace_line(7, "0.05,"), (), ["input:7: 'internal_energy' is ''", "a number was expected"]),
    "a cell too few": (replace_line(7, "0.05"), (), ["input:7: 1 value", "2 were expected"]),
    "a time that is none": (replace_line(7, "later,1"), (), ["input:7: 'time' is 'later'", "a number was expected"]),
    "damaged gzip": (gzip.compress(tabulate(math.cos))[:10] + b"\xff" * 99, (), ["input: damaged gzip data", "again"]),
    "not glstat": (tabulate(math.cos), ("-F", "glstat"), ["input:1: ", "this is not a glstat"]),
    "no state of glstat": (
        b" title\n                         ls-dyna smp.1 d\n\n\n", (), ["input: no states", "first output"]
    ),
    "several energies": (
        b"time,IE_a,IE_b\n0,1,2\n1,2,3\n2,3,4\n", (), ["input: 2 columns", "--energy", "2 'IE_a', 3 'IE_b'"]
    ),
    "no energy": (
        b"time,vx,vy\n0,1,2\n1,2,3\n2,3,4\n", (),
        ["input: none of the columns is an energy", "--energy", "2 'vx', 3 'vy'"]
    ),
    "unknown column": (tabulate(math.cos), ("--energy", "heat"), ["input: no column 'heat'", "2 'internal_energy'"]),
    "column misspelt": (
        tabulate(math.cos), ("--energy", "internal_enrg"),
        ["no column 'internal_enrg'", "did you mean 'internal_energy'"]
    ),
    "column zero": (tabulate(math.cos), ("--energy", "0"), ["no column '0'", "1 'time'"]),
    "energy is the time": (tabulate(math.cos), ("--energy", "time"), ["input: ", "choose another one"]),
    "td after the record": (tabulate(math.cos), ("--td", "7"), ["input: ", "--td 7 lies outside the record, 0 to 1"]),
    "after outside": (tabulate(math.cos), ("--after", "7"), ["input: --after 7 lies outside the record, 0 to 1"]),
    "window outside": (tabulate(math.cos), ("--fit-window", "0", "7"), ["--fit-window 0 7 reaches outside the record"]),
}  # fmt: skip


@pytest.mark.parametrize("case", FILES)
@pytest.mark.parametrize("command", ["suggest", "verify"])
@pytest.mark.usefixtures("here")
def test_a_file_that_cannot_be_used_is_named_with_what_is_wrong(
    command: str, case: str
) -> None:
    content, args, parts = FILES[case]
    Path("input").write_bytes(content)
    first = ("suggest",) if command == "suggest" else ("verify", "--tr", "0")
    message = read_refusal(*first, "--td", "0.5", *args, "input")
    assert message.startswith("input:")
    for part in parts:
        assert part in message


@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("suggest --td 0.064 --margin 1e308", 2),
        ("suggest --td-window 0.06 0.07 --margin 1e308", 2),
        ("explore --td-window 0.06 0.07 --steps 2 --margin 1e308", 2),
        ("plan --margin 1e308", 2),
        ("suggest --td 0.064 --margin 1e-308", 0),
        ("suggest --td 0.064 --margin -0.0", 0),
        ("suggest --td 0.064 --max-residual 1e308", 0),
        ("study --td 0.064 --jobs 1 --max-residual 1e155", 0),
        ("verify --tr 0.0128853 --td 0.064 --tolerance 5e-324", 1),
        ("suggest --td 0.064 --cost-share 1e-308 --step-ratio 1e308", 0),
    ],
)
def test_a_number_of_any_size_has_an_answer(line: str, code: int) -> None:
    result = run(*shlex.split(line), ENERGY)  # numpy would warn here
    assert result.exit_code == code, result.stderr
    assert "error" not in result.stderr


# Readable records without an answer: content, arguments, and the warning that gives the reason.
OBJECTIONS = {
    "constant": (tabulate(lambda _: 5.0), (), "no-candidate"),
    "zero": (tabulate(lambda _: 0.0), (), "no-energy"),
    "negative at td": (tabulate(lambda t: math.cos(6 * t) - 0.5), (), "no-energy"),
    "only rising": (tabulate(lambda t: t), (), "no-candidate"),
    "td at the start": (
        tabulate(lambda t: 1 + math.cos(9 * t)),
        ("--td", "0"),
        "no-candidate",
    ),
    "td in the load": (
        tabulate(lambda t: 1 + math.cos(9 * t)),
        ("--after", "0.7"),
        "td-in-load",
    ),
    "end of the load unknown": (
        tabulate(lambda t: 1 + t + math.cos(30 * t)),
        ("--no-verify",),
        "no-flight",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", OBJECTIONS)
@pytest.mark.usefixtures("here")
def test_a_record_without_an_answer_is_an_objection_and_says_why(case: str) -> None:
    content, args, code = OBJECTIONS[case]
    Path("input").write_bytes(content)
    suggestion = run_json_checked("suggest", "--td", "0.5", *args, "input")
    assert suggestion["recommended"] is None
    assert not any(candidate["acceptable"] for candidate in suggestion["candidates"])
    assert {code, "no-candidate"} <= list_warning_codes(suggestion)
    for form in ("table", "value"):
        result = run("suggest", "--td", "0.5", *args, "-f", form, "input")
        assert result.exit_code == 1
        messages = [
            line.split(": ")[1]
            for line in result.stderr.splitlines()
            if line.startswith("warning")
        ]
        in_table = (
            {"no-candidate"} if form == "table" else {}
        )  # the warning gives the reason
        assert messages == [
            warning["code"]
            for warning in suggestion["warnings"]
            if warning["code"] not in in_table
        ]


@pytest.mark.slow
def test_where_nothing_flies_a_td_is_asked_for_and_a_plan_is_an_objection(
    tmp_path: Path,
) -> None:
    file = put(tmp_path / "input", tabulate(lambda t: t * t))
    for command in ("suggest", "explore"):
        assert (
            "no flight is found in the record, so no td can be chosen: the energy never falls; "
            "if you know the end of the load, give it as --after"
            in read_refusal(command, str(file))
        )
    assert run("plan", str(file)).exit_code == 1


def test_a_pair_in_the_load_is_an_objection_with_its_reason() -> None:
    verdict = run_json(
        "verify", "--tr", "0.0128853", "--td", "0.064", "--after", "0.1", ENERGY
    )
    assert (verdict["verified"], verdict["tr_ok"]) == (False, False)
    assert any(
        "before the end of the load at 0.1" in reason for reason in verdict["reasons"]
    )


def test_a_td_behind_the_next_contact_is_an_objection(tmp_path: Path) -> None:
    lines = Path(ENERGY).read_text().splitlines()
    rows = [line.split(",") for line in lines[1:]]
    hit = [f"{t},{float(e) + max(0.0, float(t) - 0.1) * 1e4!r}" for t, *_, e, _ in rows]
    file = put(tmp_path / "hit.csv", "\n".join([HEAD.strip(), *hit, ""]))
    suggestion = run_json("suggest", "--td", "0.09", "--margin", "0.02", str(file))
    assert suggestion["flight"]["end"] == pytest.approx(0.1, abs=1e-3)
    assert suggestion["recommended"] is None
    assert "td-after-contact" in list_warning_codes(suggestion)
    assert (
        run_json(
            "verify", "--tr", "0.0135867", "--td", "0.09", "--margin", "0.02", str(file)
        )["td_ok"]
        is False
    )
    assert (
        run_json("suggest", "--td", "0.0687534", "--margin", "0.005", str(file))[
            "recommended"
        ]
        is not None
    )


def test_of_a_time_behind_a_cut_the_cut_is_said_before_a_unit(tmp_path: Path) -> None:
    file = put(tmp_path / "glstat", Path(GLSTAT).read_bytes()[:100_000])
    result = run("suggest", "--td", "64", str(file)).stderr
    assert re.search(r"outside the record, 0 to [\d.]+, where the file is cut", result)
    assert "meant" not in result or result.index("cut") < result.index("meant")


@pytest.mark.slow
@pytest.mark.parametrize("source", [ENERGY, GLSTAT])
def test_a_history_cut_anywhere_is_refused_or_answered_from_what_is_left(
    source: str, tmp_path: Path
) -> None:
    data, file = Path(source).read_bytes(), tmp_path / "cut"
    for size in [0, 1, 50, 200, 700, 5_000, len(data) // 2, len(data) - 1]:
        file.write_bytes(data[:size])
        result = run("suggest", "--td", "0.064", "-f", "json", str(file))
        assert result.exit_code in (0, 1, 2)
        assert "Traceback" not in result.stderr
        assert (result.exit_code == 2) == (result.stdout == "")
        if result.stdout:
            document = json.loads(result.stdout)
            assert document["history"]["time_end"] <= 0.15
            assert document["recommended"]["tr"] == pytest.approx(
                0.0128852793630525, rel=1e-5
            )
