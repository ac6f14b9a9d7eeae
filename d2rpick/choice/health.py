"""Judge the health of a run: whether its energies are reliable, which loads act in the window, and why it is refused.

If the files lack an energy term, the results that need it are None, never 0. Shares are relative to the peak internal
energy, as is usual in practice, and are None if this peak is tiny.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from d2rpick.base.errors import Caution, RangeError, list_names
from d2rpick.base.tuples import NamedTuple
from d2rpick.flight.flight import MOST_WORK
from d2rpick.flight.internal_energy import find_largest
from d2rpick.flight.window import FEWEST_STATES_OF_WORK, LAST_DIGIT
from d2rpick.flight.work import compute_work_beyond_gravity
from d2rpick.histories.history import LARGEST_ENERGY
from d2rpick.histories.samples import find_window as within

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator, Sequence

    from d2rpick.choice.question import Settings
    from d2rpick.histories.history import Balance, History, Samples
    from d2rpick.histories.names import Part

# Code of the flaw that the first restart segments are missing.
BEGINS_LATE: Final = "begins-late"
# Largest hourglass energy as a fraction of the peak internal energy, for the model and for each part [-].
# One source of the hourglass limit is a rule of thumb by DYNAmore (dynasupport.com/howtos/element/hourglass).
# Another source of the hourglass limit is NCHRP Web-Only Document 179 (2010), table E-1.
MOST_HOURGLASS = 0.10
# Largest relative change of the total energy [-] (source: NCHRP Web-Only Document 179 (2010), table E-1).
MOST_IMBALANCE = 0.10
# MOST_SLIDING: largest contact energy without friction, as a fraction of the peak internal energy [-].
# The source of MOST_SLIDING is dynasupport.com/howtos/general/contact-energy.
# MOST_NEGATIVE_SLIDING: largest absolute value of a negative contact energy, relative to the peak internal energy [-].
# A negative contact energy has no physical cause; it results from penetrations. The check by Oasys allows 5 %.
MOST_SLIDING, MOST_NEGATIVE_SLIDING = 0.10, 0.05
# Largest internal energy that is treated as 0 [energy]; LS-DYNA energies start at 2e-20 per process.
_FLOOR: Final = 1e-15
# Parts whose internal energy is at most this fraction of the largest part energy are ignored [-].
_SMALL_PART = 0.01
# The energy ratio is used if the reference energy is at least this fraction of its peak [-].
# If the reference energy is small, even a small error gives a large energy ratio (source: Altair, Radioss FAQ).
_COUNTING_REFERENCE = 0.1
# Code of the warning about an engine version that reports wrong energies.
WRONG_ENERGY: Final = "engine-wrong-energy"
# Codes of the warnings that are omitted if the part momenta show that the parts are in free flight.
OF_THE_MODEL = ("contact-in-window", "work-in-window")

_UNRELIABLE: Final = "do not rely on the internal energy"
# _WITHIN: smallest time between a state and the earlier states it is compared with, as a fraction of the record [-].
# _GAIN: smallest ratio of the kinetic energy of a diverged run to the largest earlier energy [-].
# _SPEED: smallest ratio of the kinetic energy of a diverged run to the internal energy [-].
# _TORN: smallest ratio of the internal energy of a diverged run to its earlier maximum, as its elements tear [-].
# No sound run meets all three criteria of a diverged run, because a load that accelerates a body also deforms it.
_WITHIN: Final = 1 / 20
_GAIN, _SPEED, _TORN = 1e9, 1e6, 1e3
# A diverged run is recognised only after this many states with energy; the first states may be round-off.
_FEWEST: Final = 12
# Largest energy that is treated as zero in any unit system, because LS-DYNA energies start at 2e-20 [energy].
_NOTHING: Final = 1e-20


class Health(NamedTuple):
    """Health of a run up to the time ``until``. The fields are the keys of the JSON output; None if a value is unknown.

    Shares are relative to the peak internal energy of the model, except ``part_hourglass_share``, which is relative to
    that of ``part``, the chosen part with the largest share. The energy ratio is the total energy divided by the sum of
    the initial energy and the external work. The last three shares are relative to the mean energy of the chosen parts
    in ``window`` [time]: the change of the contact energy, the external work beyond gravity and damping, and the growth
    of the eroded energy. ``reason`` states why shares are None although energies are written, and ``window_reason`` why
    the external work in the window is None.
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


def assess_health(
    balance: Balance,
    window: tuple[float, float] | None = None,
    locked: float | None = None,
    until: float | None = None,
) -> Health:
    """Judge the energy balance of a run.

    Parameters
    ----------
    balance : Balance
    window : (float, float), optional
        Free flight, or the rigid window [time].
    locked : float, optional
        Mean energy of the chosen parts in the window [energy]; the default is that of the model.
    until : float, optional
        End of the balance [time], which messages state with each figure.
    """
    peak = _find_peak(balance)
    if balance.internal is not None and peak is None:
        reason = (
            "the internal energy never exceeds 1e-6 of the energy of the run, so "
            "shares of it are meaningless"
        )
        return Health(
            **_find_ratio_range(balance), window=window, reason=reason, until=until
        )
    negative_sliding = None
    if balance.sliding is not None:
        negative_sliding = -balance.sliding
    return Health(
        hourglass_share=_compute_share(balance.against_hourglassing, peak),
        **_find_worst_part(balance),
        **_find_ratio_range(balance),
        sliding_share=_compute_share(_subtract_friction(balance), peak),
        negative_sliding_share=_compute_share(negative_sliding, peak),
        eroded_share=_compute_share(balance.eroded, peak),
        window=window,
        **(_measure_window(balance, *window, locked) if window else {}),
        window_reason=_explain_few_states(balance, window) if window else None,
        until=until,
    )


def _explain_few_states(balance: Balance, window: tuple[float, float]) -> str | None:
    """Return a message if the window has too few states to tell a load from gravity; otherwise None."""
    states = int(
        np.count_nonzero((balance.time >= window[0]) & (balance.time <= window[1]))
    )
    if balance.external_work is None or states >= FEWEST_STATES_OF_WORK:
        return None
    return f"the window holds {states} states: at least {FEWEST_STATES_OF_WORK} are needed to tell a load from gravity"


def warn_about_health(health: Health, *, at_rest: bool = False) -> Iterator[Caution]:
    """Yield the warnings about the health of a run; their codes are stable.

    If nothing vibrates (``at_rest``), no level of the internal energy has to be matched, so hourglass energy does not
    matter.
    """
    up_to = "" if health.until is None else f" up to {health.until:.6g}"
    where = "from {:.6g} to {:.6g}".format(*health.window) if health.window else ""
    for code, holds, sentence in _ALARMS:
        if holds(health) and not (at_rest and code.endswith("hourglass")):
            yield Caution(code, sentence.format(h=health, up_to=up_to, where=where))


def warn_about_engine(sources: Collection[str]) -> Iterator[Caution]:
    """Yield a warning if listings in the folder of a run show an engine version that reports wrong energies."""
    # The run has no listing of a Radioss engine.
    if not any("T0" in name for name in sources):
        return
    # Imported here to keep start-up fast.
    from d2rpick.histories.listings import (
        find_wrong_energies,
    )

    listings = list(find_wrong_energies(sources))
    if listings:
        why = "OpenRadioss from before January 2026 reports a wrong internal energy after /RBODY/ON or /RBODY/OFF"
        text = (
            f"{listings[0]}: {why} in a restart (its pull request 4538); run the reference again with a "
            "newer version"
        )
        yield Caution(WRONG_ENERGY, text)


def _is_above(value: float | None, limit: float) -> bool:
    """Return True if a value is known and exceeds its limit."""
    return value is not None and value > limit


def _is_unbalanced(health: Health) -> bool:
    """Return True if the energy ratio (total energy to initial energy plus external work) lies outside its limits."""
    low = health.energy_ratio_min
    high = health.energy_ratio_max
    return (
        low is not None
        and high is not None
        and (low < 1 - MOST_IMBALANCE or high > 1 + MOST_IMBALANCE)
    )


# Code, condition and text of each warning about the health of a run.
# The internal energy of an LS-DYNA model includes the energy of eroded elements (ftp.lstc.com, FAQ energy_balance).
_ALARMS: Final[Sequence[tuple[str, Callable[[Health], bool], str]]] = (
    ("hourglass", lambda h: _is_above(h.hourglass_share, MOST_HOURGLASS),
     f"hourglass energy reaches {{h.hourglass_share:.0%}} of the internal energy{{up_to}}: {_UNRELIABLE}"),
    ("part-hourglass", lambda h: _is_above(h.part_hourglass_share, MOST_HOURGLASS),
     ("hourglass energy of {h.part.name} reaches {h.part_hourglass_share:.0%} of its internal energy{up_to}: "
     f"{_UNRELIABLE}")),
    ("energy-ratio", _is_unbalanced,
     ("total energy over initial energy and external work ranges from {h.energy_ratio_min:.3g} to "
     "{h.energy_ratio_max:.3g}{up_to}: the run gains or loses energy")),
    ("negative-sliding", lambda h: _is_above(h.negative_sliding_share, MOST_NEGATIVE_SLIDING),
     "contact energy falls to -{h.negative_sliding_share:.0%} of the internal energy{up_to}: check for penetrations"),
    ("sliding", lambda h: _is_above(h.sliding_share, MOST_SLIDING),
     "contact energy reaches {h.sliding_share:.0%} of the internal energy{up_to}; check whether friction explains it"),
    ("eroded-energy", lambda h: _is_above(h.eroded_share, MOST_WORK),
     ("eroded elements contain {h.eroded_share:.0%} of the internal energy{up_to}: it is part of the "
      "internal energy of "
     "the model, but does not spring back after td")),
    ("window-not-judged", lambda h: h.window_reason is not None, "{h.window_reason}"),
    ("contact-in-window", lambda h: _is_above(h.window_sliding, MOST_WORK),
     ("contact energy of the model changes by {h.window_sliding:.0%} of the energy {where}: parts in contact do not "
     "fly freely")),
    ("work-in-window", lambda h: _is_above(h.window_work, MOST_WORK),
     ("external work beyond gravity and damping is {h.window_work:.0%} of the energy {where}: parts on which it acts "
     "do not fly freely")),
    ("erosion", lambda h: _is_above(h.window_eroded, 0.0),
     "elements are eroded {where}; rigid parts lose no elements"),
)  # fmt: skip


def _find_peak(balance: Balance) -> float | None:
    """Return the peak of the internal energy [energy]; None if it is unknown or tiny."""
    if balance.internal is None:
        return None
    highest = find_largest(
        balance.internal, balance.kinetic, balance.total, balance.external_work
    )
    peak = float(balance.internal.max())
    return peak if peak > max(_FLOOR, LAST_DIGIT * highest) else None


def _compute_share(energy: Samples | None, peak: float | None) -> float | None:
    """Return the highest value of an energy relative to the peak internal energy [-]; 0 if it is never positive."""
    if energy is None or peak is None:
        return None
    return max(0.0, float(energy.max())) / peak


def _subtract_friction(balance: Balance) -> Samples | None:
    """Return the contact energy, minus its frictional part if that part is known [energy]."""
    if balance.sliding is None or balance.friction is None:
        return balance.sliding
    return balance.sliding - balance.friction


def _find_worst_part(balance: Balance) -> dict[str, Any]:
    """Return, as fields of `Health`, the largest hourglass energy fraction of any part, and this part."""
    smallest_peak = max(
        _FLOOR,
        _SMALL_PART * max((e for _, _, e in balance.hourglass_of_parts), default=0.0),
    )
    shares = [
        (h / e, part) for part, h, e in balance.hourglass_of_parts if e > smallest_peak
    ]
    if not shares:
        return {}
    share, part = max(shares, key=lambda share_and_part: share_and_part[0])
    return {"part_hourglass_share": share, "part": part}


def _find_ratio_range(balance: Balance) -> dict[str, Any]:
    """Return, as fields of `Health`, the range of the energy ratio over the times with a sufficient reference energy.

    The ratio is that of the solver or, if the files lack it, is computed from the terms.
    """
    ratio = balance.ratio
    total = _compute_total(balance)
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


def _compute_total(balance: Balance) -> Samples | None:
    """Return the total energy from the solver, or the sum of all energies; None without internal or kinetic energy."""
    if balance.total is not None:
        return balance.total
    if balance.internal is None or balance.kinetic is None:
        return None
    further_terms = (balance.hourglass, balance.sliding, balance.damping, balance.wall)
    return np.asarray(
        balance.internal
        + balance.kinetic
        + sum(term for term in further_terms if term is not None)
    )


def _measure_window(
    balance: Balance, start: float, end: float, locked: float | None
) -> dict[str, Any]:
    """Return the changes of contact and eroded energy and the work in the window, relative to its internal energy."""
    inside = within(balance.time, start, end)
    if locked is None and balance.internal is not None:
        if balance.time[inside].size:
            locked = float(np.mean(balance.internal[inside]))
        else:
            locked = None
    if locked is None or locked <= _FLOOR:
        return {}
    fields = {}
    for name, energy in (
        ("window_sliding", balance.sliding),
        ("window_eroded", balance.eroded),
    ):
        if energy is not None and energy[inside].size:
            # The quantum is the rounding error of the energy, which follows from the number of printed digits.
            quantum = balance.precision.quantum(float(np.abs(energy[inside]).max()))
            fields[name] = max(0.0, float(np.ptp(energy[inside])) - quantum) / locked
    work = compute_work_beyond_gravity(balance, start, end)
    if work is not None:
        fields["window_work"] = work / locked
    return fields


def refuse_unsound(
    history: History,
    settings: Settings,
    td: float | tuple[float, float] | None = None,
    *,
    choosing: bool = True,
) -> None:
    """Raise RangeError if the run cannot be used at all, or if a given time seems to be in the wrong unit.

    It is also raised if the load ends outside the record according to the settings.

    If ``choosing`` is True, it is also raised if nothing deforms. The given times are ``td``, which may be a window,
    and the start and end of the flight in the settings.
    """
    for caution in list_flaws(history):
        if choosing or caution.code != "nothing-to-judge":
            raise RangeError(f"{', '.join(history.source)}: {caution.message}")
    times = {"after": settings.after, "landing": settings.landing}
    for name, time in {
        **times,
        "td_window" if isinstance(td, tuple) else "td": td,
    }.items():
        if time is not None:
            history.check_unit(
                *(time if isinstance(time, tuple) else (time,)), argument=name
            )
    if settings.after is not None:
        history.check(settings.after, argument="after")


def list_flaws(history: History) -> Iterator[Caution]:
    """Yield the reasons why a run cannot be judged, each with a stable code."""
    missing = history.missing_legs
    if missing:
        it = "it" if len(missing) == 1 else "them"
        yield Caution(
            BEGINS_LATE,
            f"the record begins at {history.start:.6g}, and the start of the run is in {list_names(missing)}; name "
            f"{it} too",
        )
    highest = find_largest(history.energy)
    if highest > LARGEST_ENERGY:
        yield Caution(
            "energy-too-large",
            f"energies up to {highest:g}, but at most {LARGEST_ENERGY:g} was expected; write them in a larger unit",
        )
        return
    reason = _describe_divergence(history)
    if reason:
        yield Caution("blew-up", reason)
    elif _has_no_energy(history):
        reason = f"nothing to judge: no internal energy exceeds {highest:.3g}, so nothing deforms; give a longer run"
        yield Caution("nothing-to-judge", reason)


def _describe_divergence(history: History) -> str | None:
    """Return a message with the time at which the energy diverges; None if it does not."""
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
    # For each state, this array contains the number of states that are earlier by more than the fraction _WITHIN.
    earlier = np.searchsorted(time, time - _WITHIN * (time[-1] - time[0]))
    counted = (
        np.concatenate([[0], np.cumsum(kinetic + internal > 0)])[earlier] >= _FEWEST
    )
    earlier_energy, deformed = (
        np.concatenate([[0.0], np.maximum.accumulate(energies)])[earlier]
        for energies in (kinetic + internal, internal)
    )
    gained = counted & (deformed > 0) & (kinetic / _GAIN > earlier_energy)
    # The factors are applied as divisors, because products of energies might overflow.
    gained &= (kinetic / _SPEED > internal) & (internal / _TORN > deformed)
    if balance.external_work is not None:
        gained &= kinetic > _GAIN * np.abs(balance.external_work)
    state = int(np.argmax(gained))
    if not gained[state]:
        return None
    return (
        f"the run is unstable: its energy grows from {earlier_energy[state]:.3g} to {kinetic[state]:.3g} "
        f"at {time[state]:.6g}; repair the model and run it again"
    )


def _has_no_energy(history: History) -> bool:
    """Return True if the internal energies of the chosen parts and of the model are all zero or negligible."""
    balance = history.balance
    if balance is None:
        return False
    highest = find_largest(history.energy, balance.internal)
    other_energies = find_largest(balance.kinetic, balance.external_work, balance.total)
    return highest == 0 or max(highest, other_energies) <= _NOTHING
