"""Comfort of the command line: settings, versions, completion, similar names, and a manual page."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from d2rpick.base import __version__
from d2rpick.cli import COMMANDS, d2rpick
from d2rpick.cli.manual import write_manual
from d2rpick.rules import RULES
from tests.command import (
    DECK,
    ENERGY,
    GLSTAT,
    MATSUM,
    ROLLOVER,
    ROOT,
    TIME_LIMIT,
    put,
    run,
    run_json,
)

ASKED = ("suggest", "--td", "0.064", ENERGY)


def test_settings_are_shown_with_their_sources_and_nothing_is_done(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("D2RPICK_SUGGEST_MARGIN", "0.001")
    target = tmp_path / "out.json"
    result = run(
        "suggest", "--td", "0.064", "-o", str(target), "--show-settings", ENERGY
    )
    assert result.exit_code == 0
    lines = result.stdout.splitlines()
    assert "td = 0.064  # command line" in lines
    assert "margin = 0.001  # environment, D2RPICK_SUGGEST_MARGIN" in lines
    assert "tolerance = 0.2  # default" in lines
    assert "after = none  # default" in lines
    assert not target.exists()


@pytest.mark.parametrize("command", [name for name in COMMANDS if name != "rule"])
def test_every_command_shows_its_settings(command: str) -> None:
    required = {
        "verify": ("--tr", "1", "--td", "2", "x"), "replay": ("--stiffness", "1", "--mass", "1", "--v0", "1", "--t-end",
        "1", "--dt", "1"), "card": ("--tr", "1", "--td", "2"), "reproduce": ("--output-dir", "x"), "rollover": (),
        "extract": ("x", "-o", "y.csv"), "study": ("--td", "1", "x"), "drive": ("x", "-o", "y"),
        "first": ("x", "-o", "y"),
    }  # fmt: skip
    result = run(command, *required.get(command, ("x",)), "--show-settings")
    assert result.exit_code == 0, result.stderr
    assert re.search(r"^[\w-]+ = .+  # default$", result.stdout, re.MULTILINE)


@pytest.mark.parametrize("command", [name for name in COMMANDS if name != "rule"])
def test_settings_are_shown_without_what_a_run_needs(command: str) -> None:
    """Someone who asks for the settings of a site has no run at hand."""
    result = run(command, "--show-settings")
    assert result.exit_code == 0, result.stderr
    assert re.search(r"^[\w-]+ = .+  # default$", result.stdout, re.MULTILINE)
    # a run needs what it needed before
    assert run("suggest").exit_code == 2


def test_the_version_names_the_libraries() -> None:
    result = run("--version").stdout.splitlines()
    assert result[0] == f"d2rpick, version {__version__}"
    assert result[1].startswith(
        f"Python {sys.version_info.major}.{sys.version_info.minor}"
    )
    assert [line.split()[0] for line in result[2:]] == [
        "click",
        "numpy",
        "scipy",
        "pandas",
        "h5py",
        "matplotlib",
    ]


def test_verbose_says_what_was_read() -> None:
    result = run("suggest", "--td", "0.0687534", "-v", "-f", "value", ENERGY)
    assert re.fullmatch(r"read \S+energy\.csv in \d+\.\d\d s\n", result.stderr)
    assert (
        result.stdout
        == run("suggest", "--td", "0.0687534", "-q", "-f", "value", ENERGY).stdout
    )


def complete(*args: str) -> list[str]:
    """Return the values that the shell offers for the last word."""
    from click.shell_completion import ShellComplete

    completions = ShellComplete(
        d2rpick, {}, "d2rpick", "_D2RPICK_COMPLETE"
    ).get_completions(list(args[:-1]), args[-1])
    return [completion.value for completion in completions]


def test_parts_are_completed_from_the_history_that_was_typed() -> None:
    assert complete("suggest", MATSUM, "--part", "") == [
        "1",
        "2",
        "box",
        "step",
        "flying",
        "all",
    ]
    assert complete("suggest", MATSUM, "--part", "b") == ["box"]
    assert complete("suggest", "--part", "f") == ["flying"]
    assert complete("suggest", "absent", "--part", "a") == ["all"]


def test_rules_are_completed() -> None:
    assert complete("rule", "d2r00") == [rule for rule in RULES if rule < "D2R01"]
    assert complete("check", "--select", "D2R105") == ["D2R105"]


def test_channels_are_completed_from_the_history_that_was_typed() -> None:
    assert complete("suggest", ROLLOVER, "--energy", "") == [
        "boxIE_J",
        "stepIE_J",
        "IE_total_J",
    ]
    assert complete("suggest", "absent", "--energy", "") == []
    (offered,) = complete("suggest", GLSTAT, "--energy", "int")
    assert (
        offered == "internal_energy"
    )  # a single word for the shell, but still the name of the channel
    by_short_name, by_long_name = (
        run_json("suggest", "--td", "0.064", "--energy", name, GLSTAT)
        for name in (offered, "internal energy")
    )
    assert by_short_name["recommended"] == by_long_name["recommended"]


def test_a_td_far_outside_is_not_explained_by_a_unit() -> None:
    assert "meant" not in run("suggest", "--td", "1e9", ENERGY).stderr
    assert "meant" not in run("suggest", "--td", "-64", ENERGY).stderr


@pytest.fixture
def in_ms(tmp_path: Path) -> str:
    """Write the record of the oscillator with times in ms and no unit in the header."""
    rows = [line.split(",") for line in Path(ENERGY).read_text().splitlines()[1:]]
    lines = [
        "time,internal_energy",
        *(f"{1000 * float(row[0]):.10g},{row[5]}" for row in rows),
    ]
    return str(put(tmp_path / "ms.csv", "\n".join(lines) + "\n"))


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (("suggest", "--td", "0.064"), "--td 64,"),
        (("suggest", "--td", "64", "--after", "0.013"), "--after 13,"),
        (("suggest", "--td-window", "0.05", "0.07"), "--td-window 50 70,"),
        (("verify", "--tr", "0.0129", "--td", "0.064"), "--td 64,"),
        (("explore", "--td", "0.064"), "--td 64,"),
        (("study", "--td", "0.064"), "--td 64,"),
        (("plan", "--after", "0.06"), "--after 60,"),
        (
            (
                "card",
                "--tr",
                "0.0129",
                "--td",
                "0.064",
                "--solver",
                "ls-dyna",
                "--part",
                "1",
                "--history",
            ),
            "--td 64,",
        ),
    ],
)
def test_a_time_in_s_is_not_taken_for_one_in_ms(
    in_ms: str, args: tuple[str, ...], message: str
) -> None:
    result = run(*args, in_ms)
    assert result.exit_code == 2
    assert (
        "within the first ten states of the record, 0 to 150; was it meant in s? Then give "
        + message
        in result.stderr
    )


def test_early_times_that_are_meant_are_kept(in_ms: str) -> None:
    # A flight, and tr, may begin at time 0; 1000 times 0.4 lies outside the record.
    for args in (
        ("suggest", "--td", "64", "--after", "0"),
        ("verify", "--tr", "0.0129", "--td", "64"),
    ):
        assert run(*args, in_ms).exit_code in (0, 1)
    assert run("suggest", "--td", "0.4", in_ms).exit_code in (0, 1)
    named_table = Path(in_ms).read_text().replace("time,", "time [s],")
    Path(in_ms).write_text(named_table)  # times are never given in a larger unit
    assert run("suggest", "--td", "0.064", in_ms).exit_code in (0, 1)


def test_a_deck_in_s_is_not_judged_by_a_history_in_ms(in_ms: str) -> None:
    result = run("check", str(ROOT / "sample_data/switching.k"), "--history", in_ms)
    assert result.exit_code == 1
    assert "error D2R207" in result.stdout  # one finding per mistake
    assert (
        "they are about 1000 times smaller: seconds for milliseconds" in result.stdout
    )
    assert "1 error, 0 warnings" in result.stdout


def test_ndjson_is_the_json_in_one_line() -> None:
    line = run("suggest", "--td", "0.064", "-q", "-f", "ndjson", ENERGY).stdout
    assert line.count("\n") == 1
    whole = run_json("suggest", "--td", "0.064", ENERGY)
    document = json.loads(line)
    assert document.pop("command") != whole.pop("command")
    assert document == whole


@pytest.mark.parametrize(
    ("args", "wanted", "code"),
    [
        (("suggest", "--td", "0.064"), "fair", 1),
        (("suggest", "--td", "0.0687534"), "good", 0),
        (("verify", "--tr", "0.0128853", "--td", "0.064"), "fair", 1),
        (("verify", "--tr", "0.0135867", "--td", "0.0687534"), "good", 0),
        (("explore", "--td-window", "0.06", "0.066", "--steps", "5"), "good", 1),
        (("explore", "--td-window", "0.06", "0.07", "--steps", "5"), "good", 0),
    ],
)
def test_a_pair_may_be_asked_to_be_good(
    args: tuple[str, ...], wanted: str, code: int
) -> None:
    plain = run(*args, "-q", "-f", "csv", "--min-quality", "poor", ENERGY)
    result = run(*args, "-q", "-f", "csv", "--min-quality", wanted, ENERGY)
    assert (plain.exit_code, result.exit_code) == (0, code)
    assert result.stdout == plain.stdout
    if args[0] == "verify" and wanted == "fair":  # the default value
        assert run(*args, "-q", ENERGY).exit_code == code
    assert (
        args[0] != "verify"
        or run(*args, "-q", "--exit-zero", "--min-quality", wanted, ENERGY).exit_code
        == 0
    )


def test_the_number_is_the_first_line_whatever_its_quality() -> None:
    result = run(
        "suggest", "--td", "0.064", "-q", "-f", "value", "--min-quality", "fair", ENERGY
    )
    assert result.exit_code == 1
    assert float(result.stdout.splitlines()[0]) == pytest.approx(0.0128853, abs=1e-7)


@pytest.mark.slow
def test_the_command_on_a_page_can_be_pasted(tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    assert (
        run("study", "--td", "0.064", "-q", "--report", str(page), ENERGY).exit_code
        == 0
    )
    first = page.read_text("utf-8")
    line = re.search(r"d2rpick study --td 0\.064 [^<]+ --overwrite", first)
    assert line is not None
    again = subprocess.run(
        [sys.executable, "-m", *line[0].split()],
        capture_output=True,
        check=False,
        cwd=ROOT,
        timeout=TIME_LIMIT,
    )
    assert again.returncode == 0, again.stderr
    assert page.read_text("utf-8") == first


def test_the_manual_leaves_the_short_name_of_help_as_it_is() -> None:
    assert r"\-h, \-\-help" in write_manual()
    assert run("rule", "-h").stdout == run("rule", "--help").stdout


def test_the_manual_holds_every_command_and_option() -> None:
    page = write_manual()
    for name in COMMANDS:
        assert f".SH d2rpick {name}\n" in page
    plain = page.replace(r"\-", "-")
    for option in ("--td-window", "--min-quality", "--show-settings", "--write-deck"):
        assert option in plain
    assert not re.search(r"^'|^\.(?!TH|SH|TP|PP|nf|fi|B\b)", page, re.MULTILINE)


@pytest.mark.skipif(not shutil.which("groff"), reason="groff is not installed")
def test_the_manual_is_roff_without_warnings() -> None:
    manual_page = subprocess.run(
        ["groff", "-man", "-ww", "-Tutf8"],
        input=write_manual(),
        capture_output=True,
        text=True,
        check=True,
    )
    assert not manual_page.stderr
    assert "d2rpick" in manual_page.stdout


@pytest.fixture
def settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Change to a folder, and return the path of the settings file in its parent folder, which applies there."""
    inner = tmp_path / "inner"
    inner.mkdir()
    monkeypatch.chdir(inner)
    return tmp_path / "pyproject.toml"


def read_settings_in_use(*args: str) -> dict[str, str]:
    """Return the settings that differ from the defaults, with their values and sources."""
    lines = run(*args, "--show-settings").stdout.splitlines()
    return dict(
        line.split(" = ", 1) for line in lines if not line.endswith("# default")
    )


def test_the_command_line_counts_before_the_environment_and_that_before_the_settings(
    settings: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings.write_text(
        "[tool.d2rpick]\nmargin = 0.001\nmax-residual = 0.3\n[tool.d2rpick.suggest]\nmargin = 0.002\n"
    )
    assert read_settings_in_use(*ASKED)["margin"] == f"0.002  # settings, {settings}"
    assert (
        read_settings_in_use("verify", "--tr", "0.01", *ASKED[1:])["margin"]
        == f"0.001  # settings, {settings}"
    )
    monkeypatch.setenv("D2RPICK_SUGGEST_MARGIN", "0.003")
    shown_settings = read_settings_in_use(*ASKED, "--max-residual", "0.4")
    assert shown_settings["margin"] == "0.003  # environment, D2RPICK_SUGGEST_MARGIN"
    assert shown_settings["max-residual"] == "0.4  # command line"


def test_an_answer_names_what_came_from_the_settings_and_can_be_asked_again_without_them(
    settings: Path,
) -> None:
    settings.write_text(
        "[tool.d2rpick]\nmargin = 0.001\nenergy = 'internal_energy'\nno-verify = true\n"
    )
    result = run(*ASKED)
    words = "--energy internal_energy --margin 0.001 --no-verify"
    assert result.stderr.startswith(f"note: {words} by {settings}\n")
    assert not run(*ASKED, "-q").stderr
    document = json.loads(run(*ASKED, "-q", "-f", "json").stdout)
    assert document["command"][-5:] == words.split()
    settings.unlink()
    again = json.loads(run(*document["command"]).stdout)
    assert again["candidates"] == document["candidates"]


def test_settings_give_way_to_what_excludes_them_and_wait_for_what_they_belong_to(
    settings: Path,
) -> None:
    settings.write_text(
        "[tool.d2rpick]\nno-verify = true\nweights = 'site.json'\nstep-ratio = 4\nnode = 7\nafter = 0.01\n"
    )
    assert {"fit-window", "after"} == {
        *read_settings_in_use(*ASKED, "--fit-window", "0", "0.1")
    } - {
        "td",
        "history",
    }
    assert {"no-verify", "after", "weights", "step-ratio", "deck"} == {
        *read_settings_in_use(*ASKED, "--deck", DECK),
    } - {"td", "history"}
    assert (
        "../site.json" in read_settings_in_use(*ASKED, "--deck", DECK)["weights"]
    )  # paths are relative to the settings file
    assert run("check", DECK).exit_code == 0  # without a history, nothing is judged
    assert "node" in read_settings_in_use(
        "card", "--solver", "radioss", "--tr", "1", "--td", "2"
    )


def test_an_oscillator_in_the_settings_gives_way_to_what_excludes_it(
    settings: Path,
) -> None:
    settings.write_text(
        "[tool.d2rpick]\nstiffness = 1\nmass = 1\nbeta = 2\nalpha = 0\nv0 = 1\n"
    )
    settings_in_use = {*read_settings_in_use(*ASKED)} - {"td", "history"}
    assert settings_in_use == {"stiffness", "mass", "beta", "alpha", "v0"}
    for option in (("--no-verify",), ("--fit-window", "0", "0.1")):
        assert not settings_in_use & {*read_settings_in_use(*ASKED, *option)}
    assert settings_in_use - {*read_settings_in_use(*ASKED, "--frame-mass", "2")} == {
        "beta"
    }


def test_the_check_takes_its_history_and_what_fails_it_from_the_settings(
    settings: Path,
) -> None:
    settings.write_text(
        f"[tool.d2rpick]\nhistory = ['{ENERGY}']\nfail-on = 'warning'\nignore = ['D2R202']\n"
    )
    result = run("check", DECK)
    assert result.exit_code == 1
    assert "D2R203" in result.stdout
    assert "D2R202" in result.stdout  # the rules are configured next to the deck


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("margn = 1", "unknown key 'margn' (did you mean 'margin'?), but one of "),
        ("margn = 1", " (did you mean 'margin'?)"),
        ("[tool.d2rpick.sugest]\nmargin = 1", "unknown key 'sugest'"),
        ("[tool.d2rpick.suggest]\ndone = 'x'", "suggest: unknown key 'done'"),
        (
            "margin = -1",
            "margin: -1 was found, but a number of at least 0 was expected",
        ),
        ("margin = [1]", "margin is [1], but a number or a text was expected"),
        ("no-verify = 1", "no-verify is 1, but true or false was expected"),
        ("tolerance = true", "tolerance is true, but a number or a text was expected"),
        ("fit-window = [1]", "fit-window: "),
    ],
)
def test_settings_that_are_none_are_named_with_their_file(
    settings: Path, text: str, message: str
) -> None:
    settings.write_text(f"[tool.d2rpick]\n{text}\n")
    result = run(*ASKED)
    assert result.exit_code == 2
    line = 3 if "done" in text else 2
    assert result.stderr.startswith(f"d2rpick: {settings}:{line}: ")
    assert message in result.stderr
    assert result.stderr.count("\n") == 1


def test_python_asks_without_settings(settings: Path) -> None:
    settings.write_text("[tool.d2rpick]\nno-verify = true\n")
    import d2rpick

    assert d2rpick.suggest(d2rpick.read(ENERGY), td=0.064).basis == "oscillator"
    assert run_json(*ASKED)["basis"] == "energy"
