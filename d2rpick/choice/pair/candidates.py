"""Find the candidates for tr at a given td, and judge them by their accuracy and the objections to them.

All candidates are judged together, as columns; a `Candidate` is built only when it is accessed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import accumulate, pairwise
from typing import TYPE_CHECKING, Any, Final, overload

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.data_classes import dataclass
from d2rpick.base.tuples import NamedTuple, Record
from d2rpick.choice.pair.warnings import POOR_RESIDUAL, Objection, list_objections
from d2rpick.histories.digits import round_up_as_read
from d2rpick.vibration import measures
from d2rpick.vibration.measures import Measured
from d2rpick.vibration.model import NEAR_TD, find_moments, measure_all
from d2rpick.vibration.moments import Moments

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from d2rpick.choice.pair.situation import Situation
    from d2rpick.flight.position_error import Off
    from d2rpick.histories.history import Samples
    from d2rpick.vibration.measures import Columns


# Largest number of candidates that are judged in one batch; larger arrays need more memory but are not faster.
_MOST: Final = 20_000
# From one batch to the next, the number of td that are judged together grows at most by this factor [-].
_MORE: Final = 8
# A candidate gets a note if the upper bound of its residual exceeds the residual by more than this [-].
MUCH_HIGHER = 0.1
ONE_BODY = "the parts become one rigid body"
_SAME_SWING = "in the same half cycle as td, so it saves almost nothing"


class Candidate(Measured, Record):
    """One tr for the td of a situation. The fields are the keys of the JSON output; None if a value is unknown.

    Times have the unit of the history; ``level_error``, ``lock_in_error``, ``residual`` and ``rigid_fraction`` have no
    unit.  ``kind`` is "crossing" of the level, "extremum" near the level, "match" of the deformations of several modes,
    "start" of a flight in which nothing vibrates, or "given" for a pair to be verified.  ``level_ratio`` is
    E(tr)/E(td). ``admissible`` is True if tr lies in the flight, and the deformation has the same sign as at td and an
    error within the tolerance; otherwise ``notes`` lists the reasons. ``acceptable`` is True if the candidate is
    admissible and its residual is at most 0.5. ``run_time_share`` is the expected run time divided by that of the
    reference run. ``same_swing`` is True if the energy has fewer than two extrema between tr and td, so that hardly
    anything is saved. ``residual_high`` is the residual if the part of the energy that the model does not explain is a
    further mode. ``position_error`` is the distance of a body from its correct position at td [length], because
    ``position_error_part`` is frozen in a different position. For several bodies, it is the largest distance, and
    ``position_error_body`` lists the parts of this body. ``position_error_assumes`` states the assumption that is made
    if no deck defines which parts become one body. ``position_error_is_lower_bound`` is True if the error may be
    larger, because internal motion may look like rotation of the body.
    """

    rank: int
    tr: float
    kind: str
    energy: float
    level_ratio: float | None
    level_error: float | None
    rising: bool | None
    rigid_time: float
    rigid_fraction: float
    tr_low: float | None
    tr_high: float | None
    admissible: bool
    acceptable: bool
    recommended: bool
    notes: tuple[str, ...]
    run_time_share: float | None = None
    same_swing: bool = False
    position_error: float | None = None
    position_error_part: str | None = None
    position_error_body: str | None = None
    position_error_assumes: str | None = None
    position_error_is_lower_bound: bool | None = None

    @property
    def error(self) -> float:
        """The error that ranks the candidates [-]: the residual if known, otherwise the level error or infinity."""
        error = self.residual if self.residual is not None else self.level_error
        return np.inf if error is None else error


class Pair(NamedTuple):
    """A recommended pair of times (tr, td) [time].

    Pairs at different td are compared by ``error``, which is the ``residual`` if this is known; ``residual_high`` is
    the upper bound of the residual.
    """

    tr: float
    td: float
    residual: float | None
    error: float
    same_swing: bool
    residual_high: float | None = None

    @property
    def rigid_time(self) -> float:
        """Length of the rigid window [time]."""
        return self.td - self.tr


@dataclass(frozen=True, eq=False, repr=False)
class Judged:
    """Candidates for tr at one or many td of a record, judged by flight, deformation sign and tolerance.

    All columns have shape (n,); the candidates of one td are adjacent, in the order of ``situations``. ``situation_of``
    contains the index of the situation of each candidate. ``columns`` contains the fields of the candidates by name:
    their measures, ``energy``, ``level_error``, ``same_swing``, ``position_error`` and ``rigid_time``; unknown values
    are NaN.
    """

    situations: Sequence[Situation]
    situation_of: NDArray[np.int32]
    moments: Moments
    columns: Columns
    objections: tuple[Objection, ...]

    @classmethod
    def of(
        cls, situations: Sequence[Situation], moments_of_each: Sequence[Moments]
    ) -> Judged:
        """Measure and judge the ``moments`` of each situation as tr; if nothing vibrates, nothing can be measured."""
        sizes = [len(moments) for moments in moments_of_each]
        ends = [0, *accumulate(sizes)]
        if len(moments_of_each) == 1:
            # The arrays of a noisy record are large, so they must not be copied.
            moments = moments_of_each[0]
            place = np.broadcast_to(np.int32(0), sizes[0])
        else:
            moments = Moments.joined(moments_of_each)
            place = np.repeat(np.arange(len(sizes), dtype=np.int32), sizes)
        tr = moments.tr
        td = np.array([situation.td for situation in situations])
        at_rest = np.array([situation.at_rest for situation in situations])[place]
        energy_td = np.array([situation.energy_td for situation in situations])[place]
        vibrations = [situation.vibration for situation in situations]
        energy, measured = measure_all(vibrations, tr, ends)
        level_error = measures.level_error(energy, energy_td)
        if at_rest.any():
            # If nothing vibrates, the energy ratio contains only rounding errors.
            level_error[at_rest] = 0.0
            measured = {
                name: np.where(at_rest, np.nan, column)
                for name, column in measured.items()
            }
        turns = situations[0].history.turns
        turns_to_td = np.searchsorted(turns, td)[place]
        turns_to_tr = np.searchsorted(turns, tr, "right")
        position_errors = [
            situation.position_errors(tr[slice(*rows)])
            for situation, rows in zip(situations, pairwise(ends), strict=True)
        ]
        if len(position_errors) == 1:
            position_error = position_errors[0]
        else:
            position_error = np.concatenate(position_errors)
        columns = {
            **measured,
            "energy": energy,
            "level_error": level_error,
            "same_swing": (turns_to_td - turns_to_tr < 2) & ~at_rest,
            "position_error": position_error,
            "rigid_time": td[place] - tr,
        }
        problems = tuple(list_objections(situations, place, tr, columns))
        return cls(situations, place, moments, columns, problems)

    @property
    def ends(self) -> list[int]:
        """Index of the first candidate of each situation, and the number of all candidates."""
        ends: list[int] = np.searchsorted(
            self.situation_of, np.arange(len(self.situations) + 1)
        ).tolist()
        return ends

    @property
    def td(self) -> Samples:
        """The td of each candidate, shape (n,) [time]."""
        return np.array([situation.td for situation in self.situations])[
            self.situation_of
        ]

    @cached_property
    def admissible(self) -> NDArray[np.bool_]:
        """True for each candidate without objections, shape (n,); see `Candidate` for the words."""
        return np.asarray(
            ~np.logical_or.reduce([objection.holds for objection in self.objections])
        )

    @property
    def recommendable(self) -> NDArray[np.bool_]:
        """True for each candidate that ``suggest`` and ``verify`` accept: it has no objections and exceeds no limit."""
        return self.admissible & self.within_limits

    @property
    def within_limits(self) -> NDArray[np.bool_]:
        """True for each candidate that exceeds none of the limits in the settings, shape (n,)."""
        keeps = np.ones(self.situation_of.size, np.bool_)
        for limit, value in self.situations[0].settings.limits:
            is_kept = limit.is_kept_by(self.get_quantity(limit.quantity), value)
            keeps &= is_kept | (self.at_rest & limit.is_of_vibration)
        return keeps

    def get_quantity(self, name: str) -> Samples:
        """Return a quantity by name for each candidate, shape (n,): a column, or an attribute of its situation."""
        if name in self.columns:
            return self.columns[name]
        values = [getattr(situation, name) for situation in self.situations]
        return np.array(values, np.float64)[self.situation_of]

    @property
    def error(self) -> Samples:
        """Error by which the candidates are ranked (see `Candidate.error`), shape (n,) [-]."""
        residual = self.columns["residual"]
        # Candidates with a wide error band get a lower rank, because the smallest of many estimates is too optimistic.
        doubted = np.sqrt((residual**2 + self.columns["residual_high"] ** 2) / 2)
        error = np.where(
            np.isnan(residual),
            self.columns["level_error"],
            np.where(self.modal, doubted, residual),
        )
        return np.where(np.isnan(error), np.inf, error)

    @property
    def modal(self) -> NDArray[np.bool_]:
        """True for each candidate that is judged with the modal model, shape (n,)."""
        return np.array([situation.basis == "modal" for situation in self.situations])[
            self.situation_of
        ]

    @property
    def at_rest(self) -> NDArray[np.bool_]:
        """True for each candidate in a flight in which nothing vibrates, shape (n,)."""
        return np.array([situation.at_rest for situation in self.situations])[
            self.situation_of
        ]

    @property
    def near_td(self) -> NDArray[np.bool_]:
        """True for each candidate of the modal model that saves little time because it is close to td, shape (n,)."""
        starts = [_get_start_of_flight(situation) for situation in self.situations]
        flown = self.td - np.array(starts)[self.situation_of]
        return np.asarray(self.modal & (self.td - self.moments.tr < NEAR_TD * flown))

    @property
    def out_of_place(self) -> NDArray[np.bool_]:
        """True for each candidate whose position error is large enough for a warning, shape (n,)."""
        limits = [
            np.inf if situation.bodies is None else situation.bodies.limit
            for situation in self.situations
        ]
        return np.asarray(
            self.columns["position_error"] > np.array(limits)[self.situation_of]
        )

    def at(self, rows: NDArray[np.intp]) -> Judged:
        """Return the candidates in the given ``rows``, without the objections to them."""
        columns = {name: column[rows] for name, column in self.columns.items()}
        return Judged(
            self.situations, self.situation_of[rows], self.moments.at(rows), columns, ()
        )


@dataclass(frozen=True, eq=False, repr=False)
class Candidates(Sequence[Candidate]):
    """A sequence of the candidates of one td in order of rank, each of which is built when it is first accessed.

    ``order`` contains the row numbers of the candidates in ``judged``, in order of rank if ``ranked`` is True.
    ``recommended`` is the position of the recommended candidate in ``order``; None if there is none.
    """

    situation: Situation
    judged: Judged
    order: NDArray[np.intp]
    ranked: bool = False
    recommended: int | None = None

    @property
    def tr(self) -> Samples:
        """Times of the switch to rigid, in order of rank [time]."""
        return self.judged.moments.tr[self.order]

    @property
    def recommendable(self) -> NDArray[np.bool_]:
        """True for each candidate, in order of rank, that is acceptable and within the limits in the settings."""
        return self.judged.recommendable[self.order]

    @cached_property
    def chosen(self) -> Candidate | None:
        """The recommended candidate; None if no candidate is recommended."""
        return None if self.recommended is None else self[self.recommended]

    @cached_property
    def pair(self) -> Pair | None:
        """The recommended pair, which is faster to compute than the candidate; None if no pair is recommended."""
        if self.recommended is None:
            return None
        i = self.order[self.recommended]
        values = {
            name: self.judged.columns[name][i].item()
            for name in ("residual", "level_error", "same_swing", "residual_high")
        }
        residual = _replace_nan(values["residual"])
        error = values["level_error"] if residual is None else residual
        return Pair(
            self.judged.moments.tr[i].item(),
            self.situation.td,
            residual,
            error,
            values["same_swing"],
            _replace_nan(values["residual_high"]),
        )

    @property
    def saving(self) -> Pair | None:
        """The recommended pair, if it saves run time; otherwise None."""
        return None if self.pair is None or self.pair.same_swing else self.pair

    def __len__(self) -> int:
        return self.order.size

    @overload
    def __getitem__(self, place: int) -> Candidate: ...
    @overload
    def __getitem__(self, place: slice) -> tuple[Candidate, ...]: ...
    def __getitem__(self, place: int | slice) -> Candidate | tuple[Candidate, ...]:
        """Build the candidate at a position in the ranking, or the candidates of a slice."""
        if not isinstance(place, slice):
            i = range(len(self))[place]
            return self[i : i + 1][0]
        # The accuracy of tr takes longer to compute than the choice, so it is computed only on access.
        reach = self.situation.vibration.reach(
            _mark_given_as_matches(
                self.situation, self.judged.moments.at(self.order[place])
            )
        )
        return tuple(map(self._candidate, range(len(self))[place], reach.tolist()))

    def __iter__(self) -> Iterator[Candidate]:
        return iter(self[:])

    def list_objections(self, rank: int, *, of_error: bool = True) -> tuple[str, ...]:
        """Return why a candidate is not admissible. If ``of_error`` is False, a large error is not mentioned."""
        return tuple(
            self._describe_objections(int(self.order[rank]), of_error=of_error)
        )

    def _describe_objections(self, row: int, *, of_error: bool = True) -> Iterator[str]:
        """Yield the objections to the candidate in a row of ``judged``."""
        for objection in self.judged.objections:
            if objection.holds[row] and (of_error or not objection.is_of_error):
                yield from objection.describe(row)

    def _candidate(self, rank: int, reach: float) -> Candidate:
        i = int(self.order[rank])
        situation = self.situation
        judged = self.judged
        tr, kind, rising = judged.moments[i]
        values: dict[str, Any] = {
            name: _replace_nan(column[i].item())
            for name, column in judged.columns.items()
        }
        # The sign match is None if the deformations at tr and td were not compared.
        is_compared = values["sign_match"] is not None
        values["sign_match"] = values["sign_match"] > 0 if is_compared else None
        history = situation.history
        td = situation.td
        if values["position_error"] is not None and situation.bodies:
            values |= _describe_position(situation.bodies.worst(tr, td))
        rigid_fraction = (td - tr) / history.duration
        notes = [*self._describe_objections(i)]
        admissible = not notes
        residual = values["residual"]
        is_kept = residual is None or residual <= POOR_RESIDUAL
        if values["same_swing"]:
            notes.append(_SAME_SWING)
        measured = values if is_compared else {}
        notes += _list_remarks(situation, reach, measured, notes)
        level_ratio = None
        if situation.energy_td > 0 and not situation.at_rest:
            level_ratio = values["energy"] / situation.energy_td
        return Candidate(
            rank=(rank + 1) * self.ranked,
            tr=tr,
            kind=kind,
            level_ratio=level_ratio,
            rising=rising,
            rigid_fraction=rigid_fraction,
            tr_low=tr - reach,
            tr_high=tr + reach,
            admissible=admissible,
            acceptable=admissible and is_kept,
            recommended=rank == self.recommended,
            notes=tuple(notes),
            run_time_share=situation.settings.run_time_share(rigid_fraction),
            **values,
        )


def _get_start_of_flight(situation: Situation) -> float:
    """Return the earliest tr in the flight [time]; minus infinity if the earliest tr is unknown."""
    return -np.inf if situation.earliest_tr is None else situation.earliest_tr


def _replace_nan(value: Any) -> Any:
    """Return the value of a column, or None if the value is NaN."""
    return None if value != value else value


def judge_candidates(
    situations: Sequence[Situation], *, in_flight: bool = False, most: int = _MOST
) -> Iterator[Judged]:
    """Judge all candidates before td in time order: level crossings, energy extrema near the level, closest matches.

    If nothing vibrates in the flight, its start is the only candidate. If ``in_flight`` is True, candidates before the
    flight may be omitted, because none of them is acceptable and a noisy long record has tens of thousands of them. All
    situations must have the same record and settings. Several td are judged in one batch of up to ``most`` candidates.
    """
    first, together = 0, 1
    while first < len(situations):
        batch = situations[first : first + together]
        starts = [-np.inf] * len(batch)
        if in_flight:
            starts = [_get_start_of_flight(situation) for situation in batch]
        moments_of_each = find_moments(
            [situation.vibration for situation in batch],
            batch[0].settings.tolerance,
            starts,
        )
        distinct = [
            _find_start_at_rest(situation) or _select_distinct(situation, moments)
            for situation, moments in zip(batch, moments_of_each, strict=True)
        ]
        yield Judged.of(batch, distinct)
        first += together
        together = max(1, min(_MORE * together, most // max(1, *map(len, distinct))))


def judge_times(situation: Situation, times: Iterable[float]) -> Candidates:
    """Judge each of the ``times`` before td as tr, by flight, deformation sign and tolerance."""
    judged = Judged.of([situation], [Moments.of("given", [*times])])
    return Candidates(situation, judged, np.arange(judged.situation_of.size))


def _find_start_at_rest(situation: Situation) -> Moments | None:
    """Return the start of a flight in which nothing vibrates, rounded up to printed digits; otherwise None."""
    start = situation.earliest_tr
    if start is None or not situation.at_rest:
        return None
    first = max(start, situation.history.start)
    printed = round_up_as_read(first)
    return Moments.of("start", [printed if printed < situation.td else first])


def _mark_given_as_matches(situation: Situation, moments: Moments) -> Moments:
    """Set the kind of a given tr to "match" if it coincides with a closest match, because it is just as accurate."""
    is_given = moments.are("given")
    vibration = situation.vibration
    if situation.at_rest or not (is_given.any() and vibration.profile):
        return moments
    matches = _select_distinct(
        situation, vibration.moments(situation.settings.tolerance)
    )
    if not matches.are("match").any():
        return moments
    nearest = matches.at(
        np.array([np.abs(matches.tr - tr).argmin() for tr in moments.tr])
    )
    same = is_given & (np.abs(nearest.tr - moments.tr) <= vibration.reach(nearest))
    return Moments(
        moments.tr, np.where(same, nearest.kind, moments.kind), moments.rising
    )


def _select_distinct(situation: Situation, moments: Moments) -> Moments:
    """Return the moments in time order, without closest matches next to a crossing or an extremum."""
    matches = moments.are("match")
    if matches.any() and not matches.all():
        is_distinct = ~matches
        of_level = moments.tr[~matches]
        for row in np.flatnonzero(matches).tolist():
            is_distinct[row] = np.all(
                np.abs(of_level - moments.tr[row]) > situation.history.step
            )
        moments = moments.at(is_distinct)
    if np.all(moments.tr[1:] >= moments.tr[:-1]):
        return moments
    return moments.at(np.argsort(moments.tr, kind="stable"))


def _list_remarks(
    situation: Situation,
    reach: float,
    measured: Mapping[str, Any],
    objections: Sequence[str],
) -> Iterator[str]:
    """Yield notes on a tr that do not make it unacceptable, in addition to the objections."""
    undescribed = situation.vibration.undescribed
    if not (measured or situation.vibration.unknown or situation.at_rest):
        why = "" if undescribed in objections else f": {undescribed}"
        yield f"direction, frozen-deformation error and residual unknown{why}"
    if measured and measured["residual_high"] > measured["residual"] + MUCH_HIGHER:
        yield f"residual up to {measured['residual_high']:.2g} if the record hides a further mode"
    if measured and reach > measured["timing_tolerance"]:
        tolerance = measured["timing_tolerance"]
        yield f"tr is known only to ±{reach:.2g}, which is more than its timing tolerance of ±{tolerance:.2g}"
    if not (measured or situation.at_rest) and reach >= situation.history.step:
        yield "the level is within the sampling error of an extremum"


def _describe_position(worst: Off | None) -> dict[str, Any]:
    """Return the fields of a candidate that describe the largest position error; empty if it is unknown."""
    if worst is None:
        return {}
    return {
        "position_error": worst.error,
        "position_error_part": worst.part,
        "position_error_body": worst.body.name if worst.body and worst.part else None,
        "position_error_assumes": ONE_BODY if worst.assumed else None,
        "position_error_is_lower_bound": worst.at_least,
    }
