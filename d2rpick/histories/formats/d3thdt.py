"""Read LS-DYNA's d3thdt, which is a d3plot of selected nodes and elements with a shorter output interval."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.histories.formats import d3plot
from d2rpick.histories.formats.d3plot_words import detect_family

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.histories.names import Selection
    from d2rpick.histories.source import Source


def recognises(head: bytes) -> bool:
    """Return True if these first bytes belong to a d3thdt. This function never raises."""
    return detect_family(head) == "d3thdt"


def open_legs(sources: Sequence[Source], selection: Selection) -> list[d3plot.D3plot]:
    """Open each file family as a restart segment of the run."""
    legs = d3plot.open_legs(sources, selection)
    for leg in legs:
        leg.format = "d3thdt"
    return legs
