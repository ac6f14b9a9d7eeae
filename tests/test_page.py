"""The HTML report: whole, self-contained, safe, and readable in a browser at any width and on paper."""

from __future__ import annotations

import hashlib
import html
import re
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path

import pytest

from tests.command import ENERGY, GLSTAT, ROOT, run
from tests.shared import shared

ROLLOVER_T01 = str(ROOT / "sample_data" / "rolloverT01.gz")
NASTY = '<script>alert("1")</script>&<b>'
CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
QUIET = ["--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking"]
VOID = {"meta", "br", "hr", "link"}


class Page(HTMLParser):
    """What a page consists of; fails where an element is not closed."""

    def __init__(self, source: str) -> None:
        super().__init__()
        self.source, self.names, self.ids, self.targets, self.text = source, set[str](), list[str](), list[str](), ""
        self._open: list[str] = []
        self.feed(source)
        assert not self._open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_startendtag(tag, attrs)
        self._open += [] if tag in VOID else [tag]

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.names.add(tag)
        given = {key: value or "" for key, value in attrs}
        self.ids += [given["id"]] if "id" in given else []
        self.targets += [given[key] for key in ("href", "src", "xlink:href", "action", "data") if key in given]
        self.targets += [f"#{name}" for value in given.values() for name in re.findall(r"url\(#([^)]*)\)", value)]

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


def page_of(folder: Path, *args: str, code: int = 0) -> Page:
    result = run("suggest", *args, "-q", "--report", str(folder / "report.html"))
    assert result.exit_code == code, result.stderr
    return Page((folder / "report.html").read_text("utf-8"))


@pytest.fixture(scope="module")
def paper(tmp_path_factory: pytest.TempPathFactory) -> Page:
    return page_of(tmp_path_factory.mktemp("page"), "--td", "0.064", ENERGY)


def test_it_tells_the_choice_what_was_read_and_how_to_repeat_it(paper: Page) -> None:
    digest = hashlib.sha256(Path(ENERGY).read_bytes()).hexdigest()
    for text in ("0.0128853", "0.064", "0.0135867", "0.0687534", "poor-td", digest, "1501 states"):
        assert text in paper.text
    assert f"d2rpick suggest --td 0.064 {ENERGY} -q --report" in paper.text
    assert {"svg", "table", "pre"} <= paper.names


def test_it_needs_nothing_but_itself(paper: Page) -> None:
    assert not paper.names & {"script", "link", "img", "iframe", "object", "embed", "form", "base"}
    assert {target[0] for target in paper.targets} == {"#"}
    assert "Content-Security-Policy" in paper.source
    assert not re.findall(r"@import|url\((?!#)", paper.source)


def test_ids_are_unique_and_all_that_is_referred_to_is_there(paper: Page) -> None:
    assert len(paper.ids) == len({*paper.ids})
    assert {target[1:] for target in paper.targets} <= {*paper.ids}


def test_it_is_the_same_every_time(tmp_path: Path) -> None:
    pages = []
    for _ in range(2):
        page_of(tmp_path, "--td", "0.064", "--overwrite", ENERGY)
        pages.append((tmp_path / "report.html").read_bytes())
    assert pages[0] == pages[1]


def test_parts_version_flight_and_health_are_told(tmp_path: Path) -> None:
    page = page_of(tmp_path, "--td", "0.37", "--part", "box", ROLLOVER_T01)
    for text in (
        "curb trip of a box",
        "RADIOSS OpenRadioss",
        "momentum of box, step",
        "hourglass energy of box",
        "kept",
    ):
        assert text in page.text
    assert "266 more" in page.text


def test_a_pair_that_cannot_be_bettered_is_shown_once(tmp_path: Path) -> None:
    page = page_of(tmp_path, "--td-window", "0.06", "0.07", ENERGY)
    assert "Recommended" in page.text
    assert "Better pair" not in page.text
    assert page.source.count("<figure>") == 1


def test_each_part_and_the_saving_are_told(tmp_path: Path) -> None:
    chain = str(shared("openradioss/chain_referenceT01.gz"))
    page = page_of(tmp_path, "--td", "0.13505", "--part", "spring1,spring2", "--cost-share", "0.9", chain)
    for text in ("Parts at the recommended pair", "share of the mismatch", "run time", "2 modes"):
        assert text in page.text


def test_a_title_of_html_stays_text(tmp_path: Path) -> None:
    evil = tmp_path / "evil.glstat"
    evil.write_text(f" {NASTY}\n{Path(GLSTAT).read_text('ascii').partition(chr(10))[2]}", "ascii")
    page = page_of(tmp_path, "--td", "0.064", str(evil))
    assert NASTY in page.text
    assert not page.names & {"script", "b "}
    assert "<script" not in page.source


@pytest.mark.parametrize("name", [NASTY, r"IE $\foo$", "_energy", "$"])
def test_a_column_of_any_name_stays_text(tmp_path: Path, name: str) -> None:
    (tmp_path / "energy & <i>.csv").write_text(Path(ENERGY).read_text("utf-8").replace("internal_energy", f"'{name}'"))
    page = page_of(tmp_path, "--td", "0.064", "--energy", f"'{name}'", str(tmp_path / "energy & <i>.csv"))
    assert name in page.text
    assert "energy & <i>.csv" in page.text
    assert not page.names & {"script", "foreignobject"}


def test_where_nothing_can_be_recommended_it_says_so(tmp_path: Path) -> None:
    page = page_of(tmp_path, "--td", "0.064", "--max-residual", "0.1", ENERGY, code=1)
    assert "No tr can be recommended" in page.text
    assert "no-candidate" in page.text
    assert "rigid at  " not in page.text


def test_it_is_a_file_like_any_other_output(tmp_path: Path) -> None:
    taken = tmp_path / "taken.html"
    taken.write_text("mine")
    for name, message in (
        (taken, "the file exists"),
        (Path(ENERGY), "is an input"),
        (tmp_path / "no" / "a", "no folder"),
    ):
        result = run("suggest", "--td", "0.064", "--report", str(name), ENERGY)
        assert result.exit_code == 2
        assert message in result.stderr
    both = str(tmp_path / "a.svg")
    result = run("suggest", "--td", "0.064", "--report", both, "--plot", both, ENERGY)
    assert "--report and --plot name the same file" in result.stderr
    assert taken.read_text() == "mine"


def browse(folder: Path, file: Path, *args: str) -> str:
    """Open a file in a browser and give what that prints."""
    assert CHROMIUM
    options = [*QUIET, "--disable-component-update", "--disable-sync", f"--user-data-dir={folder / 'profile'}"]
    result = subprocess.run([CHROMIUM, *options, *args, file.as_uri()], capture_output=True, timeout=60, check=True)
    return result.stdout.decode()


# A window has a least width, a frame has none; it shows the page as it is, and the script looks from outside.
FRAME = """<!DOCTYPE html><iframe width="{width}" height="900" style="border: 0" srcdoc="{page}"></iframe>
<script>onload = () => {{
  const page = document.querySelector("iframe").contentDocument;
  const drawn = [...page.querySelectorAll("svg")].filter(svg => svg.getBoundingClientRect().width > {width} / 2);
  document.title = [page.documentElement.scrollWidth, drawn.length].join(" ");
}}</script>"""


@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")
@pytest.mark.parametrize("width", [390, 1200])
def test_in_a_browser_nothing_reaches_over_the_edge(tmp_path: Path, paper: Page, width: int) -> None:
    (tmp_path / "frame.html").write_text(FRAME.format(width=width, page=html.escape(paper.source)), "utf-8")
    shown = browse(tmp_path, tmp_path / "frame.html", "--window-size=1400,1000", "--dump-dom")
    title = re.search(r"<title>(\d+) (\d+)</title>", shown)
    assert title
    assert int(title[1]) <= width
    assert int(title[2]) == 2  # of each figure the one that is drawn for this width


@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")
def test_in_a_browser_it_prints_and_its_policy_stops_no_style(tmp_path: Path, paper: Page) -> None:
    (tmp_path / "page.html").write_text(paper.source, "utf-8")
    browse(tmp_path, tmp_path / "page.html", f"--print-to-pdf={tmp_path / 'page.pdf'}", "--no-pdf-header-footer")
    pdf = (tmp_path / "page.pdf").read_bytes()
    assert pdf.startswith(b"%PDF")
    assert 2 <= len(re.findall(rb"/Type\s*/Page\b", pdf)) <= 6
