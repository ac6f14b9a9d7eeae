"""Screenshots of the HTML pages that d2rpick writes, taken with Chromium."""

from __future__ import annotations

import contextlib
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Final

from tests.command import ROOT, run
from tests.pictures.drawing import PLACE

_BROWSERS: Final = ("chromium", "chromium-browser", "google-chrome")
_HISTORY: Final = "sample_data/energy.csv"  # a page shows the name as it was given
_PAGES: Final = {
    "page-suggest": (
        ("suggest", "--td", "0.064", "--exit-zero", _HISTORY),
        "1000,1480",
    ),
    "page-explore": (
        ("explore", "--td", "0.064", "--td-window", "0.05", "0.08", _HISTORY),
        "1000,1480",
    ),
}

NAMES: Final = (*_PAGES,)


def browser() -> str | None:
    """Find Chromium."""
    return next(filter(None, map(shutil.which, _BROWSERS)), None)


def take_screenshot(name: str, program: str) -> None:
    """Write ``docs/pictures/NAME.png``."""
    question, size = _PAGES[name]
    with tempfile.TemporaryDirectory() as profile_folder:
        page = Path(profile_folder) / "page.html"
        with contextlib.chdir(ROOT):
            run(*question, "--quiet", "--report", str(page))
        options = [
            "--headless",
            "--no-sandbox",
            "--hide-scrollbars",
            f"--window-size={size}",
        ]
        picture = f"--screenshot={PLACE / f'{name}.png'}"
        subprocess.run(
            [program, *options, picture, page.as_uri()], check=True, capture_output=True
        )
