"""The end of the load read off the internal energy alone, for want of better evidence."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from d2rpick.histories.crossings import find_crossings

if TYPE_CHECKING:
    from d2rpick.histories.history import History

# Widening of the band of energies before td, against wiggles of a vibration that the band has not seen.
_BAND_RESERVE = 0.25


def end_of_load(history: History, td: float) -> float | None:
    """Take the load to be over when the energy falls into its band before td for the last time [time].

    The band is that of the last quarter of the record before td, widened by a quarter of its width.  Where the
    energy never was above the band, nothing shows that a load has ended, and where its last part leaves the band of
    the rest, something feeds the part again: None.
    """
    length = td - float(history.time[0])
    earlier, latest = (
        np.append(history.energy[(history.time >= td - share * length) & (history.time <= end)], history.energy_at(end))
        for share, end in ((1 / 4, td - length / 16), (1 / 16, td))
    )
    before = history.time <= td
    if latest.max() > earlier.max() + _BAND_RESERVE * np.ptp(earlier):
        return None
    values = np.append(earlier, latest)
    level = float(values.max() + _BAND_RESERVE * np.ptp(values))
    falling = [c.time for c in find_crossings(history.time[before], history.energy[before], level) if not c.rising]
    return falling[-1] if falling else None
