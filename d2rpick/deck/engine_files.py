"""Engine files of a Radioss run as lines: a leg with its end, the bodies that are on and off in it, and its step."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from d2rpick.base.errors import DeckError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.deck.printed_card import Times

# Of the rigid window, per step: the release is at most a thousandth of it late.  Each window has its own, so that
# further windows leave the run up to them as it was.
_CAP_SHARE = 1000
_NODES_PER_LINE = 10
_MOST_LEGS = 99  # the solver numbers them with two digits where it matters, in the names of time histories


class EngineFile(NamedTuple):
    """An engine run: its number, its end, and its largest step where the bodies are rigid in it, else None."""

    number: int
    stop: float
    cap: float | None


def choose_step_cap(tr: float, td: float) -> float:
    """Largest step while rigid [time]."""
    return float(f"{(td - tr) / _CAP_SHARE:.2g}")


def legs(
    windows: Sequence[Times], end: float, step_cap: float | None
) -> list[EngineFile]:
    """Give the engine runs that the windows ask for; a window from 0 on needs none before it."""
    caps = [step_cap or choose_step_cap(tr, td) for tr, td in windows]
    switches = zip(windows, caps, strict=True)
    stops = [
        (time, cap)
        for (tr, td), own in switches
        for time, cap in ((tr, None), (td, own))
        if time > 0
    ]
    if len(stops) >= _MOST_LEGS:
        raise DeckError(
            f"{len(windows)} windows need {len(stops) + 1} engine runs, at most {_MOST_LEGS} were expected"
        )
    numbered = enumerate([*stops, (end, None)], start=1)
    return [EngineFile(number, stop, cap) for number, (stop, cap) in numbered]


def off(nodes: Sequence[int]) -> Iterator[str]:
    """Put rigid bodies off; the starter of OpenRadioss overlooks a second such block right behind the first."""
    if nodes:
        yield from ("/RBODY/OFF", *listed(nodes))


def listed(ids: Sequence[int]) -> Iterator[str]:
    """Write numbers in lines."""
    yield from (
        " ".join(map(str, ids[i : i + _NODES_PER_LINE]))
        for i in range(0, len(ids), _NODES_PER_LINE)
    )


def engine_lines(
    leg: EngineFile, name: str, ids: Sequence[int], others: Sequence[int]
) -> Iterator[str]:
    """Write what an engine file says of a leg: its run, and which main nodes are rigid; ``others`` stay off."""
    yield f"/RUN/{name}/{leg.number}"
    yield f"{leg.stop!r:>20}"
    if leg.cap is not None and ids:
        yield from ("/RBODY/ON", *listed(ids))
    yield from off(others if leg.cap is not None else (*ids, *others))
    if leg.cap is not None:
        yield from capped(leg.cap)


def capped(cap: float) -> Iterator[str]:
    """Hold the step of a leg with rigid bodies below a limit."""
    yield from (
        "# with nothing deformable left the step would grow without limit",
        "/DTIX",
        f"{cap!r} {cap!r}",
    )
