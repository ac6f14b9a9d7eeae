"""Real histories over a grid of td: no traceback, no warning of a library, and health and flight never contradict."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from d2rpick.choice.of_run import Reference, suggest_of
from d2rpick.choice.settings import Settings
from d2rpick.errors import D2RPickError
from d2rpick.histories.opening import open_run
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
        reference = Reference.of(open_run([str(path)]))
    except D2RPickError:
        return  # refused; what is said of it is tested with the readers
    for td in np.linspace(reference.history.time[0], reference.history.time[-1], _TIMES).tolist():
        try:
            answer = suggest_of(reference, td, PLAIN)
        except D2RPickError:
            assert reference.history.time.size < 3 or not reference.history.energy.any()
            continue
        if answer.situation.in_flight:
            assert not {"work-in-window", "contact-in-window"} & {caution.code for caution in answer.cautions}
