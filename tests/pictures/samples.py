"""Pictures in ``sample_data`` that commands of d2rpick draw from the samples."""

from __future__ import annotations

import contextlib
from typing import Final

from tests.command import ROOT, run

_COMMANDS: Final = {
    "suggest": ("suggest", "--td", "0.0687534", "sample_data/energy.csv"),
    "midpoint": ("suggest", "--part", "flying", "sample_data/rolloverT01.gz"),
    "rollover-scan": ("rollover", "--scan"),
}

NAMES: Final = (*_COMMANDS,)


def draw_sample(name: str) -> None:
    """Write ``sample_data/NAME.png`` by the command that sample_data/README.md names."""
    command, *options = _COMMANDS[name]
    picture = f"sample_data/{name}.png"
    with contextlib.chdir(ROOT):
        run(command, "--overwrite", "--plot", picture, *options)
