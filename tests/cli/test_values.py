"""Settings in a file: defaults of options, nearest to the working folder, and where answers name them."""

import json
from pathlib import Path

import pytest

from tests.command import DECK, ENERGY, answer, run

ASKED = ("suggest", "--td", "0.064", ENERGY)


@pytest.fixture
def settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The file that counts in the working folder, which lies below that of the file."""
    inner = tmp_path / "inner"
    inner.mkdir()
    monkeypatch.chdir(inner)
    return tmp_path / "pyproject.toml"


def shown(*args: str) -> dict[str, str]:
    """The settings that are not the default, with their values and sources."""
    lines = run(*args, "--show-settings").stdout.splitlines()
    return dict(line.split(" = ", 1) for line in lines if not line.endswith("# default"))


def test_the_command_line_counts_before_the_environment_and_that_before_the_settings(
    settings: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings.write_text("[tool.d2rpick]\nmargin = 0.001\nmax-residual = 0.3\n[tool.d2rpick.suggest]\nmargin = 0.002\n")
    assert shown(*ASKED)["margin"] == f"0.002  # settings, {settings}"
    assert shown("verify", "--tr", "0.01", *ASKED[1:])["margin"] == f"0.001  # settings, {settings}"
    monkeypatch.setenv("D2RPICK_SUGGEST_MARGIN", "0.003")
    found = shown(*ASKED, "--max-residual", "0.4")
    assert found["margin"] == "0.003  # environment, D2RPICK_SUGGEST_MARGIN"
    assert found["max-residual"] == "0.4  # command line"


def test_an_answer_names_what_came_from_the_settings_and_can_be_asked_again_without_them(settings: Path) -> None:
    settings.write_text("[tool.d2rpick]\nmargin = 0.001\nenergy = 'internal_energy'\nno-verify = true\n")
    told = run(*ASKED)
    words = "--energy internal_energy --margin 0.001 --no-verify"
    assert told.stderr.startswith(f"note: {words} by {settings}\n")
    assert not run(*ASKED, "-q").stderr
    found = json.loads(run(*ASKED, "-q", "-f", "json").stdout)
    assert found["command"][-5:] == words.split()
    settings.unlink()
    again = json.loads(run(*found["command"]).stdout)
    assert again["candidates"] == found["candidates"]


def test_settings_give_way_to_what_excludes_them_and_wait_for_what_they_belong_to(settings: Path) -> None:
    settings.write_text(
        "[tool.d2rpick]\nno-verify = true\nweights = 'site.json'\nstep-ratio = 4\nnode = 7\nafter = 0.01\n"
    )
    assert {"fit-window", "after"} == {*shown(*ASKED, "--fit-window", "0", "0.1")} - {"td", "history"}
    assert {"no-verify", "after", "weights", "step-ratio", "deck"} == {
        *shown(*ASKED, "--deck", DECK),
    } - {"td", "history"}
    assert "../site.json" in shown(*ASKED, "--deck", DECK)["weights"]  # files lie where the settings do
    assert run("check", DECK).exit_code == 0  # without a history nothing is judged
    assert "node" in shown("card", "--solver", "radioss", "--tr", "1", "--td", "2")


def test_the_check_takes_its_history_and_what_fails_it_from_the_settings(settings: Path) -> None:
    settings.write_text(f"[tool.d2rpick]\nhistory = ['{ENERGY}']\nfail-on = 'warning'\nignore = ['D2R202']\n")
    result = run("check", DECK)
    assert result.exit_code == 1
    assert "D2R203" in result.stdout
    assert "D2R202" in result.stdout  # rules are set beside the deck


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("margn = 1", "unknown key 'margn', one of "),
        ("margn = 1", "; did you mean 'margin'?"),
        ("[tool.d2rpick.sugest]\nmargin = 1", "unknown key 'sugest'"),
        ("[tool.d2rpick.suggest]\ndone = 'x'", "suggest: unknown key 'done'"),
        ("margin = -1", "margin: -1 was found, a number of at least 0 was expected"),
        ("margin = [1]", "margin is [1], a number or a text was expected"),
        ("no-verify = 1", "no-verify is 1, true or false was expected"),
        ("tolerance = true", "tolerance is True, a number or a text was expected"),
        ("fit-window = [1]", "fit-window: "),
    ],
)
def test_settings_that_are_none_are_named_with_their_file(settings: Path, text: str, message: str) -> None:
    settings.write_text(f"[tool.d2rpick]\n{text}\n")
    result = run(*ASKED)
    assert result.exit_code == 2
    assert result.stderr.startswith(f"d2rpick: {settings}: ")
    assert message in result.stderr
    assert result.stderr.count("\n") == 1


def test_python_asks_without_settings(settings: Path) -> None:
    settings.write_text("[tool.d2rpick]\nno-verify = true\n")
    import d2rpick

    assert d2rpick.suggest(d2rpick.read(ENERGY), td=0.064).basis == "oscillator"
    assert answer(*ASKED)["basis"] == "energy"
