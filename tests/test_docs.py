"""The README shows what the program does: its sessions are run, its commands are those there are."""

from __future__ import annotations

import re
import shlex
import shutil
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from d2rpick import __version__
from d2rpick.cli import COMMANDS
from d2rpick.histories.opening import READERS
from d2rpick.rules import RULES
from d2rpick.rules.configuration import read_configuration
from tests.command import DECK, GLSTAT, ROOT, run

if TYPE_CHECKING:
    from collections.abc import Iterator

README = (ROOT / "README.md").read_text("utf-8")
CHANGELOG = (ROOT / "CHANGELOG.md").read_text("utf-8")
PROMPT = "$ d2rpick "  # lines of a card begin with "$ " too

# The last digits of a number at full precision differ from machine to machine.
_FULL_PRECISION = re.compile(r"\d+\.\d{13,}(?:e[+-]\d+)?")


def blocks(language: str) -> list[str]:
    """Fenced blocks of the README in a language."""
    return re.findall(rf"^```{language}\n(.*?)^```$", README, flags=re.DOTALL | re.MULTILINE)


def sessions() -> Iterator[tuple[str, str]]:
    """Commands and, below each, what a terminal shows: first stderr, then stdout."""
    for block in blocks("console"):
        assert block.startswith(PROMPT), block
        for entry in f"\n{block}".split(f"\n{PROMPT}")[1:]:
            command, _, shown = entry.replace("\\\n", "").partition("\n")
            yield f"d2rpick {command}", shown.rstrip("\n")


def rounded(text: str) -> str:
    """Text with its numbers at full precision cut to what every machine gives."""
    return _FULL_PRECISION.sub(lambda number: f"{float(number[0]):.12g}", text)


def test_the_sessions_in_the_readme_show_what_the_commands_print(
    tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = tmp_path_factory.mktemp("readme")
    shutil.copytree(ROOT / "sample_data", place / "sample_data")
    monkeypatch.chdir(place)
    ran = set()
    for line, shown in sessions():  # in order and in one folder, as a reader would type them
        _, *args = shlex.split(line)
        result = run(*args)
        printed = f"{result.stderr}{result.stdout}".rstrip("\n")
        assert f"{line}\n{rounded(printed)}" == f"{line}\n{rounded(shown)}"
        ran.add(args[0])
    assert {"suggest", "verify", "check", "card"} <= ran


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_and_each_of_its_options_is_in_the_readme(command: str) -> None:
    assert f"`d2rpick {command} " in README
    options = set(re.findall(r"(?<![\w-])--[a-z][a-z0-9-]+", run(command, "--help").stdout.split("Options:")[1]))
    common = {"--help", "--debug", "--input-format", "--output-format", "--output-file", "--write-as", "--limit"}
    assert not {option for option in options - common if option not in README}


@pytest.mark.parametrize("name", READERS)
def test_every_format_is_in_the_readme(name: str) -> None:
    assert f"| `{name}` |" in README


def test_the_readme_lists_the_exit_codes() -> None:
    assert [line.split("|")[1].strip() for line in README.splitlines() if re.match(r"\| \d \|", line)] == [
        "0",
        "1",
        "2",
    ]


def test_files_that_the_readme_points_to_exist() -> None:
    targets = [target for target in re.findall(r"\]\(([^)#]+)\)", README) if "://" not in target]
    assert targets
    assert not [target for target in targets if not (ROOT / target).exists()]


def test_ci_runs_the_test_command_of_the_readme_and_nothing_else() -> None:
    lines = (line.strip() for line in (ROOT / ".ci" / "run").read_text("utf-8").splitlines())
    own = [line for line in lines if line and not line.startswith(("#", "set ", "cd "))]
    assert len(own) == 1
    assert "pytest" in own[0]
    assert f"{own[0]}\n" in blocks("sh")


def test_the_jobs_in_the_readme_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copy(DECK, "main.k")
    shutil.copy(GLSTAT, "glstat")
    calls = re.findall(r"- (?:run: )?d2rpick (.*)", "".join(blocks("yaml")))
    assert len(calls) == 2
    assert [run(*shlex.split(call)).exit_code for call in calls] == [1, 1]
    (report,) = re.findall(r"junit: (.*)", README)
    assert "<failure" in Path(report).read_text("utf-8")


def test_the_configuration_in_the_readme_is_one() -> None:
    (block,) = blocks("toml")
    read_configuration(tomllib.loads(block)).verify(RULES)


def test_the_pre_commit_hook_is_the_one_of_the_readme() -> None:
    hook = dict(re.findall(r"(\w+): (.*)", (ROOT / ".pre-commit-hooks.yaml").read_text("utf-8")))
    assert f"      - id: {hook['id']}\n" in README
    assert hook["entry"].split() == ["d2rpick", "check"]
    assert [bool(re.search(hook["files"], name)) for name in ("a/run.k", "RUN.KEY", "x.dyn", "k.py", "glstat")] == [
        *(True, True, True, False, False)
    ]


def test_the_two_commands_of_the_readme_are_one_line_each() -> None:
    first, second = blocks("sh")
    assert [block.count("\n") for block in (first, second)] == [1, 1]
    assert "d2rpick suggest --td 0.064 sample_data/energy.csv" in first
    assert "pytest" in second


def test_the_changelog_begins_with_this_version() -> None:
    assert re.findall(r"^## (\S+)", CHANGELOG, flags=re.MULTILINE)[0] == __version__


def test_every_sample_has_a_line_on_what_wrote_it() -> None:
    text = (ROOT / "sample_data" / "README.md").read_text("utf-8")
    names = {path.name for path in (ROOT / "sample_data").iterdir() if path.suffix != ".md"}
    assert not {name for name in names if f"| `{name}` |" not in text}
