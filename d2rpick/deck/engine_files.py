"""Write Radioss engine files with the end of the engine run, the bodies to switch, and the time-step limit."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from d2rpick.base.errors import DeckError
from d2rpick.deck.radioss_columns import RUN

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.base.spans import Times


# Smallest number of time steps in a rigid window; it must be large, because parts are released up to one step late.
# Each window has its own time-step limit, so that adding a window does not change the run before it.
CAP_SHARE = 1000
_NODES_PER_LINE = 10
# Largest number of engine runs; the names of time history files contain the number with two digits.
MOST_LEGS = 99


class EngineFile(NamedTuple):
    """An engine run: its number, its end [time], and its time-step limit [time] (None if no body is rigid)."""

    number: int
    stop: float
    cap: float | None


def choose_step_cap(tr: float, td: float) -> float:
    """Return the time-step limit while parts are rigid from tr to td [time]."""
    return float(f"{(td - tr) / CAP_SHARE:.2g}")


def plan_legs(
    windows: Sequence[Times], end: float, step_cap: float | None
) -> list[EngineFile]:
    """Return the engine runs for rigid windows up to ``end``; a window that begins at 0 needs no engine run before it.

    Raises
    ------
    DeckError
        If more than 99 runs are needed.
    """
    caps = [step_cap or choose_step_cap(tr, td) for tr, td in windows]
    switches = zip(windows, caps, strict=True)
    stops: list[tuple[float, float | None]] = []
    for (tr, td), rigid_cap in switches:
        if tr > 0:
            stops.append((tr, None))
        if td > 0:
            stops.append((td, rigid_cap))
    if len(stops) >= MOST_LEGS:
        raise DeckError(
            f"{len(windows)} windows need {len(stops) + 1} engine runs, but at most {MOST_LEGS} were expected"
        )
    numbered = enumerate([*stops, (end, None)], start=1)
    return [EngineFile(number, stop, cap) for number, (stop, cap) in numbered]


def write_bodies_off(nodes: Sequence[int]) -> Iterator[str]:
    """Yield the lines of a block that deactivates rigid bodies.

    One block contains all bodies, because the OpenRadioss starter ignores a second such block directly after the first.
    """
    if nodes:
        yield from ("/RBODY/OFF", *write_numbers(nodes))


def write_numbers(ids: Sequence[int]) -> Iterator[str]:
    """Yield the lines of a list of numbers."""
    yield from (
        " ".join(map(str, ids[i : i + _NODES_PER_LINE]))
        for i in range(0, len(ids), _NODES_PER_LINE)
    )


def write_engine_lines(
    leg: EngineFile, name: str, ids: Sequence[int], other_nodes: Sequence[int]
) -> Iterator[str]:
    """Yield the lines of an engine file that activates the bodies ``ids``; ``other_nodes`` stay inactive."""
    yield f"/RUN/{name}/{leg.number}"
    yield RUN.write(Tstop=leg.stop)
    if leg.cap is not None and ids:
        yield from ("/RBODY/ON", *write_numbers(ids))
    yield from write_bodies_off(
        other_nodes if leg.cap is not None else (*ids, *other_nodes)
    )
    if leg.cap is not None:
        yield from write_step_limit(leg.cap)


def write_step_limit(cap: float) -> Iterator[str]:
    """Yield the lines that limit the time step while bodies are rigid."""
    yield from (
        "# limits the time step, which would grow if no deformable part is left",
        "/DTIX",
        f"{cap!r} {cap!r}",
    )
