"""The health of a reference run as measures with the limits that practice uses."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from d2rpick.choice import health as limits
from d2rpick.flight.flight import MOST_WORK

if TYPE_CHECKING:
    from d2rpick.choice.health import Health


def head(health: Health) -> tuple[str, ...]:
    """Names of the columns of a table of health; the first says up to when the run was judged."""
    return "health" if health.until is None else f"health up to {health.until:.6g}", "this run", "practice", "verdict"


class Measure(NamedTuple):
    """A measure for people: ``value`` None where the files lack it, and then ``good`` is None too."""

    what: str
    value: str | None
    limit: str
    good: bool | None


def measures_of(health: Health) -> list[Measure]:
    """All measures of a run, those of its window last."""
    low, high = health.energy_ratio_min, health.energy_ratio_max
    span = None if low is None or high is None else (low, high)
    part = f"hourglass energy of {health.part.name if health.part else 'parts'}"
    found = [
        _share("hourglass energy", health.hourglass_share, limits.MOST_HOURGLASS),
        _share(part, health.part_hourglass_share, limits.MOST_HOURGLASS),
        Measure(
            "energy ratio",
            span and f"{span[0]:.4g} to {span[1]:.4g}",
            f"within {limits.MOST_IMBALANCE:.0%} of 1",
            span and max(1 - span[0], span[1] - 1) <= limits.MOST_IMBALANCE,
        ),
        _share("contact energy", health.sliding_share, limits.MOST_SLIDING),
        _share("negative contact energy", health.negative_sliding_share, limits.MOST_NEGATIVE_SLIDING),
        _share("energy of deleted elements", health.eroded_share, MOST_WORK),
    ]
    if health.window:
        found += [
            _share("change of contact energy in the window", health.window_sliding, MOST_WORK),
            _share("work beyond gravity and damping there", health.window_work, MOST_WORK),
            _share("energy deleted there", health.window_eroded, 0.0),
        ]
    return found


def _share(what: str, share: float | None, most: float) -> Measure:
    limit = f"at most {most:.0%}" if most else "none"
    return Measure(what, None if share is None else f"{share:.2%}", limit, None if share is None else share <= most)
