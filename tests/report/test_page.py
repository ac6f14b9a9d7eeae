"""The HTML report: complete, self-contained, safe, and readable at any width and on paper."""

import base64
import hashlib
import html
import json
import os
import re
import shlex
import sys
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path

import pytest

from d2rpick.api.request import OPTIONS
from d2rpick.cli import one_run
from d2rpick.report.page import build_steps, read_resource
from tests.command import ENERGY, GLSTAT, MATSUM, ROOT, make_replay_file, put, run
from tests.computed import locate_stored, read_unpacked

ROLLOVER_T01 = str(ROOT / "sample_data" / "rolloverT01.gz")
NASTY = '<script>alert("1")</script>&<b>'
VOID = {"meta", "br", "hr", "link", "input"}

PAPER = ("--td", "0.064", ENERGY)
CHAIN = locate_stored("chain_referenceT01.gz")
BOX = ("--td", "0.37", "--part", "box", "--no-verify", ROLLOVER_T01)
# For a command with its arguments: the exit code, texts that its page contains, and texts that it must not contain.
TOLD = {
    "parts, version, flight and health": (
        ("suggest", *BOX), 0,
        ("curb trip of a box", "RADIOSS OpenRadioss", "momentum of box, step", "hourglass energy of box", "kept",
         "266 more"), (),
    ),
    "a pair that cannot be bettered": (
        ("suggest", "--td-window", "0.06", "0.07", ENERGY), 0, ("usetr0.0135867td0.0687534",), ("Better pair",)
    ),
    "the saving, and no pair that is not better": (
        ("suggest", "--td", "0.13505", "--part", "spring1,spring2", "--cost-share", "0.9", CHAIN), 0,
        ("about 16% of the CPU time", "error of 8.0%"), ("Better pair", "Parts at this pair"),
    ),
    "nothing to recommend": (
        ("suggest", "--td", "0.064", "--max-residual", "0.1", ENERGY), 1,
        ("No tr can be recommended", "no-candidate"), ("card chosen", "rigid at  "),
    ),
    "a poor pair": (
        ("verify", "--tr", "0.0128853", "--td", "0.064", ENERGY), 1,
        ("do not usetr0.0128853td0.064", "wrong by 96%"), ("Verified", "d2rpick card"),
    ),
    "a pair that verifies": (
        ("verify", "--tr", "0.0135867", "--td", "0.0687534", ENERGY), 0,
        ("usetr0.0135867td0.0687534", "residual, expected0.000", "1501 states", "Method and limits",
         "d2rpick verify --tr", "d2rpick card --tr 0.0135867 --td 0.0687534 --part"), ("Verified",),
    ),
    "a pair that does not verify": (
        ("verify", "--tr", "0.0122659", "--td", "0.064", ENERGY), 1,
        ("do not use", "at tr the deformation has the opposite direction"), ("d2rpick card",),
    ),
}  # fmt: skip


class Page(HTMLParser):
    """Parser of the contents of a page; fails if an element is not closed."""

    def __init__(self, source: str) -> None:
        super().__init__()
        self.source, self.names, self.ids, self.targets, self.text = (
            source,
            set[str](),
            list[str](),
            list[str](),
            "",
        )
        self.headings, self.unnamed = list[int](), list[str]()
        self.styles, self.scripts, self.data = list[str](), list[str](), list[str]()
        self._open: list[str] = []
        self.feed(source)
        assert not self._open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_startendtag(tag, attrs)
        self._open += [] if tag in VOID else [tag]
        if tag == "script":
            self._filling = (
                self.data
                if dict(attrs).get("type") == "application/json"
                else self.scripts
            )
        if tag == "style":
            self._filling = self.styles

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.names.add(tag)
        attributes = {key: value or "" for key, value in attrs}
        self.headings += [int(tag[1])] if tag in {"h1", "h2", "h3"} else []
        self.unnamed += (
            [tag]
            if attributes.get("role") in {"img", "region"}
            and not attributes.get("aria-label")
            else []
        )
        self.unnamed += (
            ["th"] if tag == "th" and attributes.get("scope") != "col" else []
        )
        self.ids += [attributes["id"]] if "id" in attributes else []
        self.targets += [
            attributes[key]
            for key in ("href", "src", "xlink:href", "action", "data")
            if key in attributes
        ]
        self.targets += [
            f"#{name}"
            for value in attributes.values()
            for name in re.findall(r"url\(#([^)]*)\)", value)
        ]

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self._open and self._open[-1] in {"script", "style"}:
            self._filling.append(data)
        else:
            self.text += data

    def last_command(self) -> list[str]:
        """Return the words of the last command on the page, without the name of the program."""
        return shlex.split(
            html.unescape(
                re.findall(r"<pre[^>]*>d2rpick ([^<]*)</pre>", self.source)[-1]
            )
        )


def read_page_of(
    folder: Path,
    *args: str,
    command: str = "suggest",
    code: int = 0,
    stdin: bytes | None = None,
) -> Page:
    result = run(
        command, *args, "-q", "--report", str(folder / "report.html"), stdin=stdin
    )
    assert result.exit_code == code, result.stderr
    reasons = ("the verdict is ", "the comparison with the switched run failed")
    reason = (
        tuple(f"d2rpick: exit code 1: {text}" for text in reasons) if code else None
    )
    assert not [
        line
        for line in result.stderr.splitlines()
        if reason is None or not line.startswith(reason)
    ]
    return Page((folder / "report.html").read_text("utf-8"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("page")


@pytest.fixture(scope="module")
def paper(folder: Path) -> Page:
    return read_page_of(folder, *PAPER)


def test_it_tells_the_choice_what_was_read_and_how_to_repeat_it(paper: Page) -> None:
    digest = hashlib.sha256(Path(ENERGY).read_bytes()).hexdigest()
    for text in (
        "0.0128853",
        "0.064",
        "0.0135867",
        "0.0687534",
        "poor-td",
        digest,
        "1501 states",
    ):
        assert text in paper.text
    assert f"d2rpick suggest --td 0.064 {ENERGY} -q --report" in paper.text
    assert {"svg", "table", "pre"} <= paper.names


def test_the_method_is_folded_and_how_to_repeat_it_stands_there_once(
    paper: Page,
) -> None:
    assert (
        paper.source.count("<details><summary><h2>Method and limits</h2></summary>")
        == 1
    )
    assert paper.source.partition("</details>")[0].count("<h3>Limits</h3>") == 1
    assert paper.source.count("<h2>To repeat this</h2>") == 1


@pytest.mark.slow
def test_of_a_flight_at_rest_no_error_of_round_off_is_told(tmp_path: Path) -> None:
    arguments = ("--tr", "0.1", "--td", "0.2838", locate_stored("drop2T01.gz"))
    page = read_page_of(tmp_path, *arguments, command="verify")
    assert "<dt>level error</dt><dd>0.000</dd>" in page.source
    assert "<dt>energy ratio</dt>" not in page.source
    document = json.loads(page.data[0])["flights"][0]
    assert (document["log"], document["heights"][1] > 40) == (False, True)


def test_it_needs_nothing_but_itself(paper: Page) -> None:
    assert not paper.names & {
        "link",
        "img",
        "iframe",
        "object",
        "embed",
        "form",
        "base",
    }
    assert {target[0] for target in paper.targets} == {"#"}
    assert "src=" not in paper.source.partition("<body>")[2].replace("xlink:", "")
    assert not re.findall(r"@import|url\((?!#)", paper.source)


def test_only_what_belongs_to_the_page_takes_effect(paper: Page) -> None:
    policy = html.unescape(
        re.findall(r'Content-Security-Policy" content="([^"]*)"', paper.source)[0]
    )
    rules = {
        name: texts for name, *texts in (rule.split() for rule in policy.split(";"))
    }
    assert (
        rules["default-src"] == rules["base-uri"] == rules["form-action"] == ["'none'"]
    )
    for name, texts in (
        ("script-src", paper.scripts),
        ("style-src-elem", paper.styles),
    ):
        digests = [
            base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
            for text in texts
        ]
        assert rules[name] == [f"'sha256-{digest}'" for digest in digests]
    assert (len(paper.scripts), len(paper.styles), len(paper.data)) == (3, 3, 1)
    assert paper.scripts[0] == read_resource("copy.js")
    assert "The MIT License" in paper.scripts[1]


def test_without_a_flight_nothing_can_be_explored_and_only_copying_has_a_script(
    tmp_path: Path,
) -> None:
    table = put(
        tmp_path / "growing.csv",
        "time,internal_energy\n" + "".join(f"{i / 10},{i * i}\n" for i in range(40)),
    )
    page = read_page_of(tmp_path, "--td", "2.5", "--no-verify", str(table), code=1)
    assert page.scripts == [read_resource("copy.js")]
    assert not page.data


def test_links_lead_to_every_section_of_a_long_page(paper: Page) -> None:
    links = re.findall(r'<a href="#(section-[^"]*)">([^<]*)</a>', paper.source)
    titles = re.findall(
        r'<section id="(section-[^"]*)">(?:<details><summary>)?<h2>([^<]*)</h2>',
        paper.source,
    )
    assert links == titles
    assert ("section-candidates", "Candidates") in links


def test_a_study_shows_all_of_every_peak_and_td() -> None:
    from d2rpick import study
    from d2rpick.report.figures_choice import draw_study

    answer = study([ENERGY], td=0.064)
    figure = draw_study(answer, page=True)
    (axes,) = figure.axes
    first, last = axes.get_xlim()
    for row in answer.runs:
        assert row.curve is not None
        time, energy = row.curve
        seen = energy[(first <= time) & (time <= last)]
        assert axes.get_ylim()[1] >= seen.max()
    assert first < 0.064 < last
    texts = [text.get_text().strip() for text in axes.texts]
    assert "td = 0.064" in texts
    assert not [text for text in texts if "up to" in text]


def test_ids_are_unique_and_all_that_is_referred_to_is_there(paper: Page) -> None:
    assert len(paper.ids) == len({*paper.ids})
    assert {target[1:] for target in paper.targets} <= {*paper.ids}


def test_who_does_not_see_it_can_follow_it(paper: Page) -> None:
    assert paper.headings[0] == 1
    assert all(
        inner_level <= outer_level + 1
        for outer_level, inner_level in pairwise(paper.headings)
    )
    assert paper.source.count('role="img"') == 4  # a figure and three charts
    assert not paper.unnamed


def test_it_is_signed_where_the_times_stand(paper: Page) -> None:
    assert paper.text.index("signature") < paper.text.index("0.0128853")


def test_it_is_the_same_every_time(paper: Page, folder: Path) -> None:
    (folder / "report.html").unlink()
    assert read_page_of(folder, *PAPER).source == paper.source


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "code", "message", "unsaid"), TOLD.values(), ids=TOLD
)
def test_it_tells_what_is_known_and_nothing_else(
    arguments: tuple[str, ...],
    code: int,
    message: tuple[str, ...],
    unsaid: tuple[str, ...],
    tmp_path: Path,
) -> None:
    page = read_page_of(tmp_path, *arguments[1:], command=arguments[0], code=code)
    assert [text for text in message if text not in page.text] == []
    assert [text for text in unsaid if text in page.text or text in page.source] == []
    assert page.source.count("<figure ") == 1
    assert len(page.ids) == len({*page.ids})
    assert not page.unnamed


def test_a_title_of_html_and_a_file_name_that_is_no_text_are_shown_as_text(
    tmp_path: Path,
) -> None:
    evil = tmp_path / (
        os.fsdecode(b"evil\xff.glstat")
        if sys.platform == "linux"
        else "evil\ufffd.glstat"
    )
    evil.write_text(
        f" {NASTY}\n{Path(GLSTAT).read_text('ascii').partition(chr(10))[2]}", "ascii"
    )
    page = read_page_of(tmp_path, "--td", "0.064", str(evil))
    assert NASTY in page.text
    assert "evil\ufffd.glstat" in page.text
    assert (len(page.scripts), len(page.data)) == (3, 1)
    assert "alert" not in "".join(page.scripts)


@pytest.mark.slow
@pytest.mark.parametrize("name", [NASTY, r"IE $\foo$", "_energy", "$"])
def test_a_column_of_any_name_stays_text(tmp_path: Path, name: str) -> None:
    head, *rows = Path(ENERGY).read_text("utf-8").splitlines(keepends=True)
    (tmp_path / "energy & <i>.csv").write_text(
        head.replace("internal_energy", f"'{name}'") + "".join(rows[::5])
    )
    energy = ("--no-verify", "--energy", f"'{name}'")
    page = read_page_of(
        tmp_path, "--td", "0.064", *energy, str(tmp_path / "energy & <i>.csv")
    )
    assert name in page.text
    assert "energy & <i>.csv" in page.text
    assert "foreignobject" not in page.names
    assert (len(page.scripts), len(page.data)) == (3, 1)
    assert not set("<>&") & set(page.data[0])
    assert json.loads(page.data[0])["command"][1].endswith("<i>.csv'")


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [f"IE{'x' * 300}", "énergie_内部_🙂", "IE\x01\x1b[31m"]
)
def test_a_long_or_strange_name_spoils_no_figure_and_says_nothing(
    tmp_path: Path, name: str
) -> None:
    (tmp_path / "energy.csv").write_text(
        Path(ENERGY).read_text("utf-8").replace("internal_energy", name), "utf-8"
    )
    page = read_page_of(
        tmp_path,
        "--td",
        "0.064",
        "--no-verify",
        "--energy",
        "6",
        str(tmp_path / "energy.csv"),
    )
    assert name[:20].partition("\x01")[0] in page.text
    assert not re.search(r"[\x00-\x08\x0b-\x1f]", page.source)
    assert 'd="M' in page.source


@pytest.mark.slow
def test_the_command_for_the_card_reads_and_judges_as_the_choice_was(
    tmp_path: Path,
) -> None:
    head, *rows = read_unpacked(locate_stored("chain_ref.csv.gz")).splitlines(
        keepends=True
    )
    source = str(tmp_path / "chain.csv")
    Path(source).write_bytes(head + b"".join(rows[::10]))
    energies = ("--energy", "IE_spring1_J", "--energy", "IE_spring2_J")
    options = (
        "--time",
        "time_s",
        "--after",
        "0.01",
        "--margin",
        "0.001",
        "--tolerance",
        "0.1",
    )
    words = read_page_of(
        tmp_path, "--td", "0.13505", *energies, *options, source
    ).last_command()
    assert words[5:] == [
        "--part",
        "IDS",
        "--history",
        source,
        *options[:2],
        *energies,
        *options[2:6],
        *options[6:],
    ]
    # The table does not contain the ids of its parts.
    words[words.index("IDS")] = "1"
    assert run(*words).exit_code == 0


@pytest.mark.slow
def test_the_command_for_radioss_names_the_parts(tmp_path: Path) -> None:
    words = read_page_of(
        tmp_path, "--td", "0.37", "--part", "box", "--flying", "box,step", ROLLOVER_T01
    ).last_command()
    assert words[-6:] == [
        "--history",
        ROLLOVER_T01,
        "--flying",
        "box,step",
        "--part",
        "box",
    ]
    # The history does not contain the main nodes of rigid bodies.
    words[words.index("NODES")] = "1001"
    assert run(*words).exit_code == 0


@pytest.mark.slow
def test_the_command_for_another_td_holds_every_option_that_it_is_judged_by(
    tmp_path: Path,
) -> None:
    choosing = shlex.split(
        "--after 0.001 --tolerance 0.1 --fit-window 0.01 0.1 --max-residual 2.5 --strict"
    )
    page = read_page_of(tmp_path, "--td", "0.064", *choosing, ENERGY)
    command_start, command_end = json.loads(page.data[0])["command"]
    assert (command_start, sorted(shlex.split(command_end))) == (
        "d2rpick suggest --td ",
        sorted([*choosing, ENERGY]),
    )
    about_output = {
        *(
            "td",
            "td_window",
            "limit",
            "history",
            "plot",
            "report",
            "min_quality",
            "output_format",
            "exit_zero",
        ),
        *("output_file", "overwrite", "quiet", "verbose", "show_settings", "debug"),
        *(
            "solver",
            "merge",
            "swset",
            "step_cap",
            "node",
            "end",
            "name",
            "contact",
            "wall",
        ),
    }
    assert {str(option.name) for option in one_run.suggest.params} == {
        *about_output,
        *OPTIONS,
    }


def test_a_time_that_no_card_can_hold_costs_the_card_only(tmp_path: Path) -> None:
    motion, earlier = tmp_path / "motion.matsum", re.compile(r"(?<=time =)[^\n]*")
    motion.write_text(
        earlier.sub(
            lambda time: f"{float(time[0]) - 0.02:13.4E}",
            make_replay_file("matsum").decode(),
        )
    )
    page = read_page_of(tmp_path, "--td", "0.044", "--part", "3", str(motion))
    assert "No card can be printed for these times: tr is -0.00" in page.text


def test_options_set_by_the_environment_and_standard_input_are_needed_to_repeat_it(
    tmp_path: Path,
) -> None:
    content, page = Path(ENERGY).read_bytes(), tmp_path / "report.html"
    result = run(
        "suggest",
        "-",
        "--report",
        str(page),
        stdin=content,
        env={"D2RPICK_SUGGEST_TD": "0.064"},
    )
    assert result.exit_code == 0
    text = Page(page.read_text("utf-8")).text
    assert f"env D2RPICK_SUGGEST_TD=0.064 d2rpick suggest - --report {page}" in text
    assert "with the same history on standard input" in text
    assert f"-: {hashlib.sha256(content).hexdigest()}" in text


@pytest.mark.slow
def test_a_verdict_tells_health_parts_and_the_switched_run(tmp_path: Path) -> None:
    reference, *legs = (
        ROLLOVER_T01,
        *(locate_stored(f"rollover_r100_T0{leg}.gz") for leg in (1, 2, 3)),
    )
    arguments = ("--tr", "0.1", "--td", "0.37", "--no-verify", "--part", "box")
    page = read_page_of(
        tmp_path,
        *arguments,
        reference,
        "--switched",
        locate_stored("rollover_r100_T0*.gz"),
        command="verify",
        code=1,
    )
    for name in (reference, *legs):
        assert (
            f"{name}: {hashlib.sha256(Path(name).read_bytes()).hexdigest()}"
            in page.text
        )
    texts = (
        "The switched run",
        "mean energy after td",
        "hourglass energy of box",
        "The window is 0.1 to 0.37",
    )
    for text in (*texts, "66% of that of the reference run"):
        assert text in page.text


@pytest.mark.parametrize(
    ("sentence", "commands"),
    [
        ("see d2rpick info a.csv", ["d2rpick info a.csv"]),
        ("use d2rpick info 'a b.csv' (the run). Then stop", ["d2rpick info 'a b.csv'"]),
        ("d2rpick info a.csv, or give --after", ["d2rpick info a.csv"]),
        ("first d2rpick plan --part 1,2 a.k; or none", ["d2rpick plan --part 1,2 a.k"]),
        ("use the results of the switched run", []),
    ],
)
def test_each_command_of_a_next_step_can_be_copied(
    sentence: str, commands: list[str]
) -> None:
    """Whatever words surround it, exactly the command stands in the element with a button."""
    step = build_steps([("next", sentence)])
    assert re.findall('<pre class="wrap">(.*?)</pre>', step) == commands
    assert sentence in re.sub("<.*?>", "", step)


def test_the_page_of_a_study_names_the_next_command_as_the_terminal_does(
    tmp_path: Path,
) -> None:
    page = tmp_path / "page.html"
    text = run("study", "--td", "0.064", "--report", str(page), ENERGY, ENERGY).stdout
    (command,) = re.findall(
        '<dt>next</dt><dd>.*?<pre class="wrap">(.*?)</pre>', page.read_text()
    )
    assert f" {command}" in " ".join(text.split())


def test_the_page_of_parts_without_a_deck_says_what_the_terminal_says(
    tmp_path: Path,
) -> None:
    """Unknown is not "nothing to use"."""
    page = tmp_path / "page.html"
    text = run("parts", "--no-deck", "--report", str(page), MATSUM).stdout
    written = re.sub("<.*?>", " ", page.read_text("utf-8").split("<main>")[1])
    shown = " ".join(html.unescape(written).split())
    assert "nothing to use" not in shown
    for part in (
        "unknown: without the deck of the run no part can be judged",
        "judge the parts with",
    ):
        assert part in shown
        assert part in " ".join(text.split())
