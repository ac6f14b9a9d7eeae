"""The documentation is true: its examples run, and its commands and links exist."""

import doctest
import re
import shlex
import shutil
import tomllib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import mypy.api
import pandas as pd
import pytest

import d2rpick
from d2rpick.cli import COMMANDS
from d2rpick.histories.formats import READERS
from d2rpick.rules import RULES, read_configuration
from tests.command import DECK, ENERGY, GLSTAT, ROOT, run
from tests.examples import (
    PAGES,
    enter_reader_folder,
    find_blocks,
    find_languages,
    find_sessions,
    make_anchor,
    read_page,
    round_numbers,
    run_shown_command,
    strip_blocks,
)

README = read_page("README.md")
ALL = "\n".join(read_page(page) for page in PAGES)
MAP = "docs/README.md"
LONGEST_README = 700  # number of words of prose that can be read in five minutes
# Each language has a test below, or shows nothing that can be run.
KINDS = {"console", "pycon", "sh", "yaml", "toml", "mermaid", "text"}


def list_anchors(page: Path) -> set[str]:
    """Return the anchors of a page."""
    return {
        make_anchor(heading)
        for heading in re.findall(
            r"^#+ (.*)$", strip_blocks(page.read_text("utf-8")), flags=re.MULTILINE
        )
    }


def list_links(page: str) -> Iterator[tuple[Path, str]]:
    """Yield the files and anchors in the repository that a page links to."""
    for target in re.findall(r"\]\(([^)]+)\)", strip_blocks(read_page(page))):
        if "://" not in target:
            name, _, anchor = target.partition("#")
            yield (PAGES[page].parent / name if name else PAGES[page]), anchor


def mark_slow_pages(pages: Iterable[str]) -> list[Any]:
    """Return the pages as parameters; only the README runs each time, the others are marked slow."""
    return [
        page if page == "README.md" else pytest.param(page, marks=pytest.mark.slow)
        for page in pages
    ]


@pytest.mark.parametrize("page", mark_slow_pages(PAGES))
def test_the_sessions_on_a_page_show_what_the_commands_print(page: str) -> None:
    with enter_reader_folder():
        for command, shown_output in find_sessions(
            read_page(page)
        ):  # in order and in one folder, as a reader would type them
            assert (
                f"{command}\n{round_numbers(run_shown_command(command))}"
                == f"{command}\n{round_numbers(shown_output)}"
            )


def test_the_sessions_show_the_commands_that_matter_most() -> None:
    shown_commands = {shlex.split(command)[1] for command, _ in find_sessions(ALL)}
    assert {*COMMANDS} - {"rule"} <= shown_commands


@pytest.mark.parametrize(
    "page",
    mark_slow_pages(
        page for page in PAGES if "pycon" in find_languages(read_page(page))
    ),
)
def test_the_python_on_a_page_gives_what_it_shows(page: str) -> None:
    source = "".join(find_blocks(read_page(page), "pycon"))
    test = doctest.DocTestParser().get_doctest(source, {}, page, page, 0)
    report: list[str] = []
    with enter_reader_folder():
        doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(test, out=report.append)
    assert not report, "".join(report)


@pytest.mark.parametrize("page", PAGES)
def test_no_example_escapes_the_tests(page: str) -> None:
    text = read_page(page)
    assert text.count("\n```") == 2 * len(
        re.findall(r"^```\w+$", text, flags=re.MULTILINE)
    )
    assert find_languages(text) <= KINDS
    assert not [block for block in find_blocks(text, "text") if "d2rpick " in block]


@pytest.mark.parametrize("page", [page for page in PAGES if page != "README.md"])
def test_a_page_begins_with_what_the_reader_gets(page: str) -> None:
    title, first, *_ = read_page(page).split("\n\n")
    assert re.fullmatch(r"# .+", title)
    assert re.match(r"[A-Z`]", first)


def test_no_page_repeats_another() -> None:
    paragraphs = [
        paragraph
        for page in PAGES
        for paragraph in {
            " ".join(text_block.split())
            for text_block in re.split(
                r"\n\n|\n(?=[|*])", strip_blocks(read_page(page))
            )
        }
        if len(paragraph) > 80
    ]
    assert not {
        paragraph for paragraph in paragraphs if paragraphs.count(paragraph) > 1
    }


def test_the_readme_is_read_in_three_minutes() -> None:
    assert len(strip_blocks(README).split()) <= LONGEST_README


def test_the_map_leads_to_every_page_and_the_readme_to_the_map() -> None:
    linked = {path.resolve() for path, _ in list_links(MAP)}
    assert {*PAGES.values()} - {ROOT / "README.md", PAGES[MAP]} <= linked
    assert PAGES[MAP] in {path.resolve() for path, _ in list_links("README.md")}


@pytest.mark.parametrize("page", PAGES)
def test_links_of_a_page_lead_somewhere(page: str) -> None:
    for path, anchor in list_links(page):
        assert path.exists()
        assert not anchor or anchor in list_anchors(path)


def test_the_files_that_the_recipes_name_exist() -> None:
    named_files = re.findall(
        r"`((?:d2rpick|tests)/[\w/.-]+)`", read_page("docs/developing/README.md")
    )
    assert len(named_files) > 20
    assert not {
        name
        for name in named_files
        if "NAME" not in name and not (ROOT / name).exists()
    }


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help_and_is_documented_with_its_options(
    command: str,
) -> None:
    assert f"\n## {command}\n" in read_page("docs/reference/commands.md")
    result = run(command, "--help").stdout
    assert re.search(r"Examples:\n +d2rpick", result)
    options = set(
        re.findall(
            r"(?<![\w-])--[a-z][a-z0-9-]+",
            re.split(r"\n[A-Z][a-z ]+:\n", result, maxsplit=1)[1].split("Examples:")[0],
        )
    )
    common = {
        "--help",
        "--input-format",
        "--output-format",
        "--output-file",
    }  # options by their short names
    assert not {option for option in options - common if option not in ALL}


@pytest.mark.parametrize("name", READERS)
def test_every_format_is_documented(name: str) -> None:
    assert f"| `{name}` |" in read_page("docs/reference/histories.md")


def test_the_exit_codes_are_listed() -> None:
    page = read_page("docs/reference/scripts.md")
    assert re.findall(r"^\| (\d) \|", page, flags=re.MULTILINE) == ["0", "1", "2"]


def test_the_two_commands_of_the_readme_are_one_line_each() -> None:
    first, second = find_blocks(README, "sh")
    assert [block.count("\n") for block in (first, second)] == [1, 1]
    (command,) = re.findall(r"\.venv/bin/(d2rpick .*)", first)
    assert command in {
        re.sub(r" --limit \d+", "", command) for command, _ in find_sessions(README)
    }
    assert "pytest" in second


def test_ci_runs_the_test_command_of_the_readme() -> None:
    _, second = find_blocks(README, "sh")
    assert second in (ROOT / ".ci" / "run").read_text("utf-8")


@pytest.mark.usefixtures("here")
def test_the_jobs_in_the_documentation_run() -> None:
    shutil.copy(DECK, "main.k")
    Path("d2rpick").symlink_to(ROOT)  # the folder of the clone
    jobs = "".join(find_blocks(ALL, "yaml"))
    assert [
        Path(name, "pyproject.toml").exists()
        for name in re.findall(r"pip install (.*)", jobs)
    ] == [True, True]
    assert [
        Path(name, ".pre-commit-hooks.yaml").exists()
        for name in re.findall(r"repo: (.*)", jobs)
    ] == [True]
    shutil.copy(GLSTAT, "glstat")
    calls = re.findall(r"- (?:run: )?d2rpick (.*)", jobs)
    assert len(calls) == 2
    assert [run(*shlex.split(call)).exit_code for call in calls] == [1, 1]
    (report,) = re.findall(r"junit: (.*)", ALL)
    assert "<failure" in Path(report).read_text("utf-8")


def test_the_configuration_in_the_documentation_is_one() -> None:
    (rules,) = find_blocks(read_page("docs/how-to/check-decks.md"), "toml")
    read_configuration(tomllib.loads(rules)).verify(RULES)


@pytest.mark.parametrize(
    "page", ["docs/how-to/recipes.md", "docs/reference/scripts.md"]
)
def test_the_settings_in_the_documentation_are_taken(page: str, here: Path) -> None:
    (settings,) = find_blocks(read_page(page), "toml")
    (here / "d2rpick.toml").write_text(settings)
    result = run("suggest", "--deck", "x.k", "x.csv", "--show-settings").stdout
    table = tomllib.loads(settings)
    taken = {*table, *table.pop("suggest")} - {
        "suggest",
        "fail-on",
    }  # options that only check has
    assert result.count(f"# settings, {here / 'd2rpick.toml'}") == len(taken)


@pytest.mark.usefixtures("here")
def test_the_parquet_of_the_recipes_is_read() -> None:
    """Only if pandas can read parquet: pyarrow is not a dependency."""
    pytest.importorskip("pyarrow")
    (line,) = re.findall(
        r"`(pd\.read_parquet\(.*?\))`", read_page("docs/how-to/recipes.md")
    )
    pd.read_csv(ENERGY, index_col="time").to_parquet("energies.parquet")
    assert d2rpick.from_frame(eval(line)).parts == ()


def test_the_pre_commit_hook_is_the_one_of_the_documentation() -> None:
    hook = dict(
        re.findall(r"(\w+): (.*)", (ROOT / ".pre-commit-hooks.yaml").read_text("utf-8"))
    )
    assert f"      - id: {hook['id']}\n" in ALL
    assert hook["entry"].split() == ["d2rpick", "check"]
    assert [
        bool(re.search(hook["files"], name))
        for name in ("a/run.k", "RUN.KEY", "x.dyn", "k.py", "glstat")
    ] == [*(True, True, True, False, False)]


def test_the_changelog_begins_with_this_version() -> None:
    changelog = (ROOT / "CHANGELOG.md").read_text("utf-8")
    assert (
        re.findall(r"^## (\S+)", changelog, flags=re.MULTILINE)[0]
        == d2rpick.__version__
    )


def test_every_sample_has_a_line_on_what_wrote_it() -> None:
    text = (ROOT / "sample_data" / "README.md").read_text("utf-8")
    names = {
        path.name for path in (ROOT / "sample_data").iterdir() if path.suffix != ".md"
    }
    assert not {name for name in names if f"| `{name}` |" not in text}


@pytest.mark.slow
def test_the_python_of_the_readme_passes_a_type_checker(tmp_path: Path) -> None:
    source = "".join(find_blocks(README, "pycon"))
    examples = doctest.DocTestParser().get_examples(source)
    script = tmp_path / "example.py"
    script.write_text("".join(example.source for example in examples), "utf-8")
    report, errors, code = mypy.api.run(["--strict", str(script)])
    assert (code, errors) == (0, ""), report
