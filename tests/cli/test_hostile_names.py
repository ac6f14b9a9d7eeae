"""Names with control codes, markup, and characters special to shells, spreadsheets and terminals, in every output."""

import csv
import html
import io
import json
import os
import re
import shutil
import subprocess
import unicodedata
import xml.etree.ElementTree as ET
from html.parser import HTMLParser
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from d2rpick.base.errors import UNSEEN, make_printable
from d2rpick.report.figures import add_unit
from d2rpick.report.tables import (
    as_json,
    as_markdown,
    escape_markdown,
    make_positional,
    quote_shell_line,
    quote_windows_line,
)
from tests.command import DECK, ENERGY, ROOT, run
from tests.sample_deck import DECK as SAMPLE_DECK

NAME = (
    "-rf\r\nred\t\x1b[31m\x07\x7f\x9b1m\x85\u2028\u202e\u2066\u200b\ufeff\u00ad<script>alert('1')<!--\" onload=\""
    "\\|b|*c*_d_[e](f)$^{_$=1+1,;%0A::error::$(touch a);`touch b`&&!e ä部\\"
)
MATSUM = ROOT / "sample_data" / "rollover_box.matsum"
NO_TEXT = "run\udcff\udc80"
FORMS = {
    ("suggest", "--td", "0.064"): (
        "table",
        "json",
        "ndjson",
        "csv",
        "markdown",
        "value",
    ),
    ("verify", "--tr", "0.0135867", "--td", "0.0687534"): (
        "table",
        "json",
        "csv",
        "markdown",
    ),
    ("study", "--jobs", "1", "--td", "0.064"): (
        "table",
        "json",
        "ndjson",
        "csv",
        "markdown",
    ),
    ("info",): ("table", "json", "csv", "markdown"),
    ("plan", "--exit-zero"): ("table", "json", "markdown"),
}
CHECKS = ("table", "json", "ndjson", "github", "junit", "sarif")


def find_unseen(text: str) -> set[str]:
    """Return the characters of a text that a terminal executes or does not show."""
    return {letter for letter in text if unicodedata.category(letter) in UNSEEN} - {
        "\n"
    }


def split_by_shell(line: str) -> list[bytes]:
    """Return the words of a command line as a shell reads them."""
    process = subprocess.run(
        ["bash", "-c", f"printf '%s\\0' {line}"], capture_output=True, check=True
    ).stdout
    return process.split(b"\0")[:-1]


def test_a_shell_gives_back_the_words_of_a_command() -> None:
    words = [
        NAME,
        NO_TEXT,
        "plain",
        "",
        *(os.fsdecode(bytes([byte, 48])) for byte in range(1, 256)),
    ]
    line = quote_shell_line(words)
    assert line.isprintable()
    assert not re.search(
        r"(?<!\\)(\\\\)*\\x", line
    )  # shells disagree about the end of this escape before a digit
    assert split_by_shell(line) == [os.fsencode(word) for word in words]


def split_as_windows(line: str) -> list[str]:
    """Return the words of a command line as the C library of Windows reads them."""
    words, word, is_quoted, slashes = [], "", False, 0
    for letter in f"{line} ":
        if letter == "\\":
            slashes += 1
            continue
        if letter == '"':
            word += "\\" * (slashes // 2)
            if slashes % 2:
                word += letter
            else:
                is_quoted = not is_quoted
        else:
            word += "\\" * slashes
            if letter == " " and not is_quoted:
                words.append(word)
                word = ""
            else:
                word += letter
        slashes = 0
    return words


@given(st.lists(st.text("ab ,;'&\"\\%$-.:=", max_size=8), max_size=4))
def test_windows_gives_back_the_words_of_a_command(words: list[str]) -> None:
    line = quote_windows_line(["d2rpick", *words])
    assert split_as_windows(line) == ["d2rpick", *words]
    # Without quotes, cmd ends a command at &, and PowerShell splits a word at a comma.
    assert not re.search(r"[,;'&%$]", re.sub(r'"(?:\\.|[^"\\])*"', "", line))


def test_files_that_begin_with_a_dash_are_typed_behind_two() -> None:
    assert make_positional(["-", "run.csv"]) == ("-", "run.csv")
    assert make_positional(["run.csv", "--td"]) == ("--", "run.csv", "--td")


@given(st.text(max_size=60))
def test_json_gives_a_name_back_in_signs_that_are_seen(name: str) -> None:
    for indent in (2, None):
        text = as_json({name: [name]}, indent)
        assert json.loads(text) == {name: [name]}
        assert not find_unseen(text)


@given(st.text(max_size=40), st.text(max_size=40))
def test_a_name_stays_in_its_cell_of_a_markdown_table(
    first_name: str, second_name: str
) -> None:
    rows = as_markdown(["a", "b"], [[first_name, second_name]]).split("\n")[2:]
    assert len(rows) == 1
    assert re.sub(r"\\.", "", rows[0]).count("|") == 3
    assert re.sub(
        r"\\([\\|<*\[~&_])", r"\1", escape_markdown(first_name)
    ) == make_printable(first_name)


@pytest.mark.slow
@pytest.mark.parametrize("command", FORMS, ids=lambda command: command[0])
def test_answers_name_a_file_without_control_codes(
    command: tuple[str, ...], here: Path
) -> None:
    shutil.copy(ENERGY, here / NAME)
    for form in FORMS[command]:
        result = run(*command, "-f", form, "--", NAME)
        assert result.exit_code == 0, result.stderr
        assert not find_unseen(result.stdout + result.stderr)
        if "json" in form:
            documents = [
                json.loads(line)
                for line in (
                    result.stdout.split("\n") if form == "ndjson" else [result.stdout]
                )
                if line
            ]
            assert documents[-1]["command"][-1] == NAME
            assert command != ("info",) or documents[-1]["source"] == [NAME]
        if form == "table":
            assert "".join(make_printable(NAME).split()) in "".join(
                (result.stdout + result.stderr).split()
            )
        if form == "csv":
            rows = list(csv.reader(io.StringIO(result.stdout), strict=True))
            assert len({len(row) for row in rows}) == 1
            assert command[0] != "study" or any(
                make_printable(NAME) in cell for cell in rows[1]
            )
        if form == "markdown":
            assert not re.search(r"(?<!\\)<script", result.stdout)
            assert (
                command[0] not in ("info", "study")
                or escape_markdown(NAME) in result.stdout
            )


@pytest.mark.parametrize("name", ["=cmd.csv", "+1+2.csv", "-2+3.csv", "@sum.csv"])
def test_a_spreadsheet_computes_no_name(name: str, here: Path) -> None:
    shutil.copy(ENERGY, here / name)
    for command in (("info",), ("study", "--jobs", "1", "--td", "0.064")):
        (row,) = csv.DictReader(
            io.StringIO(run(*command, "-f", "csv", "--", name).stdout), strict=True
        )
        assert row["source"] == f"'{name}"
    assert json.loads(run("info", "-f", "json", "--", name).stdout)["source"] == [name]


@pytest.mark.parametrize(
    "arguments", [("--td", "9"), ("--td", "0.064", "--energy", "no\nsuch\x1b")]
)
def test_refusals_name_a_file_without_control_codes(
    arguments: tuple[str, ...], here: Path
) -> None:
    shutil.copy(ENERGY, here / NAME)
    result = run("suggest", *arguments, "--", NAME)
    assert make_printable(NAME) in result.stderr
    assert not find_unseen(result.stderr)


@pytest.mark.parametrize("form", ["table", "json", "csv", "markdown"])
def test_why_a_set_of_parts_has_no_window_is_told_without_control_codes(
    form: str, here: Path
) -> None:
    shutil.copy(MATSUM, here / NAME)
    result = run(
        "parts", "--td", "9", "--deck", str(SAMPLE_DECK), "-f", form, "--", NAME
    )
    assert result.exit_code == 2
    assert "outside the record" in result.stderr
    assert not find_unseen(result.stdout + result.stderr)
    assert form != "markdown" or not re.search(r"(?<!\\)<script", result.stdout)


@pytest.mark.parametrize("form", CHECKS)
def test_findings_name_a_deck_and_a_history_without_control_codes(
    form: str, here: Path
) -> None:
    deck = f"{NAME}.k"
    shutil.copy(ENERGY, here / NAME)
    shutil.copy(DECK, here / deck)
    result = run("check", "-f", form, "--history", NAME, "--", deck, f"no{NAME}")
    assert result.exit_code == 1
    assert not find_unseen(result.stdout + result.stderr)
    assert result.stderr.count("\n") == result.stderr.count("d2rpick: ")
    if form in ("json", "sarif"):
        json.loads(result.stdout)
    if form == "json":
        assert json.loads(result.stdout)["decks"] == [deck]
    if form == "junit":
        assert ET.fromstring(result.stdout).find("testsuite") is not None
    if form == "github":
        assert all(
            re.match(r"::(error|warning|notice) file=[^,:]*[,:]", line)
            for line in result.stdout.splitlines()
        )


@pytest.mark.parametrize("name", [NAME, NO_TEXT], ids=["hostile", "no text"])
def test_cards_settings_and_messages_are_text(name: str, here: Path) -> None:
    shutil.copy(ENERGY, here / os.fsencode(name).decode(errors="surrogateescape"))
    times = ("--tr", "0.0135867", "--td", "0.0687534")
    card = run("card", *times, "--part", "1", "--history", name)
    assert card.exit_code == 0
    comments, _, cards = card.stdout.partition("*DEFORMABLE_TO_RIGID_AUTOMATIC")
    assert cards
    assert all(line.startswith("$") for line in comments.splitlines())
    for result in (
        card, run("suggest", "--td", "0.064", "--show-settings", "--", name), run("info", "-v", "--", name),
        run("study", "--td", "1", "--", f"no{name}"), run("study", "--td", "9", "--jobs", "1", "--", name),
    ):  # fmt: skip
        assert "internal error" not in result.stderr
        assert not find_unseen(result.stdout + result.stderr)


@pytest.mark.slow
@pytest.mark.parametrize(
    "command",
    [command for command in FORMS if command[0] != "info"],
    ids=lambda one: one[0],
)
def test_pages_show_a_name_as_text_and_repeat_it_for_a_shell(
    command: tuple[str, ...], here: Path
) -> None:
    names = {"hostile": NAME, "plain": "-plain.csv"}
    pages = {}
    for kind, name in names.items():
        shutil.copy(ENERGY, here / name)
        assert (
            run(
                *(*command, "--no-verify", *accept_poor(command)),
                *("--report", f"{kind}.html", "--", name),
            ).exit_code
            == 0
        )
        pages[kind] = Path(f"{kind}.html").read_text("utf-8")
        lines = [
            html.unescape(line)
            for line in re.findall(
                r'<pre class="wrap">(.*?)</pre>', pages[kind], re.DOTALL
            )
        ]
        repeated = [line for line in lines if line.startswith(f"d2rpick {command[0]}")]
        assert split_by_shell(repeated[-1])[-1] == os.fsencode(name)
    counts = [Tags.of(page) for page in pages.values()]
    assert counts[0] == counts[1]
    assert not find_unseen(pages["hostile"]) & {*"\x1b\x9b\x85\u202e\u2066"}


def accept_poor(command: tuple[str, ...]) -> tuple[str, ...]:
    """Return the options with which a command passes with the poor pair of an energy level alone."""
    return ("--min-quality", "poor") if command[0] == "verify" else ()


class Tags(HTMLParser):
    """Parser that counts elements and event handlers."""

    @classmethod
    def of(cls, page: str) -> dict[str, int]:
        tags = cls()
        tags.counts = {}
        tags.feed(page)
        return {
            name: tags.counts.get(name, 0)
            for name in ("script", "img", "iframe", "style", "onload")
        }

    counts: dict[str, int]

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name in (tag, *(key for key, _ in attrs)):
            self.counts[name] = self.counts.get(name, 0) + 1


def test_a_study_of_a_name_that_is_no_text_can_be_reported(here: Path) -> None:
    shutil.copy(ENERGY, here / NO_TEXT)
    result = run("study", "--td", "0.064", "--report", "page.html", NO_TEXT, ENERGY)
    assert result.exit_code == 0
    assert "run\ufffd" in (here / "page.html").read_text("utf-8")


def test_a_list_of_runs_may_name_files_with_any_sign_but_a_line_feed(
    here: Path,
) -> None:
    name = "run\u2028\x85\x0b\x1c.csv"
    shutil.copy(ENERGY, here / name)
    result = run(
        "study",
        "--jobs",
        "1",
        "--td",
        "0.064",
        "-f",
        "json",
        "--from",
        "-",
        stdin=f"{name}\r\n".encode(),
    )
    assert [one_run["source"] for one_run in json.loads(result.stdout)["runs"]] == [
        name
    ]


def test_a_unit_is_no_formula_of_a_figure(here: Path) -> None:
    head, rows = Path(ENERGY).read_text("utf-8").split("\n", 1)
    Path("run.csv").write_text(
        head.replace("time", '"Time ($^{_$)"') + "\n" + rows, "utf-8"
    )
    assert (
        run("suggest", "--td", "0.064", "--plot", "plot.svg", "run.csv").exit_code == 0
    )
    assert ET.parse(here / "plot.svg") is not None
    assert add_unit("time", "$x$") == r"time [\$x\$]"
