"""In a real browser, the interactive part of a page shows for each td what ``suggest --td`` prints."""

import base64
import json
import re
import shlex
import shutil
from collections.abc import Callable, Iterator
from functools import cache
from math import isclose
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import pytest

from d2rpick.choice.td.suggest_td import STEPS
from d2rpick.histories.digits import format_window
from d2rpick.report.page import CLASSES, read_resource
from d2rpick.report.tables import format_measure, format_short
from tests.cli.test_first_lines import SWITCHED
from tests.command import ENERGY, ROLLOVER, run
from tests.computed import locate_stored

pytest.importorskip("selenium", reason="selenium is not installed")

from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

if TYPE_CHECKING:
    from selenium.webdriver.remote.webelement import WebElement

CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))),
    None,
)
DRIVER = shutil.which("chromedriver")
_NEEDED = pytest.mark.skipif(
    not (CHROMIUM and DRIVER),
    reason="Chromium and chromedriver are not installed (Debian: chromium, chromium-driver)",
)
Test = TypeVar("Test", bound=Callable[..., None])
_OPTIONS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--no-first-run",
    "--disable-background-networking",
)
# Visible elements that reach beyond the right edge of the page and are not inside a scrolling element.
_CUT = """
const scrolls = (one) => one.closest(".scroll, pre") !== null;
return [...document.body.querySelectorAll("*")]
  .filter((one) => !scrolls(one) && one.getClientRects().length && one.getBoundingClientRect().right > innerWidth + 0.5)
  .map((one) => one.outerHTML.slice(0, 120));
"""

# Positions of the first and the last td in the energy chart [px].
ENDS = """
const { rows, view: [from, to] } = JSON.parse(document.getElementById("explorer-data").textContent).flights[0];
const width = document.querySelector(".energy .u-over").clientWidth;
return [rows[0], rows[rows.length - 1]].map(([[td]]) => (td - from) / (to - from) * width);
"""
# All texts about the visible td in one request, because each request to a browser takes time.
SAID = """
const values = [...document.querySelectorAll("[data-value]")].map((one) => [one.dataset.value, one.textContent]);
const spoken = document.querySelector(".handle").getAttribute("aria-valuetext");
return { ...Object.fromEntries(values.reverse()), typed: document.getElementById("explorer-td").value, spoken };
"""
# For each share of the width, whether the energy chart has the colour of the verified pair there, to two pixels.
HAS_VERIFIED_AT = """
const canvas = document.querySelector(".energy canvas"), over = document.querySelector(".energy .u-over");
const left = over.getBoundingClientRect().left - canvas.getBoundingClientRect().left;
const text = getComputedStyle(document.querySelector("#explorer .verified")).backgroundColor;
const [red, green, blue] = text.match(/\\d+/g).map(Number);
const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
const columns = new Set();
for (let i = 0; i < data.length; i += 4) {
  if (data[i] === red && data[i + 1] === green && data[i + 2] === blue) columns.add(i / 4 % canvas.width);
}
return arguments[0].map((share) => {
  const column = (left + share * over.clientWidth) * canvas.width / canvas.clientWidth;
  return [...columns].some((one) => Math.abs(one - column) <= 2);
});
"""
WIDTHS = (390, 768, 1280)


def mark_for_browser(test: Test) -> Test:
    """Mark a test that needs a browser and is slow."""
    for mark in (pytest.mark.slow, _NEEDED):
        mark(test)
    return test


class Browser:
    """Browser with the actions of a reader of a page."""

    def __init__(self, driver: "webdriver.Chrome") -> None:
        self.driver = driver

    def open(self, page: Path, *, width: int = 1280, **media: str) -> None:
        """Open a page at a width [px], with media preferences such as ``prefers_color_scheme="dark"``."""
        size = {
            "width": width,
            "height": 900,
            "deviceScaleFactor": 1,
            "mobile": width < 500,
        }
        features = [
            {"name": name.replace("_", "-"), "value": value}
            for name, value in media.items()
        ]
        self.ask("Emulation.setDeviceMetricsOverride", **size)
        self.ask("Emulation.setEmulatedMedia", media="", features=features)
        self.driver.get(page.as_uri())

    def ask(self, command: str, **arguments: Any) -> Any:
        """Send a command of the developer tools."""
        return self.driver.execute_cdp_cmd(command, arguments)

    def find(self, selector: str) -> "WebElement":
        """Find an element."""
        return self.driver.find_element(By.CSS_SELECTOR, selector)

    def all(self, selector: str) -> "list[WebElement]":
        """Find all such elements."""
        return self.driver.find_elements(By.CSS_SELECTOR, selector)

    def shown(self, selector: str) -> bool:
        """Return True if the first such element has a visible size."""
        return self.find(selector).is_displayed()

    def value(self, name: str) -> str:
        """Return the text of the interactive part under a name."""
        return str(self.find(f'[data-value="{name}"]').get_property("textContent"))

    def spoken(
        self, roles: set[str], value: float | None = None
    ) -> list[dict[str, Any]]:
        """Return the elements with these roles and this value that a screen reader finds, after a short delay."""

        from selenium.webdriver.support.wait import WebDriverWait  # slow

        def found(_: object) -> list[dict[str, Any]]:
            nodes = self.ask("Accessibility.getFullAXTree")["nodes"]
            used = [
                node
                for node in nodes
                if node["role"]["value"] in roles and not node["ignored"]
            ]
            used = [
                node
                for node in used
                if value is None or isclose(node["value"]["value"], value, rel_tol=1e-6)
            ]
            return used if {node["role"]["value"] for node in used} == roles else []

        return WebDriverWait(self.driver, timeout=20).until(found)

    def cut(self) -> list[str]:
        """Return the texts that are cut at the right edge, and a note if the page is wider than the screen."""
        cut_texts: list[str] = self.driver.execute_script(_CUT)
        wide = self.driver.execute_script(
            "return document.documentElement.scrollWidth > document.documentElement.clientWidth"
        )
        return [*cut_texts, *["the page itself"] * bool(wide)]

    def pdf(self) -> bytes:
        """Print the page to PDF."""
        return base64.b64decode(
            self.ask("Page.printToPDF", preferCSSPageSize=True)["data"]
        )

    def complaints(self) -> list[dict[str, Any]]:
        """Return the console messages since the last call."""
        return list(self.driver.get_log("browser"))  # type: ignore[no-untyped-call]


def write_page(folder: Path, *args: str) -> Path:
    """Write the page of a command."""
    page = folder / "page.html"
    result = run(*args, "-q", "--report", str(page))
    assert result.exit_code in (0, 1), result.stderr
    return page


@pytest.fixture(scope="module")
def paper(tmp_path_factory: pytest.TempPathFactory) -> Path:
    window = ("--td-window", "0.05", "0.09")
    return write_page(
        tmp_path_factory.mktemp("paper"),
        "explore",
        "--td",
        "0.064",
        *window,
        "--steps",
        "24",
        ENERGY,
    )


@pytest.fixture(scope="module")
def box(tmp_path_factory: pytest.TempPathFactory) -> Path:
    window = ("--td-window", "0.33", "0.37", "--after", "0.0910048")
    energy = ("--no-verify", "--energy", "boxIE_J", ROLLOVER)
    return write_page(
        tmp_path_factory.mktemp("box"), "explore", *window, "--steps", "4", *energy
    )


@pytest.fixture(scope="module")
def started(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """Start a browser that writes into its own folder."""
    options = webdriver.ChromeOptions()
    options.binary_location = str(CHROMIUM)
    for option in (
        *_OPTIONS,
        f"--user-data-dir={tmp_path_factory.mktemp('browser') / 'profile'}",
    ):
        options.add_argument(option)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(
        options=options, service=webdriver.ChromeService(str(DRIVER))
    )
    yield Browser(driver)
    driver.quit()


@pytest.fixture
def browser(started: Browser) -> Iterator[Browser]:
    """Return the browser; its console must be empty after the test."""
    yield started
    assert started.complaints() == []


def read_content(page: Path) -> dict[str, Any]:
    """Return the data that the script of a page reads."""
    text = re.findall(
        r'<script type="application/json" id="explorer-data">(.*?)</script>',
        page.read_text("utf-8"),
    )[0]
    document: dict[str, Any] = json.loads(text)
    return document


def list_numbers(page: Path, flight: int = 0) -> list[dict[str, Any]]:
    """Return the numbers of each td of a flight."""
    rows_found = read_content(page)["flights"][flight]
    return [
        dict(zip(rows_found["numbers"], values, strict=True))
        for values, _ in rows_found["rows"]
    ]


@cache
def run_suggested(command: str) -> dict[str, Any]:
    """Run the command that the page names and return its answer."""
    program, *args = shlex.split(command)
    assert program == "d2rpick"
    document: dict[str, Any] = json.loads(run(*args, "-q", "-f", "json").stdout)
    return document


def check(browser: Browser) -> float:
    """Compare the page with the command it names; return the td shown."""
    said_by_page = browser.driver.execute_script(SAID)
    suggestion = run_suggested(said_by_page["command"])
    best = next(
        (
            candidate
            for candidate in suggestion["candidates"]
            if candidate["recommended"]
        ),
        None,
    )
    expected = {
        "td": format_short(suggestion["td"]),
        "tr": format_short(best["tr"]) if best else "none",
        "exact_td": repr(suggestion["td"]),
    }
    if best:
        expected["residual"] = format_measure(best["residual"])
        expected["kinetic"] = format_measure(suggestion["kinetic_share"])
        expected["tolerance"] = f"±{best['timing_tolerance']:.1e}"
        expected["verdict"] = suggestion["verdict"]
        expected["why"] = suggestion["verdict_reason"]
        expected["cure"] = suggestion["cure"] or ""
    expected["level"] = format_short(suggestion["energy_td"])
    assert {name: said_by_page[name] for name in expected} == expected
    assert said_by_page["typed"] == expected["td"]
    assert said_by_page["spoken"].startswith(
        f"td {expected['td']}, tr {expected['tr']}"
    )
    td: float = suggestion["td"]
    return td


@mark_for_browser
def test_td_typed_at_some_places_shows_the_digits_of_suggest(
    paper: Path, browser: Browser
) -> None:
    browser.open(paper)
    td_known = np.array([row["td"] for row in list_numbers(paper)])
    field = browser.find("#explorer-td")
    for td in np.random.default_rng(1).uniform(0.05, 0.09, 6).round(5).tolist():
        field.clear()
        field.send_keys(
            repr(td).replace(".", ",") if td > 0.07 else repr(td), Keys.ENTER
        )
        assert check(browser) == td_known[np.abs(td_known - td).argmin()]
        assert f"{td}: this td was not computed" in browser.find(".said").text.replace(
            ",", ".", 1
        )


@mark_for_browser
def test_td_dragged_to_some_places_shows_the_digits_of_suggest(
    paper: Path, browser: Browser
) -> None:
    browser.open(paper)
    browser.driver.execute_script(
        "document.querySelector('.energy').scrollIntoView({block: 'center'})"
    )
    mouse = webdriver.ActionChains(browser.driver, duration=0)
    mouse.click_and_hold(browser.find(".handle")).perform()
    over = browser.find(".energy .u-over")
    first, last = browser.driver.execute_script(ENDS)
    shown_td = set()
    for pixel in np.linspace(first, last, 8).astype(int).tolist():
        mouse.move_to_element_with_offset(
            over, pixel - over.size["width"] // 2, -9
        ).perform()
        shown_td.add(check(browser))
    mouse.release().perform()
    assert len(shown_td) > 6
    last = browser.value("td")
    mouse.move_to_element(over).perform()
    assert browser.value("td") == last


@mark_for_browser
def test_a_finger_moves_td_too(paper: Path, browser: Browser) -> None:
    browser.open(paper, width=390)
    browser.driver.execute_script(
        "document.querySelector('.energy').scrollIntoView({block: 'center'})"
    )
    x, y = browser.driver.execute_script(
        "const box = document.querySelector('.handle').getBoundingClientRect(); return [box.x + 22, box.y + 99]"
    )
    td_before = check(browser)
    for kind, points in (
        ("Start", [{"x": x, "y": y}]),
        ("Move", [{"x": x + 25, "y": y + 9}]),
        ("End", []),
    ):
        browser.ask("Input.dispatchTouchEvent", type=f"touch{kind}", touchPoints=points)
    assert check(browser) > td_before


@mark_for_browser
def test_keys_and_buttons_move_td(paper: Path, browser: Browser) -> None:
    browser.open(paper)
    rows = list_numbers(paper)
    td_known = [row["td"] for row in rows]
    handle, field = browser.find(".handle"), browser.find("#explorer-td")
    handle.send_keys(Keys.HOME)
    assert check(browser) == td_known[0]
    for keys, td_index in (
        ((Keys.ARROW_RIGHT,) * 3, 3),
        ((Keys.ARROW_LEFT,), 2),
        ((Keys.PAGE_DOWN,), 0),
        ((Keys.END,), -1),
    ):
        handle.send_keys(*keys)
        assert check(browser) == td_known[td_index]
    field.send_keys(Keys.ARROW_DOWN)
    assert check(browser) == td_known[-2]
    browser.find(".earlier").click()
    assert check(browser) == [row["td"] for row in rows if row["peak"]][-1]
    browser.find(".back").click()
    assert check(browser) == 0.064
    field.send_keys("x", Keys.ENTER)
    assert "is not a time" in browser.find(".said").text
    assert field.get_attribute("aria-invalid") == "true"
    field.clear()
    field.send_keys("7", Keys.ENTER)
    assert check(browser) == td_known[-1]
    assert "td was computed from" in browser.find(".said").text


@mark_for_browser
def test_the_numbers_of_the_axes_suit_the_width_of_the_page(
    paper: Path, browser: Browser
) -> None:
    """A page that becomes narrow is drawn as one that was opened narrow, so its numbers do not run together."""
    from selenium.webdriver.support.wait import WebDriverWait  # slow

    drawn = "return document.querySelector('.explorer .energy canvas').toDataURL()"
    browser.open(paper, width=320)
    narrow = browser.driver.execute_script(drawn)
    browser.open(paper, width=1280)
    assert browser.driver.execute_script(drawn) != narrow
    size = {"width": 320, "height": 900, "deviceScaleFactor": 1, "mobile": True}
    browser.ask("Emulation.setDeviceMetricsOverride", **size)
    WebDriverWait(browser.driver, timeout=20).until(
        lambda driver: driver.execute_script(drawn) == narrow
    )


@mark_for_browser
def test_a_button_for_peaks_is_disabled_if_there_is_no_peak(
    paper: Path, browser: Browser
) -> None:
    browser.open(paper)
    handle = browser.find(".handle")
    for key, button in ((Keys.HOME, ".earlier"), (Keys.END, ".later")):
        handle.send_keys(key)
        assert browser.find(button).get_attribute("aria-disabled") == "true"
    browser.find(".earlier").click()
    assert browser.find(".later").get_attribute("aria-disabled") == "true"


def test_the_contents_name_the_interactive_section(paper: Path) -> None:
    text = paper.read_text("utf-8")
    assert '<a href="#explorer">What another td would cost</a>' in text
    assert 'id="explorer"' in text


@mark_for_browser
def test_a_click_on_a_point_of_the_trade_off_selects_it(
    paper: Path, browser: Browser
) -> None:
    browser.open(paper)
    over = browser.find(".trade .u-over")
    browser.driver.execute_script(
        "document.querySelector('.trade').scrollIntoView({block: 'center'})"
    )
    webdriver.ActionChains(browser.driver).move_to_element_with_offset(
        over, over.size["width"] // 2 - 9, over.size["height"] // 2 - 9
    ).click().perform()
    td = check(browser)
    chosen = next(row for row in list_numbers(paper) if row["td"] == td)
    assert chosen["error"] < 0.3
    assert chosen["unbeaten"]


def describe_td(suggestion: dict[str, Any]) -> str:
    """Return the texts that the page shows for a td instead of numbers."""
    (best,) = (
        candidate for candidate in suggestion["candidates"] if candidate["recommended"]
    )
    times = f"td {format_short(suggestion['td'])}, tr {format_short(best['tr'])}"
    return f"{times}, residual {format_measure(best['residual'])}"


@mark_for_browser
def test_who_listens_can_use_it(paper: Path, browser: Browser) -> None:
    browser.open(paper)
    nodes = browser.spoken({"slider", "textbox", "button", "image", "region"})
    assert all(node["name"]["value"] for node in nodes)
    td_known = [row["td"] for row in list_numbers(paper)]
    handle = browser.find(".handle")
    for keys, td in (("", 0.064), (Keys.END, td_known[-1]), (Keys.HOME, td_known[0])):
        handle.send_keys(keys)  # it gets the focus, so it can be reached by keyboard
        (slider,) = browser.spoken({"slider"}, td)
        property_values = {
            property_["name"]: property_["value"].get("value")
            for property_ in slider["properties"]
        }
        assert (
            property_values["valuemin"],
            property_values["valuemax"],
        ) == pytest.approx((td_known[0], td_known[-1]), rel=1e-6)
        assert property_values["focusable"]
        # Texts instead of numbers: some versions leave them out of the tree, but screen readers speak them.
        assert handle.get_attribute("aria-valuetext") == describe_td(
            run_suggested(browser.value("command"))
        )


@mark_for_browser
@pytest.mark.parametrize("width", WIDTHS)
def test_nothing_is_cut_with_and_without_scripts(
    paper: Path, box: Path, browser: Browser, width: int
) -> None:
    for page in (paper, box):
        plain = page.with_name("plain.html")  # for a browser without scripts
        plain.write_text(
            re.sub(
                r"<script>.*?</script>", "", page.read_text("utf-8"), flags=re.DOTALL
            ),
            "utf-8",
        )
        for page_shown, scripts in ((page, True), (plain, False)):
            browser.open(page_shown, width=width)
            assert browser.cut() == []
            assert browser.shown("#explorer") == scripts
            assert browser.shown("figure.drawn") == (not scripts)
            assert not browser.shown(".sign")  # only for print
            assert browser.shown(".hint") == (width < 960)
            assert len(browser.all(".copy")) == (
                len(browser.all("pre")) if scripts else 0
            )


@mark_for_browser
def test_it_prints_as_the_static_page_also_where_it_is_dark(
    paper: Path, browser: Browser
) -> None:
    browser.open(paper, prefers_color_scheme="dark")
    assert (
        browser.driver.execute_script(
            "return getComputedStyle(document.body).backgroundColor"
        )
        == "rgb(20, 24, 28)"
    )
    assert 2 <= len(re.findall(rb"/Type\s*/Page\b", browser.pdf())) <= 6
    browser.ask("Emulation.setEmulatedMedia", media="print")
    assert not browser.shown("#explorer")
    assert browser.shown("figure.drawn")
    assert browser.shown(".sign")
    assert not browser.shown(".contents")
    assert not browser.shown(".copy")


@mark_for_browser
def test_a_button_copies_what_stands_below_it(paper: Path, browser: Browser) -> None:
    browser.open(paper)
    grant = {"permissions": ["clipboardReadWrite", "clipboardSanitizedWrite"]}
    browser.ask("Browser.grantPermissions", **grant)
    buttons = browser.all(".copy")
    commands = browser.all("pre")
    assert len(buttons) == len(commands) >= 3
    for button, command in zip(buttons, commands, strict=True):
        button.click()
        copied = browser.driver.execute_async_script(
            "navigator.clipboard.readText().then(arguments[0], () => arguments[0](null))"
        )
        assert copied == command.get_property("textContent")
        assert button.text == "Copied"


@mark_for_browser
def test_the_pair_of_a_card_is_not_told_twice(paper: Path, browser: Browser) -> None:
    """The cards are those of the requested td and of the td that suggest chooses; another td lies between them."""
    why = '.now dd[data-value="why"]'
    for card, clicks in enumerate((0, 2)):
        browser.open(paper)
        for _ in range(clicks):
            browser.find(".later").click()
        pair = f"tr = {browser.value('exact_tr')}, td = {browser.value('exact_td')}"
        exact = browser.all(".card .exact")[card]
        assert pair in str(exact.get_property("textContent"))
        assert browser.find(why).get_property("textContent")
        assert not browser.shown(why)
    browser.find(".back").click()
    assert not browser.shown(why)
    browser.find(".later").click()
    assert browser.shown(why)


@mark_for_browser
def test_no_line_of_the_first_card_stands_again_below_its_pair(
    tmp_path: Path, browser: Browser
) -> None:
    chain = ("--part", "spring1,spring2", locate_stored("chain_referenceT01.gz"))
    options = ("--td", "0.13505", "--cost-share", "0.9")
    browser.open(write_page(tmp_path, "suggest", *options, *chain))
    names_on_card = {name.text for name in browser.all(".card:has(.badge) dt")}
    assert {"why", "rigid for", "saves"} <= names_on_card
    assert "kinetic fraction" in list_names_below(browser)
    assert not names_on_card & list_names_below(browser)
    browser.find(".handle").send_keys(Keys.ARROW_LEFT)
    assert {"why", "rigid for", "saves"} <= list_names_below(browser)
    assert browser.shown('.now h3 [data-value="verdict"]')


def list_names_below(browser: Browser) -> set[str]:
    """Return the names of the visible values of the pair that is explored."""
    return {name.text for name in browser.all(".now dt") if name.is_displayed()}


@pytest.fixture(scope="module")
def verified(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Page of a verified pair whose tr lies before the flight."""
    options = ("--tr", "0.1", "--td", "0.37", "--energy", "boxIE_J")
    return write_page(tmp_path_factory.mktemp("verified"), "verify", *options, ROLLOVER)


def test_a_verified_pair_is_marked_where_the_best_pair_is_drawn(verified: Path) -> None:
    """The best tr for the td is another one, which the chart must not show as the verified one."""
    data = read_content(verified)
    assert data["verified"] == {"tr": 0.1, "td": 0.37}
    (flight,) = data["flights"]
    assert flight["view"][0] < 0.1 < 0.37 < flight["view"][1]
    text = verified.read_text("utf-8")
    assert "For comparison: the best pair for this td" in text
    assert "the judged pair: tr and td" in text


def test_a_page_without_a_verified_pair_marks_none(paper: Path) -> None:
    assert "verified" not in read_content(paper)
    assert 'class="verified"' not in paper.read_text("utf-8")


def test_a_finished_switched_run_is_drawn_over_the_reference(tmp_path: Path) -> None:
    """From tr to td its energy is locked in, which no energy of the reference run is for so long."""
    page = write_page(tmp_path, *SWITCHED)
    data = read_content(page)
    time, energy = map(np.array, data["computed"])
    (flight,) = data["flights"]
    assert flight["view"][0] <= time[0] < time[-1] <= flight["view"][1]
    tr, td = data["verified"].values()
    locked = energy[(tr + 0.1 * (td - tr) < time) & (time < td - 0.1 * (td - tr))]
    assert np.ptp(locked) <= 0.01 * locked.mean()
    assert "switched run, as computed" in page.read_text("utf-8")


@mark_for_browser
def test_a_verdict_stands_above_the_pair_that_is_explored(
    verified: Path, browser: Browser
) -> None:
    browser.open(verified)
    badge = browser.find('.now h3 [data-value="verdict"]')
    assert badge.get_property("textContent") == "use with care"
    assert badge.get_attribute("class") == "badge care"


@mark_for_browser
def test_the_verified_tr_is_drawn_at_its_time(verified: Path, browser: Browser) -> None:
    browser.open(verified)
    (flight,) = read_content(verified)["flights"]
    start, end = flight["view"]
    shares = [(time - start) / (end - start) for time in (0.1, 0.12)]
    drawn = browser.driver.execute_script(HAS_VERIFIED_AT, shares)
    assert drawn == [True, False]


@mark_for_browser
def test_windows_of_acceptable_tr_follow_td(box: Path, browser: Browser) -> None:
    browser.open(box)
    for _ in range(3):
        browser.find(".handle").send_keys(Keys.ARROW_LEFT)
        suggestion = run_suggested(browser.value("command"))
        (recommended_window,) = (
            window
            for window in suggestion["acceptable_windows"]
            if window["recommended"]
        )
        assert format_window(
            recommended_window["start"], recommended_window["end"]
        ) in browser.value("windows")
        share = [
            f"{suggestion[end]:.0%}" for end in ("mean_energy_low", "mean_energy_high")
        ]
        assert browser.value("after").startswith(
            f"{share[0]} to {share[1]} of the reference's"
        )
    assert not browser.driver.find_elements("css selector", ".motion")


@mark_for_browser
def test_each_flight_of_a_plan_can_be_explored(
    tmp_path: Path, browser: Browser
) -> None:
    from selenium.webdriver.support.select import Select  # slow

    motion = str(tmp_path / "tumbling.matsum")
    assert (
        run(
            "rollover",
            "--mesh",
            "4",
            "--dt",
            "1e-3",
            "--drop",
            "0.4",
            "--tilt",
            "40",
            "-o",
            motion,
        ).exit_code
        == 0
    )
    page = write_page(
        tmp_path,
        "plan",
        "--no-verify",
        "--min-quality",
        "poor",
        "--part",
        "box",
        motion,
    )
    browser.open(page)
    flights = read_content(page)["flights"]
    assert len(flights) > 1
    Select(browser.find("#explorer-flight")).select_by_index(1)
    assert browser.value("exact_td") == repr(
        list_numbers(page, 1)[flights[1]["start"]]["td"]
    )


def test_a_page_of_many_states_stays_small(tmp_path: Path) -> None:
    time = np.linspace(0, 0.15, 20_000)
    noise = np.random.default_rng(1).normal(1, 0.01, time.size)
    energy = noise * 150 * np.exp(-10 * time) * np.sin(250 * time) ** 2
    table = tmp_path / "many.csv"
    np.savetxt(
        table,
        np.stack([time, energy], axis=1),
        delimiter=",",
        header="time,internal_energy",
        comments="",
    )
    page = write_page(
        tmp_path,
        "explore",
        "--no-verify",
        "--after",
        "0.001",
        "--td-window",
        "0.1",
        "0.11",
        "--steps",
        "2",
        str(table),
    )
    (flight,) = read_content(page)["flights"]
    least_energy = energy[(time > 0.001) & (time < 0.149)]
    assert max(flight["energy"][1]) == pytest.approx(least_energy.max(), rel=0.05)
    assert max(flight["whole"][1]) == pytest.approx(energy.max(), rel=1e-5)
    row = len(json.dumps(flight["rows"])) / len(flight["rows"])
    assert (
        page.stat().st_size + 2 * STEPS * row < 600_000
    )  # largest number of td that a page explores


def compute_contrast(first_colour: str, second_colour: str) -> float:
    """Return the contrast of two colours by WCAG 2, from 1 to 21."""

    def luminance(colour: str) -> float:
        parts = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
        linear = [
            part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4
            for part in parts
        ]
        return float(np.dot(linear, (0.2126, 0.7152, 0.0722)))

    dark, light = sorted((luminance(first_colour), luminance(second_colour)))
    return (light + 0.05) / (dark + 0.05)


def test_each_verdict_has_the_colour_of_its_grade() -> None:
    style = read_resource("style.css")
    colours = {"use": "good", "care": "care", "refused": "bad"}
    assert set(colours) == set(CLASSES.values())
    for name, colour in colours.items():
        assert f"\n.badge.{name} {{ color: var(--{colour}); }}" in style
        assert re.search(
            rf"\.card\.{name} {{ border-color: var\(--{colour}\); }}", style
        )


def test_letters_and_marks_stand_out_in_light_and_dark() -> None:
    themes = [
        dict(re.findall(r"--(\w+): (#\w{6})", block))
        for block in re.findall(r":root {(.*?)}", read_resource("style.css"), re.DOTALL)
    ]
    assert len(themes) == 2
    for colours in themes:
        for ground in ("ground", "panel"):
            for name in ("ink", "soft", "good", "care", "bad"):
                assert compute_contrast(colours[name], colours[ground]) >= 4.5, (
                    name,
                    ground,
                )
        for name in ("switched", "good", "ink", "focus"):
            assert compute_contrast(colours[name], colours["ground"]) >= 3
            assert compute_contrast(colours[name], colours["flight"]) >= 3
