"""Health of a run: whether its energies can be trusted, what acts in the window, and which runs cannot be judged.

A term that the files do not have gives None, never 0.  Shares are of the peak of the internal energy, as practice
takes them, and left out where that is tiny.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from d2rpick.base.errors import Caution, RangeError
from d2rpick.base.tuples import NamedTuple
from d2rpick.flight.flight import MOST_WORK
from d2rpick.flight.internal_energy import largest
from d2rpick.flight.work import FEWEST_STATES, work_beyond_gravity
from d2rpick.histories.history import LARGEST_ENERGY
from d2rpick.histories.samples import window as within

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator, Sequence

    from d2rpick.choice.question import Settings
    from d2rpick.histories.history import Balance, History, Samples
    from d2rpick.histories.names import Part

# Hourglass energy is to stay below a tenth of the peak internal energy, of the model and of each part: rule of thumb of
# DYNAmore (dynasupport.com/howtos/element/hourglass); the same tenth in NCHRP Web-Only Document 179 (2010), table E-1.
MOST_HOURGLASS = 0.10
# The total energy must not vary by more than a tenth: NCHRP Web-Only Document 179 (2010), table E-1.
MOST_IMBALANCE = 0.10
# Without friction contacts should hold less than a tenth of the peak internal energy
# (dynasupport.com/howtos/general/contact-energy).  Negative energy has no physical cause but comes from penetrations;
# a twentieth is what Oasys' energy check allows of either sign.
MOST_SLIDING, MOST_NEGATIVE_SLIDING = 0.10, 0.05
# In free flight contacts do not work either.  Deleted elements may not hold more: LS-DYNA keeps their energy in the
# internal energy of the model (ftp.lstc.com, FAQ energy_balance).

# Below a millionth of the largest energy of the run, internal energy is rounding: single precision and glstat print
# six to seven digits of the sum.  LS-DYNA's internal energy begins at a floor of 2e-20 per process.
_TINY_SHARE, _FLOOR = 1e-6, 1e-15
# A part whose internal energy is below a hundredth of that of another one does not matter for their sum.
_SMALL_PART = 0.01
# Where the run has hardly any energy yet, a small error is a large ratio (Altair, Radioss FAQ on the energy error): the
# ratio counts where its reference exceeds a tenth of its peak, so that the tenth allowed is 1 % of that peak or more.
_COUNTING_REFERENCE = 0.1
# Code of the warning of an engine that reports wrong energies.
WRONG_ENERGY: Final = "engine-wrong-energy"
# Codes of what says nothing of parts whose own momentum is that of free flight.
OF_THE_MODEL = ("contact-in-window", "work-in-window")


class Health(NamedTuple):
    """How a run stands up to the time ``until``; fields are the keys of the JSON output, None for what is not written.

    Shares are of the peak internal energy of the model (``part_hourglass_share``: of ``part``, the worst of those
    chosen); the ratio is the total energy over the initial energy and the external work.  The last three are over
    ``window`` [time]: how much the energy of the contacts changes, what the external work holds beyond gravity and
    damping, how much the eroded energy grows, as shares of the mean energy of the chosen parts there.  ``reason`` says
    why shares are None although there are energies, ``window_reason`` why the work in the window is.
    """

    hourglass_share: float | None = None
    part_hourglass_share: float | None = None
    part: Part | None = None
    energy_ratio_min: float | None = None
    energy_ratio_max: float | None = None
    sliding_share: float | None = None
    negative_sliding_share: float | None = None
    eroded_share: float | None = None
    window: tuple[float, float] | None = None
    window_sliding: float | None = None
    window_work: float | None = None
    window_eroded: float | None = None
    reason: str | None = None
    window_reason: str | None = None
    until: float | None = None


def assess(
    balance: Balance,
    window: tuple[float, float] | None = None,
    locked: float | None = None,
    until: float | None = None,
) -> Health:
    """Judge the balance of a run.

    Parameters
    ----------
    balance : Balance
    window : (float, float), optional
        Free flight, or the rigid window [time].
    locked : float, optional
        Mean energy of the chosen parts in the window; without it that of the model [energy].
    until : float, optional
        Where the balance ends, to be said with each of its figures [time].
    """
    peak = _peak(balance)
    if balance.internal is not None and peak is None:
        reason = (
            "the internal energy never exceeds a millionth of the energy of the run, so "
            "shares of it are meaningless"
        )
        return Health(**_ratio(balance), window=window, reason=reason, until=until)
    return Health(
        hourglass_share=_share(balance.against_hourglassing, peak),
        **_worst_part(balance),
        **_ratio(balance),
        sliding_share=_share(_without_friction(balance), peak),
        negative_sliding_share=None
        if balance.sliding is None
        else _share(-balance.sliding, peak),
        eroded_share=_share(balance.eroded, peak),
        window=window,
        **(_in_window(balance, *window, locked) if window else {}),
        window_reason=_too_short(balance, window) if window else None,
        until=until,
    )


def _too_short(balance: Balance, window: tuple[float, float]) -> str | None:
    """Say so when the work in the window is written, but in too few states to tell a load from gravity."""
    states = int(
        np.count_nonzero((balance.time >= window[0]) & (balance.time <= window[1]))
    )
    if balance.external_work is None or states >= FEWEST_STATES:
        return None
    return f"the window holds {states} states: at least {FEWEST_STATES} are needed to tell a load from gravity"


def cautions_of_health(health: Health, *, at_rest: bool = False) -> Iterator[Caution]:
    """What of the health of a run should be known, with stable codes.

    Where nothing vibrates (``at_rest``) no level of the internal energy is matched, so hourglass does not matter.
    """
    up_to = "" if health.until is None else f" up to {health.until:.6g}"
    where = "from {:.6g} to {:.6g}".format(*health.window) if health.window else ""
    for code, holds, sentence in _ALARMS:
        if holds(health) and not (at_rest and code.endswith("hourglass")):
            yield Caution(code, sentence.format(h=health, up_to=up_to, where=where))


def cautions_of_engine(sources: Collection[str]) -> Iterator[Caution]:
    """Say so where listings beside the files of a run show an engine that reports wrong energies."""
    if not any("T0" in name for name in sources):  # none is a leg of a Radioss run
        return
    from d2rpick.histories.listings import (
        wrong_energies,
    )  # not above: other histories do without it

    if found := list(wrong_energies(sources)):
        why = "OpenRadioss from before January 2026 reports a wrong internal energy after /RBODY/ON or /RBODY/OFF"
        told = f"{found[0]}: {why} in a restart (its pull request 4538); do not judge by the energies of this run"
        yield Caution(WRONG_ENERGY, told)


def _above(value: float | None, limit: float) -> bool:
    return value is not None and value > limit


def _gains_or_loses(health: Health) -> bool:
    low = health.energy_ratio_min
    high = health.energy_ratio_max
    return (
        low is not None
        and high is not None
        and (low < 1 - MOST_IMBALANCE or high > 1 + MOST_IMBALANCE)
    )


_UNRELIABLE: Final = "do not rely on the internal energy"
# Codes of what should be known of a run, when it holds, and what is said then.
_ALARMS: Final[Sequence[tuple[str, Callable[[Health], bool], str]]] = (
    ("hourglass", lambda h: _above(h.hourglass_share, MOST_HOURGLASS),
     f"hourglass energy reaches {{h.hourglass_share:.0%}} of the internal energy{{up_to}}: {_UNRELIABLE}"),
    ("part-hourglass", lambda h: _above(h.part_hourglass_share, MOST_HOURGLASS),
     ("hourglass energy of {h.part.name} reaches {h.part_hourglass_share:.0%} of its internal energy{up_to}: "
     f"{_UNRELIABLE}")),
    ("energy-ratio", _gains_or_loses,
     ("total energy over initial energy and external work ranges from {h.energy_ratio_min:.3g} to "
     "{h.energy_ratio_max:.3g}{up_to}: the run gains or loses energy")),
    ("negative-sliding", lambda h: _above(h.negative_sliding_share, MOST_NEGATIVE_SLIDING),
     "contact energy falls to -{h.negative_sliding_share:.0%} of the internal energy{up_to}: check for penetrations"),
    ("sliding", lambda h: _above(h.sliding_share, MOST_SLIDING),
     "contact energy reaches {h.sliding_share:.0%} of the internal energy{up_to}; only friction can explain that"),
    ("eroded-energy", lambda h: _above(h.eroded_share, MOST_WORK),
     ("deleted elements hold {h.eroded_share:.0%} of the internal energy{up_to}: it counts as internal energy of the "
     "model but does not spring back")),
    ("window-not-judged", lambda h: h.window_reason is not None, "{h.window_reason}"),
    ("contact-in-window", lambda h: _above(h.window_sliding, MOST_WORK),
     ("contact energy of the model changes by {h.window_sliding:.0%} of the energy {where}: where the parts touch "
     "something, they do not fly freely")),
    ("work-in-window", lambda h: _above(h.window_work, MOST_WORK),
     ("external work beyond gravity and damping is {h.window_work:.0%} of the energy {where}: where it acts on the "
     "parts, they do not fly freely")),
    ("erosion", lambda h: _above(h.window_eroded, 0.0),
     "elements are eroded {where}; elements of rigid parts would not be"),
)  # fmt: skip


def _peak(balance: Balance) -> float | None:
    """Peak of the internal energy; None where it is unknown or tiny."""
    if balance.internal is None:
        return None
    most = largest(
        balance.internal, balance.kinetic, balance.total, balance.external_work
    )
    peak = float(balance.internal.max())
    return peak if peak > max(_FLOOR, _TINY_SHARE * most) else None


def _share(energy: Samples | None, peak: float | None) -> float | None:
    """Highest value over the peak of the internal energy, 0 where it is never positive."""
    if energy is None or peak is None:
        return None
    return max(0.0, float(energy.max())) / peak


def _without_friction(balance: Balance) -> Samples | None:
    if balance.sliding is None or balance.friction is None:
        return balance.sliding
    return balance.sliding - balance.friction


def _worst_part(balance: Balance) -> dict[str, Any]:
    least = max(
        _FLOOR,
        _SMALL_PART * max((e for _, _, e in balance.hourglass_of_parts), default=0.0),
    )
    shares = [(h / e, part) for part, h, e in balance.hourglass_of_parts if e > least]
    if not shares:
        return {}
    share, part = max(shares, key=lambda one: one[0])
    return {"part_hourglass_share": share, "part": part}


def _ratio(balance: Balance) -> dict[str, Any]:
    """Range of the energy ratio, the solver's own or that of its terms, where its reference counts."""
    ratio = balance.ratio
    total = _total(balance)
    reference = None
    if ratio is not None and balance.total is not None:
        reference = np.divide(
            balance.total, ratio, out=np.zeros_like(ratio), where=ratio != 0
        )
    elif ratio is None and total is not None and balance.external_work is not None:
        reference = total[0] + balance.external_work - balance.external_work[0]
        ratio = np.divide(
            total, reference, out=np.ones_like(total), where=reference != 0
        )
    if ratio is None:
        return {}
    if reference is not None:
        ratio = ratio[
            np.abs(reference) >= _COUNTING_REFERENCE * float(np.abs(reference).max())
        ]
    return {
        "energy_ratio_min": float(ratio.min()),
        "energy_ratio_max": float(ratio.max()),
    }


def _total(balance: Balance) -> Samples | None:
    """Total energy as the solver keeps it, or else the sum of all terms; None where one of the main ones is unknown."""
    if balance.total is not None:
        return balance.total
    if balance.internal is None or balance.kinetic is None:
        return None
    others = (balance.hourglass, balance.sliding, balance.damping, balance.wall)
    return np.asarray(
        balance.internal
        + balance.kinetic
        + sum(term for term in others if term is not None)
    )


def _in_window(
    balance: Balance, start: float, end: float, locked: float | None
) -> dict[str, Any]:
    """What should not happen in free flight, as shares of the energy there."""
    inside = within(balance.time, start, end)
    if locked is None and balance.internal is not None:
        if balance.time[inside].size:
            locked = float(np.mean(balance.internal[inside]))
        else:
            locked = None
    if locked is None or locked <= _FLOOR:
        return {}
    found = {}
    for name, energy in (
        ("window_sliding", balance.sliding),
        ("window_eroded", balance.eroded),
    ):
        if energy is not None and energy[inside].size:
            open_ = balance.precision.quantum(
                float(np.abs(energy[inside]).max())
            )  # by its printed digits
            found[name] = max(0.0, float(np.ptp(energy[inside])) - open_) / locked
    work = work_beyond_gravity(balance, start, end)
    if work is not None:
        found["window_work"] = work / locked
    return found


# A run that blew up gains energy from nothing: within a twentieth of the record its kinetic energy exceeds all that
# was there before by nine orders of magnitude, and the internal energy then by six, which has grown a thousandfold as
# well.  A load on a body at rest deforms it as it moves it, a velocity that is given to all of it does not deform it.
_WITHIN: Final = 1 / 20
_GAIN, _SPEED, _TORN = 1e9, 1e6, 1e3
# So many states with energy have to lie before: the first ones of a body at rest hold round-off, or nothing.
_FEWEST: Final = 12
# No unit makes energies of a structure that small: LS-DYNA's begin at 2e-20 per process.
_NOTHING: Final = 1e-20


def refuse_unsound(
    history: History,
    settings: Settings,
    td: float | tuple[float, float] | None = None,
    *,
    choosing: bool = True,
) -> None:
    """RangeError where no number of the run can be used, and for ``choosing`` where there is nothing to choose by.

    Also where a time that was asked for, ``td`` or a window for it among them, looks to be in another unit.
    """
    for one in unsound(history):
        if choosing or one.code != "nothing-to-judge":
            raise RangeError(f"{', '.join(history.source)}: {one.message}")
    times = {"after": settings.after, "landing": settings.landing}
    for name, time in {
        **times,
        "td_window" if isinstance(td, tuple) else "td": td,
    }.items():
        if time is not None:
            history.check_unit(
                *(time if isinstance(time, tuple) else (time,)), argument=name
            )


def unsound(history: History) -> Iterator[Caution]:
    """Say why a run cannot be judged, with stable codes."""
    most = largest(history.energy)
    if most > LARGEST_ENERGY:
        yield Caution(
            "energy-too-large",
            f"energies up to {most:g}, at most {LARGEST_ENERGY:g} was expected",
        )
    elif found := _blew_up(history):
        yield Caution("blew-up", found)
    elif _has_nothing(history):
        found = f"nothing to judge: no internal energy exceeds {most:.3g}, so nothing deforms"
        yield Caution("nothing-to-judge", found)


def _blew_up(history: History) -> str | None:
    """Name the time at which the energy exceeds all sense, and by how much; None in a sound run."""
    balance = history.balance
    if (
        balance is None
        or balance.kinetic is None
        or balance.internal is None
        or balance.time.size <= _FEWEST
    ):
        return None
    time = balance.time
    kinetic = np.abs(balance.kinetic)
    internal = np.abs(balance.internal)
    earlier = np.searchsorted(
        time, time - _WITHIN * (time[-1] - time[0])
    )  # states before the twentieth up to each
    counted = (
        np.concatenate([[0], np.cumsum(kinetic + internal > 0)])[earlier] >= _FEWEST
    )
    before, deformed = (
        np.concatenate([[0.0], np.maximum.accumulate(one)])[earlier]
        for one in (kinetic + internal, internal)
    )
    gained = counted & (deformed > 0) & (kinetic > _GAIN * before)
    gained &= (kinetic / _SPEED > internal) & (
        internal / _TORN > deformed
    )  # products might overflow
    if balance.external_work is not None:
        gained &= kinetic > _GAIN * np.abs(balance.external_work)
    at = int(np.argmax(gained))
    if not gained[at]:
        return None
    found = f"the run blew up: from {before[at]:.3g} before, its energy reaches {kinetic[at]:.3g} at {time[at]:.6g}"
    return f"{found}; nothing in it can be trusted"


def _has_nothing(history: History) -> bool:
    """Whether the internal energy of chosen parts and model is always zero, or all energies are nothing."""
    balance = history.balance
    if balance is None:
        return False
    highest = largest(history.energy, balance.internal)
    beside = largest(balance.kinetic, balance.external_work, balance.total)
    return highest == 0 or max(highest, beside) <= _NOTHING
