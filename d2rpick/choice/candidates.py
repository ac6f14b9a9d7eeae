"""Candidates for tr at a given td: where they are, how far they can be trusted, what speaks against them.

They are judged as columns; a `Candidate` is made only where one is looked at.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final, NamedTuple, overload

import numpy as np

from d2rpick.choice.expectation import Objection, objections
from d2rpick.histories.digits import not_before
from d2rpick.vibration import measures
from d2rpick.vibration.measures import Measured
from d2rpick.vibration.model import measured_of, moments_of
from d2rpick.vibration.moments import Moments

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from d2rpick.choice.situation import Situation
    from d2rpick.flight.bodies import Off
    from d2rpick.histories.history import Samples
    from d2rpick.vibration.part_signs import PartMatch


# Candidates that are looked at together, at most: arrays of more are no faster, and noise makes tens of thousands a td.
_MOST: Final = 20_000
# A residual that may be so much higher is worth a note.
MUCH_HIGHER = 0.1
ONE_BODY = "the parts become one rigid body"
_SAME_SWING = ("on the same swing of the energy as td, which saves hardly anything",)


class Candidate(NamedTuple):
    """One tr for the td of a situation; fields are the keys of the JSON output, None where nothing can be said.

    Times in the unit of the history; ``level_error``, ``lock_in_error``, ``residual`` and ``rigid_fraction``
    without unit.  ``kind``: "crossing" of the level, "extremum" near it, or "match" where the deformations of several
    parts or modes come closest, "start" of a flight in which nothing vibrates ("given" for a pair to be verified).
    ``acceptable``: in the flight, same sign, error within tolerance; else ``notes`` say why not.  ``run_time_share``:
    expected run time over that of the reference.  ``same_swing``: the energy turns less than twice from tr to td, so
    that hardly anything is saved.  ``residual_high``: how large the residual may be if what the model leaves over
    is a further mode.  ``parts``: what each part has of the mismatch, empty where single parts are not known.
    ``position_error``: how far a body is out of place at td [length], because ``position_error_part`` is frozen
    elsewhere; of several bodies the largest, ``position_error_body`` has the parts of that one.
    ``position_error_assumes`` says what is taken for granted where no deck tells which parts become one body;
    ``position_error_is_lower_bound``: it may be further off, by inner motion that passes for the rotation of the body.
    """

    rank: int
    tr: float
    kind: str
    energy: float
    energy_ratio: float | None
    level_error: float | None
    rising: bool | None
    rigid_time: float
    rigid_fraction: float
    tr_low: float | None
    tr_high: float | None
    acceptable: bool
    recommended: bool
    notes: tuple[str, ...]
    sign_match: bool | None = None
    lock_in_error: float | None = None
    residual: float | None = None
    residual_high: float | None = None
    timing_tolerance: float | None = None
    part_mismatch: float | None = None
    run_time_share: float | None = None
    same_swing: bool = False
    parts: tuple[PartMatch, ...] = ()
    position_error: float | None = None
    position_error_part: str | None = None
    position_error_body: str | None = None
    position_error_assumes: str | None = None
    position_error_is_lower_bound: bool | None = None

    @property
    def error(self) -> float:
        """What the order goes by: the residual, on basis "energy" the level error; infinite when unknown."""
        error = self.residual if self.residual is not None else self.level_error
        return np.inf if error is None else error


class Best(NamedTuple):
    """A recommended pair [time], and what it is compared with those of other td by; as of a `Candidate`."""

    tr: float
    td: float
    residual: float | None
    error: float
    same_swing: bool

    @property
    def rigid_time(self) -> float:
        """Length of the rigid window [time]."""
        return self.td - self.tr


@dataclass(frozen=True, eq=False, repr=False)
class Candidates(Sequence[Candidate]):
    """Candidates of one td in some order, made where they are looked at, of columns of what decides.

    All columns are of shape (n,), in the order of time: ``energy`` [energy]; ``level_error`` [-], NaN where an energy
    is not positive; ``same_swing``; ``position_error`` [length], NaN where unknown; ``moments`` and ``known``, as the
    vibration gave them.
    ``order`` has the places in these of the candidates in their order, that of the ranks where it is ``ranked``;
    ``recommended`` is the place in it of the one that is.
    """

    situation: Situation
    moments: Moments
    known: Measured
    energy: Samples
    level_error: Samples
    same_swing: NDArray[np.bool_]
    position_error: Samples
    objections: tuple[Objection, ...]
    order: NDArray[np.intp]
    ranked: bool = False
    recommended: int | None = None

    @classmethod
    def of(cls, situation: Situation, moments: Moments, known: Measured) -> Candidates:
        """Hold each tr, of which is ``known`` what was measured, against flight, sign and tolerance.

        Where nothing vibrates, no measure counts.
        """
        vibration, still = situation.vibration, situation.at_rest
        tr, known = moments.tr, Measured.spread(np.zeros(len(moments), dtype=bool)) if still else known
        energy = vibration.whole.energies(tr)
        # beside nothing that vibrates the ratio of two rests of round-off is no error
        level_error = np.zeros(tr.shape) if still else measures.level_error(energy, situation.energy_td)
        return cls(
            situation=situation,
            moments=moments,
            known=known,
            energy=energy,
            level_error=level_error,
            same_swing=(situation.turns_since(tr) < 2) & (not still),
            position_error=situation.position_errors(tr),
            objections=tuple(objections(situation, tr, known, energy, level_error)),
            order=np.arange(tr.size),
        )

    @property
    def tr(self) -> Samples:
        """Times of the switch to rigid [time]."""
        return self.moments.tr

    @cached_property
    def acceptable(self) -> NDArray[np.bool_]:
        """Which of them nothing speaks against."""
        return np.asarray(~np.logical_or.reduce([one.holds for one in self.objections]))

    @property
    def kept(self) -> NDArray[np.bool_]:
        """Which of them are acceptable and keep the limits asked for: the rule of ``suggest`` and ``verify``."""
        share, settings, found = self.situation.kinetic_share, self.situation.settings, self.acceptable
        if settings.max_kinetic_share is not None:
            found = found & (share is not None and share <= settings.max_kinetic_share)
        if settings.max_residual is not None:
            found = found & (self.known.residual <= settings.max_residual)  # not where unknown, NaN
        return found

    @property
    def error(self) -> Samples:
        """What the order goes by, as ``Candidate.error`` [-]."""
        error = np.where(np.isnan(self.known.residual), self.level_error, self.known.residual)
        return np.where(np.isnan(error), np.inf, error)

    @cached_property
    def chosen(self) -> Candidate | None:
        """The one that is recommended."""
        return None if self.recommended is None else self[self.recommended]

    @property
    def best(self) -> Best | None:
        """What the one that is recommended is compared by."""
        if self.recommended is None:
            return None
        i, td = self.order[self.recommended], self.situation.td
        tr, residual, error, same_swing = (
            column[i].item() for column in (self.tr, self.known.residual, self.error, self.same_swing)
        )
        return Best(tr, td, None if np.isnan(residual) else residual, error, same_swing)

    def without_rest(self) -> Candidates:
        """Keep of those in order no more than up to the one that is recommended: of many td they are many together."""
        kept = self.order[: 0 if self.recommended is None else self.recommended + 1]
        return replace(
            self,
            moments=self.moments.at(kept),
            known=Measured(*(column[kept] for column in self.known)),
            energy=self.energy[kept],
            level_error=self.level_error[kept],
            same_swing=self.same_swing[kept],
            position_error=self.position_error[kept],
            objections=(),
            order=np.arange(kept.size),
        )

    @property
    def out_of_place(self) -> NDArray[np.bool_]:
        """Which of them leave a body so far out of place that it is worth a warning."""
        bodies = self.situation.bodies
        if bodies is None:
            return np.zeros(len(self), dtype=bool)
        return np.asarray(self.position_error > bodies.limit)

    def __len__(self) -> int:
        return len(self.moments)

    @overload
    def __getitem__(self, place: int) -> Candidate: ...
    @overload
    def __getitem__(self, place: slice) -> tuple[Candidate, ...]: ...
    def __getitem__(self, place: int | slice) -> Candidate | tuple[Candidate, ...]:
        """Make the candidate, or the candidates, at some place."""
        if not isinstance(place, slice):
            i = range(len(self))[place]
            return self[i : i + 1][0]
        # how far the true time may lie away is asked of these only: of all it takes longer than the choice
        reach = self.situation.vibration.reach(_as_found(self.situation, self.moments.at(self.order[place])))
        return tuple(map(self._candidate, range(len(self))[place], reach.tolist()))

    def __iter__(self) -> Iterator[Candidate]:
        return iter(self[:])

    def _candidate(self, rank: int, reach: float) -> Candidate:
        i = int(self.order[rank])
        situation, known, (tr, kind, rising) = self.situation, self.known.of(i), self.moments[i]
        history, td = situation.history, situation.td
        energy, level, same_swing, off = (
            column[i].item() for column in (self.energy, self.level_error, self.same_swing, self.position_error)
        )
        worst = None if np.isnan(off) or situation.bodies is None else situation.bodies.worst(tr, td)
        rigid_fraction = (td - tr) / float(history.time[-1] - history.time[0])
        parts = situation.vibration.part_matches(tr) if known else ()
        against = tuple(one.sentence(i) for one in self.objections if one.holds[i])
        return Candidate(
            rank=(rank + 1) * self.ranked,
            tr=tr,
            kind=kind,
            energy=energy,
            energy_ratio=energy / situation.energy_td if situation.energy_td > 0 and not situation.at_rest else None,
            level_error=None if np.isnan(level) else level,
            rising=rising,
            rigid_time=td - tr,
            rigid_fraction=rigid_fraction,
            tr_low=tr - reach,
            tr_high=tr + reach,
            acceptable=not against,
            recommended=rank == self.recommended,
            notes=(*against, *_SAME_SWING * same_swing, *_remarks(situation, reach, known, parts)),
            run_time_share=situation.settings.run_time_share(rigid_fraction),
            same_swing=same_swing,
            parts=parts,
            **known,
            **_position(worst),
        )


def find_candidates(situation: Situation, *, in_flight: bool = False) -> Candidates:
    """All crossings of the level before td, extrema near enough to it, and closest matches, judged, in time order.

    Where nothing vibrates in the flight, its start alone.  With ``in_flight`` those before the flight, of which none is
    acceptable, may be left out: noise in a long record makes tens of thousands.
    """
    return next(candidates_of([situation], in_flight=in_flight))


def candidates_of(
    situations: Sequence[Situation], *, in_flight: bool = False, most: int = _MOST
) -> Iterator[Candidates]:
    """The same of many td of one record, by one set of rules: at once so many td as have ``most`` candidates."""
    first, together = 0, 1
    while first < len(situations):
        found = _found_together(situations[first : first + together], in_flight=in_flight)
        yield from found
        first, together = first + together, max(1, most // max(1, *map(len, found)))


def _found_together(situations: Sequence[Situation], *, in_flight: bool) -> list[Candidates]:
    vibrations = [one.vibration for one in situations]
    starts = [one.earliest_tr if in_flight and one.earliest_tr is not None else -np.inf for one in situations]
    found = moments_of(vibrations, situations[0].settings.tolerance, starts)
    kept = [_at_start(one) or _distinct(one, moments) for one, moments in zip(situations, found, strict=True)]
    known = measured_of(vibrations, [moments.tr for moments in kept])
    return [Candidates.of(*row) for row in zip(situations, kept, known, strict=True)]


def judge(situation: Situation, times: Iterable[float]) -> Candidates:
    """Measure each of the ``times`` before td as tr, and hold it against flight, sign and tolerance."""
    moments = Moments.of("given", [*times])
    return Candidates.of(situation, moments, situation.vibration.measured(moments.tr))


def _at_start(situation: Situation) -> Moments | None:
    """Where nothing vibrates in the flight, its start, not before it as it is read; else nothing."""
    start = situation.earliest_tr
    if start is None or not situation.at_rest:
        return None
    first = max(start, float(situation.history.time[0]))
    read = not_before(first)
    return Moments.of("start", [read if read < situation.td else first])


def _as_found(situation: Situation, moments: Moments) -> Moments:
    """Call each given tr a match where one would be found: it is known as well as that one, whoever names it."""
    given, vibration = moments.are("given"), situation.vibration
    if situation.at_rest or not (given.any() and vibration.profile):
        return moments
    found = _distinct(situation, vibration.moments(situation.settings.tolerance))
    if not found.are("match").any():
        return moments
    nearest = found.at(np.array([np.abs(found.tr - tr).argmin() for tr in moments.tr]))
    same = given & (np.abs(nearest.tr - moments.tr) <= vibration.reach(nearest))
    return Moments(moments.tr, np.where(same, nearest.kind, moments.kind), moments.rising)


def _distinct(situation: Situation, found: Moments) -> Moments:
    """Give the moments in time order, without the matches that lie next to a crossing or an extremum."""
    matches = found.are("match")
    if matches.any():
        kept, of_level = ~matches, found.tr[~matches]
        for place in np.flatnonzero(matches).tolist():
            kept[place] = np.all(np.abs(of_level - found.tr[place]) > situation.history.step)
        found = found.at(kept)
    return found if np.all(found.tr[1:] >= found.tr[:-1]) else found.at(np.argsort(found.tr, kind="stable"))


def _remarks(situation: Situation, reach: float, known: Mapping[str, Any], parts: Sequence[PartMatch]) -> Iterator[str]:
    """What to know of this tr beside its acceptance."""
    if not (known or situation.vibration.unknown or situation.at_rest):
        yield f"sign, lock-in error and residual unknown: {situation.vibration.undescribed}"
    if known and known["lock_in_error"] > measures.TOLERATED_GROWTH and parts:
        from d2rpick.vibration.part_signs import main_contributors  # not above: a table has no parts

        yield f"mismatch of {main_contributors(parts)}"
    if known and known["residual_high"] > known["residual"] + MUCH_HIGHER:
        yield f"residual up to {known['residual_high']:.2g} if the record hides a further mode"
    if known and reach > known["timing_tolerance"]:
        yield f"tr is known only to ±{reach:.2g}, its timing tolerance is {known['timing_tolerance']:.2g}"
    if not known and reach >= situation.history.step:
        yield "the level lies within the sampling error of an extremum"


def _position(worst: Off | None) -> dict[str, Any]:
    """How far the body is off that is off most; nothing where that is not known."""
    if worst is None:
        return {}
    return {
        "position_error": worst.error,
        "position_error_part": worst.part,
        "position_error_body": worst.body.name if worst.body and worst.part else None,
        "position_error_assumes": ONE_BODY if worst.assumed else None,
        "position_error_is_lower_bound": worst.at_least,
    }
