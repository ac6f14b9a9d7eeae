"""Settings files from other people start no program, write no file, and never crash a command."""

import os
import tomllib
from itertools import product
from pathlib import Path
from typing import Final

import click
import pytest
from hypothesis import given, settings, strategies as st

from d2rpick.cli import COMMANDS, d2rpick
from d2rpick.cli.values import spell_option
from tests.command import ENERGY, put, read_refusal, run

ASKED: Final = ("suggest", "--td", "0.0687534", ENERGY)
# Arguments that a command needs before it reads its settings.
NEEDED: Final[dict[str, tuple[str, ...]]] = {
    "drive": ("x", "-o", "y"),
    "verify": ("--tr", "1", "x"),
    "study": ("--td", "1", "x"),
    "follow": ("x",),
    "card": ("--tr", "1", "--td", "2"),
    "first": ("x", "-o", "y"),
    "rule": (),
    "replay": (
        "--stiffness",
        "1",
        "--mass",
        "1",
        "--v0",
        "1",
        "--t-end",
        "1",
        "--dt",
        "1",
    ),
    "rollover": (),
    "reproduce": ("--output-dir", "x"),
}
FORBIDDEN: Final = {
    **dict.fromkeys(
        ("output-file", "plot", "report", "write-deck", "output-dir", "resume", ""),
        "'x'",
    ),
    **dict.fromkeys(("starter", "engine", "scheduler"), "'x'"),
    **dict.fromkeys(("overwrite", "debug", "verbose", "show-settings"), "true"),
}
# Values of every type of TOML.
VALUES: Final = (
    *(
        "'text'",
        "''",
        "'a\tb'",
        '"\\u0000"',
        '"\\u001b[31m"',
        "'0.06 0.07'",
        "'1'",
        "'\U0001f4a9'",
    ),
    *("0", "1", "-1", "0x7fffffffffffffff", "9223372036854775808", "1" + "0" * 400),
    *("1.5", "-0.0", "1e999", "inf", "-inf", "nan", "true", "false"),
    *("1979-05-27", "07:32:00", "1979-05-27T07:32:00", "1979-05-27T07:32:00Z"),
    *(
        "[]",
        "[1]",
        "[1, 2]",
        "['a']",
        "['a', 'b']",
        "[[1, 2], [3, 4]]",
        "[true]",
        "[1979-05-27]",
        "[{}]",
        "[1, 'a']",
    ),
    *("{}", "{a = 1}", "{a = {b = [1979-05-27]}}"),
)


def list_options(command: str) -> list[str]:
    """Return the settings keys of a command."""
    command_object = d2rpick.get_command(click.Context(d2rpick), command)
    assert command_object
    return [
        spell_option(option)
        for option in command_object.params
        if isinstance(option, click.Option)
    ]


def ask_with_settings(command: str, text: str) -> str:
    """Run a command with these settings, and return its one-line refusal, which must not be an internal error."""
    put(Path("d2rpick.toml"), text)
    result = run(command, *NEEDED.get(command, ("x",)), "--show-settings")
    assert "internal error" not in result.stderr, text
    if result.exit_code:
        assert (result.exit_code, result.stdout, result.stderr.count("\n")) == (
            2,
            "",
            1,
        ), text
    return result.stderr


def write_settings_table(command: str, key: str, value: str) -> str:
    return f'[{command}]\n"{key}" = {value}\n'


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("command", [*COMMANDS])
def test_no_program_no_output_and_no_overwriting_comes_from_a_file(
    command: str,
) -> None:
    dangerous = [
        key
        for key in list_options(command)
        if key in FORBIDDEN and (command, key) != ("drive", "resume")
    ]
    assert {"debug", "verbose", "show-settings"} <= {*dangerous}
    for key in dangerous:
        message = ask_with_settings(
            command, write_settings_table(command, key, FORBIDDEN[key])
        )
        assert f"d2rpick.toml:2: {key}: " in message
        assert "never taken from a file; remove the key" in message


@pytest.mark.usefixtures("here")
@settings(max_examples=5)
@given(
    st.sampled_from(
        [(command, key) for command in COMMANDS for key in list_options(command)]
    )
)
def test_a_value_of_any_type_is_taken_or_refused(option: tuple[str, str]) -> None:
    for value in VALUES:
        ask_with_settings(option[0], write_settings_table(*option, value))


@pytest.mark.slow
@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("command", [*COMMANDS])
def test_each_key_with_each_type_of_value_is_taken_or_refused(command: str) -> None:
    for key, value in product(list_options(command), VALUES):
        ask_with_settings(command, write_settings_table(command, key, value))
        ask_with_settings(command, f'"{key}" = {value}\n')


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    "key",
    ["select", "severity", "severity.D2R101", "suggest", "check", '""', "td", "margin"],
)
def test_a_shared_key_takes_or_refuses_a_value_of_any_type(key: str) -> None:
    for value in VALUES:
        ask_with_settings("suggest", f"{key} = {value}\n")
        checked = run("check", "x.k")
        assert checked.exit_code == 2
        assert "internal error" not in checked.stderr
    ask_with_settings("suggest", f"[[{key}]]\na = 1\n")


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("td = 1979-05-27", "td is 1979-05-27, but a number or a text was expected"),
        ("td-window = '12'", "td-window is '12', but a list was expected"),
        ("limit = 1.5", "limit is 1.5, but a whole number was expected"),
        ("weights = 3", "weights is 3, but a text was expected"),
        ("energy = [true]", "energy is [True], but a number or a text was expected"),
        (
            f"margin = {'9' * 99}",
            f"margin is {'9' * 60} ..., but a number or a text was expected",
        ),
    ],
)
def test_a_value_of_the_wrong_type_is_refused_with_what_was_expected(
    line: str, message: str
) -> None:
    put(Path("d2rpick.toml"), f"[suggest]\n{line}\n")
    assert message in read_refusal("suggest", ENERGY)


@pytest.mark.usefixtures("here")
def test_a_key_of_any_length_is_named_in_a_short_message() -> None:
    put(Path("d2rpick.toml"), f"{'x' * 10_000} = 1\n")
    refusal = read_refusal("suggest", ENERGY)
    assert f"d2rpick.toml:1: unknown key '{'x' * 59} ..., but one of " in refusal
    assert "xxx" not in refusal.partition(" ..., ")[2]


@pytest.mark.usefixtures("here")
def test_a_command_is_set_by_a_table() -> None:
    put(Path("d2rpick.toml"), "suggest = 1979-05-27\n")
    assert "suggest is 1979-05-27, but a table was expected" in read_refusal(*ASKED)


@pytest.mark.usefixtures("here")
def test_a_byte_order_mark_before_the_settings_is_no_part_of_them() -> None:
    text = "margin = 0.001\n"
    put(Path("d2rpick.toml"), b"\xef\xbb\xbf" + text.encode())
    assert "margin = 0.001  # settings" in run(*ASKED, "--show-settings").stdout
    put(Path("d2rpick.toml"), text.encode("utf-16"))
    assert "valid TOML was expected" in read_refusal(*ASKED)


# Owner and folder of the settings file.


@pytest.fixture
def inner(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Work in a folder two levels below that of the settings file."""
    folder = tmp_path / "project" / "runs"
    folder.mkdir(parents=True)
    put(tmp_path / "d2rpick.toml", "margin = 0.001\n")
    monkeypatch.chdir(folder)
    return folder


def read_margin(*args: str) -> str:
    """Return the margin in use: that of the settings, or the default."""
    lines = run(*ASKED, *args, "--show-settings").stdout.splitlines()
    return next(line.split()[2] for line in lines if line.startswith("margin = "))


@pytest.mark.usefixtures("inner")
def test_the_settings_of_a_folder_above_count() -> None:
    assert read_margin() == "0.001"


@pytest.mark.parametrize("sign", [".git", ".hg"])
@pytest.mark.parametrize("depth", [0, 1])
def test_the_search_ends_at_the_root_of_the_repository(
    inner: Path, sign: str, depth: int
) -> None:
    root = [inner, inner.parent][depth]
    (root / sign).mkdir()
    assert read_margin() == "none"
    put(root / "pyproject.toml", "[tool.d2rpick]\nmargin = 0.002\n")
    assert read_margin() == "0.002"


def test_a_work_tree_has_its_root_where_its_file_of_git_lies(inner: Path) -> None:
    put(inner / ".git", "gitdir: elsewhere\n")
    assert read_margin() == "none"


def test_the_search_ends_at_the_home_of_the_user(
    inner: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    link = inner.parents[1] / "home"
    link.symlink_to(inner.parent)
    monkeypatch.setenv("HOME", str(link))
    assert read_margin() == "none"
    put(inner.parent / "d2rpick.toml", "margin = 0.002\n")
    assert read_margin() == "0.002"


def test_the_settings_of_a_deck_end_at_the_root_of_its_repository(inner: Path) -> None:
    put(inner.parents[1] / "d2rpick.toml", "selct = []\n")
    deck = put(inner / "main.k", "*KEYWORD\n*END\n")
    assert run("check", str(deck)).exit_code == 2
    (inner / ".git").mkdir()
    assert run("check", str(deck)).exit_code == 0


@pytest.fixture
def foreign(inner: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Make all files look as if they belong to another user."""
    monkeypatch.setattr(os, "geteuid", lambda: inner.stat().st_uid + 1)
    return inner


@pytest.mark.parametrize(
    "text", ["margin = 0.002", "margin = [", "[drive]\nstarter = 'rm -r .'", ""]
)
def test_a_file_of_another_user_is_not_used_and_named(foreign: Path, text: str) -> None:
    file = put(foreign / "d2rpick.toml", text)
    result = run(*ASKED)
    assert (
        result.stderr
        == f"note: {file}: not used, since another user owns it; copy it to use its settings\n"
    )
    assert result.exit_code == 0
    assert not run(*ASKED, "-q").stderr
    assert read_margin() == "none"


@pytest.mark.parametrize(
    ("text", "is_named"),
    [
        ("[project]\nname = 'd2rpick'", False),
        ("[tool.d2rpick", False),
        ("[ tool . 'd2rpick' ]\nmargin = 1", True),
    ],
)
def test_a_pyproject_of_another_user_is_named_if_it_has_settings(
    foreign: Path, text: str, is_named: bool
) -> None:
    put(foreign / "pyproject.toml", text)
    assert ("not used" in run(*ASKED).stderr) == is_named


@pytest.mark.usefixtures("foreign")
def test_the_search_does_not_go_into_a_folder_of_another_user() -> None:
    assert not run(*ASKED).stderr


def test_a_rule_is_not_silenced_by_a_file_of_another_user(foreign: Path) -> None:
    put(foreign / "runs.k", "*KEYWORD\n*DEFORMABLE_TO_RIGID\n         9\n*END\n")
    open_findings = run("check", "runs.k", "-f", "ndjson").stdout
    file = put(foreign / "d2rpick.toml", "ignore = ['D2R']\n")
    result = run("check", "runs.k", "-f", "ndjson")
    assert result.stdout == open_findings
    assert result.stderr.count(f"note: {file}: not used") == 1


@pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root gives files away"
)
def test_a_link_to_a_file_of_another_user_is_not_used(inner: Path) -> None:
    elsewhere = put(inner.parents[1] / "other.toml", "margin = 0.002\n")
    os.chown(elsewhere, 12345, 12345)
    (inner / "d2rpick.toml").symlink_to(elsewhere)
    result = run(*ASKED)
    assert result.stderr.startswith(f"note: {inner / 'd2rpick.toml'}: not used")
    assert "--margin 0.001 by" in result.stderr  # the next settings file above


def test_the_values_of_these_tests_are_toml() -> None:
    """Otherwise, the whole file would be refused before its types are checked."""
    assert all(tomllib.loads(f"a = {value}") for value in VALUES)
