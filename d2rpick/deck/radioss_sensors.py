"""Sensors of times: when they are active over the legs of a Radioss run.

A rigid body with a sensor is deformable while that is active and rigid while it is not, whatever /RBODY/ON and OFF say.
Source: Altair's public help for /SENSOR and /RBODY, the published source of OpenRadioss at bd4557ba7 (sensor_time.F,
sensor_init.F, rbyonf.F), and runs computed with it: Tstop has a line of its own, and is read in every version of the
format; the delay of a sensor of others has no effect.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from d2rpick.deck.radioss_deck import Starter, below_title, reals

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    Spans = tuple[tuple[float, float], ...]  # of time

STOPS_SINCE: Final = 2023  # version of the format in whose description a sensor of time has an end
NEVER: Final = 1e20
_NO_RESETS: Final[Mapping[int, float]] = {}


def active_spans(
    starter: Starter, number: int, resets: Mapping[int, float] = _NO_RESETS, above: tuple[int, ...] = ()
) -> Spans | str:
    """Find when a sensor is active: spans (from, to) in order, or what cannot be followed, in words.

    ``resets`` are the times of the first /SENS/RESET of sensors by number, ``above`` are sensors that ask for this one.
    A sensor of time that is reset is active for one more cycle at most: its Tstop is lost.
    """
    card = starter.sensors.get(number)
    if card is None or number in above:
        return f"sensor {number}, which {'asks for itself' if card else 'the deck has not'}"
    rows, kind = below_title(card), card.words[1]
    if kind not in ("TIME", "OR", "AND", "NOT"):
        return f"sensor {number} (/SENSOR/{kind}), which is not a time sensor"
    if kind == "TIME":
        delay = reals(rows[0], 1)[0] if rows else 0.0
        stop = reals(rows[1], 1)[0] if len(rows) > 1 else 0.0
        if math.isnan(delay) or math.isnan(stop):
            return f"sensor {number}, whose time is no number"
        stop = min(stop if 0 < stop < NEVER else math.inf, resets.get(number, math.inf))
        return ((max(delay, 0.0), stop),) if delay < stop else ()
    if len(rows) < 2:
        return f"sensor {number}, which names no other"
    asked = [card.integer(rows[1], at).value for at in range(1 if kind == "NOT" else 2)]
    found = [active_spans(starter, one, resets, (*above, number)) for one in asked]
    for one in found:
        if isinstance(one, str):
            return f"sensor {number}, of {one}"
    known = [one for one in found if not isinstance(one, str)]
    if kind == "OR":
        return _either(known)
    return inactive(_either([inactive(one) for one in known]) if kind == "AND" else known[0])


def _either(several: Sequence[Spans]) -> Spans:
    joined: list[tuple[float, float]] = []
    for start, stop in sorted(one for spans in several for one in spans):
        if joined and start <= joined[-1][1]:
            start, stop = joined[-1][0], max(stop, joined.pop()[1])
        joined.append((start, stop))
    return tuple(joined)


def inactive(spans: Spans) -> Spans:
    """Spans between those in which a sensor is active."""
    ends = [0.0, *(end for span in spans for end in span), math.inf]
    pairs = zip(ends[::2], ends[1::2], strict=True)
    return tuple((start, stop) for start, stop in pairs if start < stop)
