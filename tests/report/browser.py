"""A page in a real browser: Chromium without a window, driven by selenium; skipped where there is none."""

import base64
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import isclose
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import pytest
from selenium import webdriver
from selenium.webdriver.common.by import By

if TYPE_CHECKING:
    from selenium.webdriver.remote.webelement import WebElement

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
DRIVER = shutil.which("chromedriver")
_NEEDED = pytest.mark.skipif(
    not (CHROMIUM and DRIVER), reason="Chromium and chromedriver are not installed (Debian: chromium, chromium-driver)"
)
Test = TypeVar("Test", bound=Callable[..., None])
_OPTIONS = ("--headless=new", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking")
# Everything that shows on the page, reaches over its right edge, and lies in nothing that scrolls.
_CUT = """
const scrolls = (one) => one.closest(".scroll, pre") !== null;
return [...document.body.querySelectorAll("*")]
  .filter((one) => !scrolls(one) && one.getClientRects().length && one.getBoundingClientRect().right > innerWidth + 0.5)
  .map((one) => one.outerHTML.slice(0, 120));
"""


def in_browser(test: Test) -> Test:
    """Mark a test that takes a browser, and so its time."""
    for mark in (pytest.mark.slow, _NEEDED):
        mark(test)
    return test


class Browser:
    """A browser, and what a reader of a page does in it."""

    def __init__(self, driver: "webdriver.Chrome") -> None:
        self.driver = driver

    def open(self, page: Path, *, width: int = 1280, **media: str) -> None:
        """Show a page at a width [px], with what the reader prefers: ``prefers_color_scheme="dark"``."""
        size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500}
        features = [{"name": name.replace("_", "-"), "value": value} for name, value in media.items()]
        self.ask("Emulation.setDeviceMetricsOverride", **size)
        self.ask("Emulation.setEmulatedMedia", media="", features=features)
        self.driver.get(page.as_uri())

    def ask(self, command: str, **arguments: Any) -> Any:
        """Ask the browser itself, by its developer tools."""
        return self.driver.execute_cdp_cmd(command, arguments)

    def find(self, selector: str) -> "WebElement":
        """Find an element."""
        return self.driver.find_element(By.CSS_SELECTOR, selector)

    def shown(self, selector: str) -> bool:
        """Whether the first such element takes up room."""
        return self.find(selector).is_displayed()

    def value(self, name: str) -> str:
        """What the interactive part says under a name."""
        return str(self.find(f'[data-value="{name}"]').get_property("textContent"))

    def spoken(self, roles: set[str], value: float | None = None) -> list[dict[str, Any]]:
        """Elements with these roles, and this value, as a screen reader finds them, which is told a little later."""
        from selenium.webdriver.support.wait import WebDriverWait  # slow

        def found(_: object) -> list[dict[str, Any]]:
            nodes = self.ask("Accessibility.getFullAXTree")["nodes"]
            used = [node for node in nodes if node["role"]["value"] in roles and not node["ignored"]]
            used = [node for node in used if value is None or isclose(node["value"]["value"], value, rel_tol=1e-6)]
            return used if {node["role"]["value"] for node in used} == roles else []

        return WebDriverWait(self.driver, timeout=20).until(found)

    def cut(self) -> list[str]:
        """What is cut at the right edge, and whether the page is wider than the screen."""
        found: list[str] = self.driver.execute_script(_CUT)
        wide = self.driver.execute_script(
            "return document.documentElement.scrollWidth > document.documentElement.clientWidth"
        )
        return [*found, *["the page itself"] * bool(wide)]

    def pdf(self) -> bytes:
        """Print the page."""
        return base64.b64decode(self.ask("Page.printToPDF", preferCSSPageSize=True)["data"])

    def complaints(self) -> list[dict[str, Any]]:
        """What stands in the console since the last call."""
        return list(self.driver.get_log("browser"))  # type: ignore[no-untyped-call]


@contextmanager
def browsing(folder: Path) -> Iterator[Browser]:
    """Start a browser that keeps what it writes in ``folder``."""
    options = webdriver.ChromeOptions()
    options.binary_location = str(CHROMIUM)
    for option in (*_OPTIONS, f"--user-data-dir={folder / 'profile'}"):
        options.add_argument(option)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(str(DRIVER)))
    try:
        yield Browser(driver)
    finally:
        driver.quit()
