"""The interactive part of the pages that the command line writes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.cli import typed

if TYPE_CHECKING:
    from collections.abc import Iterable

    from d2rpick.choice.trade_off import TradeOff
    from d2rpick.report.explorer import Explorer


def explorer_of(found: Iterable[TradeOff | None]) -> Explorer | None:
    """Give what can be explored, and the command line that asks for each pair; None where there is nothing."""
    from d2rpick.report.explorer import Explorer

    trade_offs = tuple(one for one in found if one)
    return Explorer(trade_offs, typed.asking()) if trade_offs else None
