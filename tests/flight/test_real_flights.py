"""Real histories over a grid of td: no traceback, no warning of a library, and health and flight never contradict."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from d2rpick.choice.settings import Settings
from d2rpick.choice.suggest import suggest, with_health
from d2rpick.errors import D2RPickError
from d2rpick.histories.balance_terms import balance_of
from d2rpick.histories.opening import open_run
from d2rpick.histories.selection import Selection
from tests.shared import SHARED

if TYPE_CHECKING:
    from pathlib import Path

FOLDERS = [SHARED / "real" / name for name in ("histories", "more-histories")]
FILES = sorted(path for folder in FOLDERS for path in folder.glob("*") if path.is_file())
PLAIN = Settings(replay=False)
_TIMES = 7


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name[-40:])
def test_nothing_fails_at_any_td_and_no_flight_contradicts_the_health(path: Path) -> None:
    try:
        run = open_run([str(path)])
        history = run.history(Selection())
    except D2RPickError:
        return  # refused; what is said of it is tested with the readers
    for td in np.linspace(history.time[0], history.time[-1], _TIMES).tolist():
        try:
            answer = suggest(history, td, PLAIN)
        except D2RPickError:
            assert history.time.size < 3
            continue
        balance = balance_of(run, history.parts, td)
        found = with_health(answer, balance) if balance else answer
        if answer.situation.in_flight:
            assert not {"work-in-window", "contact-in-window"} & {caution.code for caution in found.cautions}
