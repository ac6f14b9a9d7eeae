"""Sensors of times in a Radioss starter deck: when they are active, and those that switch bodies in one run.

A rigid body with a sensor is deformable while that is active, and rigid while it is not.  Source: Altair's public help
for /SENSOR and /RBODY, the format files of OpenRadioss (Tstop has a line of its own, since version 2023), and runs
computed with it.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import DeckError
from d2rpick.deck.printed_card import Times, shortest
from d2rpick.deck.radioss_deck import Starter, below_title, blocks, card_of, keyword, reals

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from d2rpick.deck.source import Block, SourceFile

    Spans = tuple[Times, ...]

STOPS_SINCE: Final = 2023  # version of the format from which on a sensor of time has an end
_NEVER: Final = 1e20


def active_spans(starter: Starter, number: int, above: tuple[int, ...] = ()) -> Spans | str:
    """Find when a sensor is active: spans (from, to) in order, or what cannot be followed, in words.

    ``above`` are sensors that ask for this one.
    """
    card = starter.sensors.get(number)
    if card is None or number in above:
        return f"sensor {number}, which {'asks for itself' if card else 'the deck has not'}"
    rows, kind = below_title(card), card.words[1]
    if kind not in ("TIME", "OR", "AND", "NOT"):
        return f"sensor {number}, which is not a time sensor"
    delay = reals(rows[0], 1)[0] if rows else 0.0
    if kind == "TIME":
        stop = reals(rows[1], 1)[0] if len(rows) > 1 and starter.version >= STOPS_SINCE else 0.0
        if math.isnan(delay) or math.isnan(stop):
            return f"sensor {number}, whose time is no number"
        stop = stop if 0 < stop < _NEVER else math.inf
        return ((max(delay, 0.0), stop),) if delay < stop else ()
    if delay or len(rows) < 2:
        return f"sensor {number}, whose delay is not followed"
    asked = [card.integer(rows[1], at).value for at in range(1 if kind == "NOT" else 2)]
    found = [active_spans(starter, one, (*above, number)) for one in asked]
    for one in found:
        if isinstance(one, str):
            return f"sensor {number}, of {one}"
    known = [one for one in found if not isinstance(one, str)]
    if kind == "OR":
        return _either(known)
    return inactive(_either([inactive(one) for one in known]) if kind == "AND" else known[0])


def _either(several: Sequence[Spans]) -> Spans:
    joined: list[Times] = []
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


def sensor_cards(windows: Sequence[Times], first: int) -> tuple[str, int]:
    """Write sensors with ids from ``first`` on, and give the id of the one that is active outside of the windows."""
    spans = inactive(tuple(windows))
    texts, last = list[str](), first
    for number, (start, stop) in enumerate(spans, start=first):
        until = min(stop, _NEVER)
        texts.append(f"/SENSOR/TIME/{number}\ndeformable\n{shortest(start, 20):>20}\n{shortest(until, 20):>20}\n")
    for number, other in enumerate(range(first + 1, first + len(spans)), start=first + len(spans)):
        texts.append(f"/SENSOR/OR/{number}\ndeformable\n{0:20d}\n{last:10d}{other:10d}\n")
        last = number
    return "".join(texts), last


def with_sensors(source: SourceFile, sensors: Mapping[int, int]) -> bytes:
    """Let bodies be switched by sensors, in a file of the starter deck: ``sensors`` by main node.

    The version of its /BEGIN becomes one that knows when a sensor stops.  DeckError where a body has a sensor already.
    """
    content, edits = source.read(0), dict[int, tuple[int, bytes]]()
    for block in blocks(source):
        if keyword(block)[:1] in {("BEGIN",), ("RBODY",)}:
            edits.update(_edit(block, sensors))
    for at in sorted(edits, reverse=True):
        end, text = edits[at]
        content = content[:at] + text + content[end:]
    return content


def _edit(block: Block, sensors: Mapping[int, int]) -> Iterator[tuple[int, tuple[int, bytes]]]:
    """Give the bytes of the line that changes: where it begins, where it ends, and its text."""
    card = card_of(block)
    for row in below_title(card)[:1]:
        lines = block.source.read(block.start, block.end).split(b"\n")
        at = block.start + sum(len(line) + 1 for line in lines[: row.distance])
        text = lines[row.distance].rstrip(b"\r").decode("latin-1").ljust(20)
        first, second = (card.integer(row, place).value for place in (0, 1))
        if card.words[0] == "BEGIN":
            new = f"{max(first, STOPS_SINCE):10d}{text[10:]}"
        elif first in sensors:
            if second:
                raise DeckError(f"{row.field(1).at}: sensor {second} switches this /RBODY already; remove it first")
            new = f"{text[:10]}{sensors[first]:10d}{text[20:]}"
        else:
            return
        yield at, (at + len(lines[row.distance].rstrip(b"\r")), new.encode("latin-1"))
