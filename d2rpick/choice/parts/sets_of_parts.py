"""Compare sets of parts: the saving and the position error of each set, and which set to make rigid."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.data_classes import dataclass
from d2rpick.base.errors import (
    Caution,
    FormatError,
    RangeError,
    choose_verb,
    name_units,
)
from d2rpick.choice.answers import suggest_in_run, verify_run
from d2rpick.choice.pair.candidates import ONE_BODY
from d2rpick.choice.pair.grades import POOR
from d2rpick.choice.pair.warnings import warn_about_place
from d2rpick.choice.parts.deck_of_run import (
    add_surroundings,
    check_model_of_deck,
    find_rigid_bodies,
    warn_about_bodies,
    warn_about_cost,
    warn_about_left_rigid,
    warn_about_solver,
    warn_about_titles,
)
from d2rpick.choice.parts.switchable_parts import (
    KEEP,
    PartRow,
    RunFacts,
    collect_facts,
    compute_step_growth,
    judge_parts,
)
from d2rpick.choice.question import Reference
from d2rpick.deck.geometry import Placement
from d2rpick.flight.momentum import replace_words_by_part_ids
from d2rpick.histories.listings import find_printed_steps
from d2rpick.histories.names import Part, Selection, has_recommended, select_parts
from d2rpick.vibration.measures import run_time_share

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.base.spans import Times
    from d2rpick.choice.pair.decision import Decision
    from d2rpick.choice.pair.situation import Situation
    from d2rpick.choice.parts.cost import CostModel, Share, Weights
    from d2rpick.choice.question import Settings
    from d2rpick.deck.model import Inventory
    from d2rpick.histories.history import History
    from d2rpick.histories.run import OpenedRun

# Savings that differ by at most this are treated as equal [-], because the cost model is accurate to a few percent.
_LIKE: Final = 0.01
# Smallest fraction of the mass of all switchable parts that the set "heavy" contains [-].
_HEAVY: Final = 0.5
_ALL, _STILL = "all that may", "all but what moves"
_NO_ANGLE: Final = "the part momenta do not show how a body of these parts rotates, so the rotation error is unknown"


class PartSet(NamedTuple):
    """A set of parts with its saving and errors. Unknown values are None, with the cause in ``reasons``.

    ``bodies`` are the rigid bodies that the parts become, and ``cost_share`` is the fraction of the cost of a time step
    that they save [-]. ``step_growth`` is the factor by which the time step may grow while they are rigid [-], infinite
    if no deformable part limits it; predictions use the factor of the settings instead. ``window`` is (tr, td) in the
    longest flight [time], and ``rigid_fraction`` its fraction of the record [-]. ``angle_error`` is the rotation error
    of a body at td [degrees]; if ``position_is_lower_bound`` is True, this error and the position error may be larger.
    ``moving`` contains the parts that move relative to the others; ``apart`` is True if some of them separate from the
    body to which they are to belong. ``decision`` is the verdict on the window in ``situation``, and ``cost_reason``
    the reason why the saving is unknown.
    """

    name: str
    parts: tuple[int, ...]
    bodies: tuple[tuple[int, ...], ...] = ()
    elements: int | None = None
    element_fraction: float | None = None
    mass_fraction: float | None = None
    cost_share: float | None = None
    step_growth: float | None = None
    window: Times | None = None
    rigid_fraction: float | None = None
    run_time_share: float | None = None
    position_error: float | None = None
    position_limit: float | None = None
    position_part: Part | None = None
    position_body: tuple[int, ...] | None = None
    position_assumes: str | None = None
    angle_error: float | None = None
    position_is_lower_bound: bool | None = None
    moving: frozenset[int] = frozenset()
    apart: bool = False
    reasons: tuple[str, ...] = ()
    recommended: bool = False
    decision: Decision | None = None
    situation: Situation | None = None
    cost_reason: str | None = None

    @property
    def rigid_share_of_elements(self) -> float:
        """Elements that are rigid, times the fraction of the run for which they are [-]; 0 if either is unknown."""
        return (self.element_fraction or 0.0) * (self.rigid_fraction or 0.0)

    @property
    def saving(self) -> float | None:
        """Fraction of the run time that is saved [-]; None if it is unknown."""
        return None if self.run_time_share is None else 1 - self.run_time_share

    @property
    def is_usable(self) -> bool:
        """True if the grade of the set's pair is not "poor"."""
        return self.decision is None or self.decision.grade != POOR

    @property
    def out_of_place(self) -> bool:
        """True if the position error exceeds its limit, or if a part separates from its body."""
        error = self.position_error
        limit = self.position_limit
        return self.apart or (error is not None and limit is not None and error > limit)


@dataclass(frozen=True)
class Parts:
    """The answer of ``parts``: all parts, sets of parts, and warnings.

    ``inventory`` is None if there is no deck.
    """

    files: OpenedRun
    inventory: Inventory | None
    weights: Weights | None
    settings: Settings
    facts: RunFacts
    rows: tuple[PartRow, ...]
    sets: tuple[PartSet, ...]
    cautions: tuple[Caution, ...]

    @property
    def recommended(self) -> PartSet | None:
        """The recommended set; None if no set is recommended."""
        return next((part_set for part_set in self.sets if part_set.recommended), None)


def compare_sets_of_parts(
    run: OpenedRun,
    settings: Settings,
    model: CostModel | None,
    *,
    given_ids: Sequence[int] = (),
    times: Times | float | None = None,
    deck_files: Sequence[str] = (),
) -> Parts:
    """Judge every part of a run, and compare sets of parts.

    Parameters
    ----------
    run : Run
        The reference run.
    settings : Settings
        Settings as for ``suggest``; their cost share is not used.
    model : CostModel or None
        The deck with its costs; if it is missing, the costs and most verdicts stay unknown.
    given_ids : sequence of int
        Part ids of a further set to compare.
    times : (float, float) or float, optional
        tr and td of the comparison, or only td [time]. By default, td is at the end of the longest flight, and each set
        has the tr that ``suggest`` recommends.
    deck_files : sequence of str
        Files of the deck; a d3hsp file in the same folder contains the smallest time steps of the parts.

    Returns
    -------
    Parts
    """
    foreign = check_model_of_deck(run, model.inventory) if model else None
    model = None if foreign else model
    run = add_surroundings(run, model.inventory if model else None)
    facts = collect_facts(run, settings)
    rows = judge_parts(
        facts, model, find_printed_steps(run, *(deck_files if model else ()))
    )
    comparison = _SetComparison(run, settings, model, rows)
    sets: list[PartSet] = []
    listed_sets = [*_list_sets(rows, given_ids)]
    if times is not None and listed_sets:
        _check_times(comparison.open_reference(listed_sets[0]).history, times)
    for part_set in listed_sets:
        # All sets get the same td so that they can be compared.
        td = next((earlier.window[1] for earlier in sets if earlier.window), None)
        sets.append(comparison.of(part_set, times or td))
        if part_set.name == _ALL:
            still_parts = tuple(
                part for part in part_set.parts if part not in sets[-1].moving
            )
        else:
            still_parts = ()
        # Parts at rest relative to the body may fly longer than parts that move relative to it.
        if still_parts and sets[-1].moving:
            sets.append(comparison.of(PartSet(_STILL, still_parts), times))
    recommended_sets = tuple(
        _mark_recommended(
            _drop_repeated_sets(sets),
            has_all_elements=model is not None and model.inventory.complete,
        )
    )
    cautions = (
        *((foreign,) if foreign else ()),
        *_warn_about_sets(run, facts, model, rows, recommended_sets),
    )
    inventory, weights = (model.inventory, model.weights) if model else (None, None)
    return Parts(
        run, inventory, weights, settings, facts, rows, recommended_sets, cautions
    )


def find_given_parts(run: OpenedRun, names: Sequence[str]) -> tuple[int, ...]:
    """Return the part ids of an additional set to compare.

    Raises
    ------
    FormatError
        If the run has no such parts, or the recommended set is requested.
    """
    if not names:
        return ()
    if has_recommended(names, run.parts):
        cure = "name a set to compare, by numbers or titles of parts, 'flying' or 'all'"
        raise FormatError(
            f"{run.name}: d2rpick parts itself finds the recommended set; {cure}"
        )
    numbers = replace_words_by_part_ids(run, Selection(parts=tuple(names))).parts
    return tuple(part.id for part in select_parts(numbers, run.parts, run.name))


def recommend_parts(
    run: OpenedRun, settings: Settings, model: CostModel
) -> tuple[int, ...]:
    """Return the ids of the parts in the recommended set.

    Raises
    ------
    FormatError
        If no set can be recommended.
    """
    answer = compare_sets_of_parts(run, settings, model)
    if answer.recommended is None:
        if answer.facts.reason:
            raise FormatError(answer.facts.reason)
        reasons = [
            caution.message
            for caution in answer.cautions
            if caution.code == "parts-not-in-deck"
        ]
        for part_set in answer.sets:
            reasons += part_set.reasons
        why = "; ".join(dict.fromkeys(reasons)) or "no part may be switched"
        raise FormatError(
            f"{run.name}: no set of parts can be recommended ({why}); see the reasons with d2rpick parts, or name the "
            "parts by their ids"
        )
    return answer.recommended.parts


def _drop_repeated_sets(sets: Sequence[PartSet]) -> list[PartSet]:
    """Drop each set that has the same parts as an earlier set with another name."""
    return [
        part_set
        for at, part_set in enumerate(sets)
        if part_set.parts not in [earlier.parts for earlier in sets[:at]]
    ]


def _list_sets(rows: Sequence[PartRow], given_ids: Sequence[int]) -> Iterator[PartSet]:
    """Yield the sets that are worth comparing."""
    movable = [row for row in rows if row.movable]
    stopped = [row for row in movable if row.flight and row.flight.deforms is False]
    rows_by_name = {
        _ALL: movable,
        "stopped deforming": stopped,
        "heavy": _select_heavy(movable),
        "given": [row for row in rows if row.id in given_ids],
    }
    yield from (
        PartSet(name, tuple(row.id for row in members))
        for name, members in rows_by_name.items()
        if members
    )


def _select_heavy(movable: Sequence[PartRow]) -> list[PartRow]:
    """Return the heaviest parts that together have half of the mass; empty if a mass is unknown."""
    masses = {row.id: row.mass for row in movable if row.mass is not None}
    if len(masses) < len(movable):
        return []
    total = sum(masses.values())
    taken = 0.0
    heaviest = set[int]()
    for part in sorted(masses, key=lambda part: -masses[part]):
        if taken >= _HEAVY * total:
            break
        heaviest.add(part)
        taken += masses[part]
    return [row for row in movable if row.id in heaviest]


@dataclass(frozen=True)
class _SetComparison:
    """The run, settings, costs and parts on which the comparison of all sets is based."""

    run: OpenedRun
    settings: Settings
    model: CostModel | None
    rows: Sequence[PartRow]

    @cached_property
    def placement(self) -> Placement | None:
        """Positions of the parts according to the deck; None if there is no deck."""
        return Placement(self.model.inventory) if self.model else None

    def of(self, part_set: PartSet, times: Times | float | None) -> PartSet:
        """Complete a set with its costs and errors, for a given (tr, td) or td (default: the best td of the set)."""
        reasons = list[str | None]()
        if self.model:
            share = self.model.saved(part_set.parts)
            reasons.append(share.reason)
            part_set = self._with_cost(part_set, self.model.inventory, share)
        try:
            part_set = self._with_window(part_set, times)
        except (FormatError, RangeError) as error:
            reasons.append(str(error))
        if part_set.rigid_fraction is not None and part_set.cost_share is not None:
            run_time = run_time_share(
                part_set.rigid_fraction, part_set.cost_share, self.settings.step_ratio
            )
            part_set = part_set._replace(run_time_share=run_time)
        return part_set._replace(
            reasons=tuple(reason for reason in (*reasons, *part_set.reasons) if reason)
        )

    def _with_cost(
        self, part_set: PartSet, inventory: Inventory, share: Share
    ) -> PartSet:
        """Add the rigid bodies, the costs, and the growth of the time step to a set of parts."""
        rigid_elements = {
            part: counts.total()
            for part, counts in inventory.elements_within(part_set.parts).items()
        }
        whole = {part: counts.total() for part, counts in inventory.counts.items()}
        rigid = {part for part, count in rigid_elements.items() if count == whole[part]}
        elements = sum(rigid_elements.values())
        element_fraction = None
        if whole:
            element_fraction = elements / sum(whole.values())
        return part_set._replace(
            bodies=inventory.bodies(part_set.parts),
            moving=self._loose(inventory, part_set.parts),
            elements=elements,
            element_fraction=element_fraction,
            mass_fraction=self._mass_fraction(part_set.parts),
            cost_share=share.value,
            cost_reason=share.reason,
            step_growth=compute_step_growth(self.rows, {*part_set.parts, *rigid}),
        )

    def _mass_fraction(self, parts: Sequence[int]) -> float | None:
        """Return the mass of the parts as a fraction of the mass of all flying parts [-]; None if a mass is unknown."""
        masses = {
            row.id: row.mass for row in self.rows if row.flight and row.flight.flies
        }
        known_masses = {part: mass for part, mass in masses.items() if mass is not None}
        if (
            len(known_masses) < len(masses)
            or not set(parts) <= known_masses.keys()
            or not sum(known_masses.values())
        ):
            return None
        return sum(known_masses[part] for part in parts) / sum(known_masses.values())

    def _loose(self, inventory: Inventory, parts: Sequence[int]) -> frozenset[int]:
        """Return the parts outside the heaviest rigid body; empty if ties may join the bodies."""
        masses = {row.id: row.mass or 0.0 for row in self.rows}
        main = max(
            inventory.bodies(parts),
            key=lambda body: sum(masses.get(part, 0.0) for part in body),
            default=(),
        )
        return frozenset() if inventory.ties else frozenset(parts) - {*main}

    def open_reference(self, part_set: PartSet) -> Reference:
        """Return the reference run of a set of parts."""
        return Reference.of(self.run, Selection(parts=tuple(map(str, part_set.parts))))

    def _with_window(self, part_set: PartSet, times: Times | float | None) -> PartSet:
        """Add the window during which the parts of a set may be rigid.

        Raises
        ------
        RangeError
            If no tr can be recommended, with the reason.
        """
        reference = self.open_reference(part_set)
        bodies = (
            find_rigid_bodies(self.model.inventory, part_set.parts)
            if self.model
            else None
        )
        settings = replace(
            self.settings,
            bodies=bodies,
            placement=self.placement,
            kept_deformable=tuple(row.id for row in self.rows if row.verdict == KEEP),
        )
        if isinstance(times, tuple):
            verdict = verify_run(reference, *times, settings)
            situation = verdict.situation
            decision: Decision | None = verdict.decision
            tr, td = times
        else:
            answer = suggest_in_run(reference, times, settings, with_better=False)
            if answer.recommended is None:
                raise RangeError(answer.why_none)
            situation, decision = answer.situation, answer.decision
            tr, td = answer.recommended.tr, answer.recommended.td
        time = reference.history.time
        part_set = part_set._replace(
            window=(tr, td),
            situation=situation,
            rigid_fraction=(td - tr) / float(time[-1] - time[0]),
            decision=decision,
        )
        return _add_position_error(part_set, situation, tr)


def _check_times(history: History, times: Times | float) -> None:
    """Raise RangeError if a given time lies outside the record."""
    if not isinstance(times, tuple):
        history.check(times, argument="td")
        return
    tr, td = times
    history.check_pair(tr, td)
    history.check(tr, argument="tr")
    history.check(td, argument="td")


def _add_position_error(part_set: PartSet, situation: Situation, tr: float) -> PartSet:
    """Add the largest position error at td of the bodies whose parts move relative to each other."""
    codes = ("several-bodies", "moves-apart")
    reasons = tuple(
        caution.message
        for caution in warn_about_place(situation, tr)
        if caution.code in codes
    )
    bodies = situation.bodies
    worst = bodies.worst(tr, situation.td) if bodies else None
    if bodies is None or worst is None:
        apart = {part.id for part in bodies.apart} if bodies else set()
        return part_set._replace(
            reasons=reasons, moving=part_set.moving | apart, apart=bool(apart)
        )
    angle = float(worst.drift.angles(np.array([tr]), situation.td)[0])
    placed = part_set._replace(
        position_error=worst.error,
        position_limit=bodies.limit if worst.part else None,
        position_part=worst.drift.part if worst.part else None,
        position_body=worst.body.parts if worst.body and worst.part else None,
        position_assumes=ONE_BODY if worst.assumed else None,
        angle_error=None if np.isnan(angle) else angle,
        position_is_lower_bound=worst.at_least,
    )
    if placed.out_of_place:
        return placed._replace(moving=part_set.moving | {*worst.drift.moving})
    return placed


def _mark_recommended(
    sets: Sequence[PartSet], *, has_all_elements: bool
) -> Iterator[PartSet]:
    """Mark the recommended set: the one with the largest saving or, if savings are equal, with the fewest parts.

    A set with a poor pair or too large a position error is considered only if all sets are like this. If the saving is
    unknown because weights are missing, the fraction of rigid elements replaces it, because the verdict on the times
    does not depend on the weights. ``has_all_elements`` is True if the elements of all parts are known.
    """
    gains = {part_set.parts: part_set.saving for part_set in sets}
    if has_all_elements and all(gain is None for gain in gains.values()):
        gains = {part_set.parts: part_set.rigid_share_of_elements for part_set in sets}
    useful = [part_set for part_set in sets if (gains[part_set.parts] or 0.0) > 0]
    usable = [part_set for part_set in useful if part_set.is_usable] or useful
    in_place = [part_set for part_set in usable if not part_set.out_of_place] or usable
    largest = max((gains[part_set.parts] or 0.0 for part_set in in_place), default=0.0)
    alike = [
        part_set
        for part_set in in_place
        if (gains[part_set.parts] or 0.0) >= largest - _LIKE
    ]
    best = min(alike, key=lambda part_set: len(part_set.parts), default=None)
    for part_set in sets:
        yield part_set._replace(recommended=part_set is best)


def _warn_about_sets(
    run: OpenedRun,
    facts: RunFacts,
    model: CostModel | None,
    rows: Sequence[PartRow],
    sets: Sequence[PartSet],
) -> Iterator[Caution]:
    """Yield the warnings about the deck, the parts and the sets."""
    if facts.reason:
        yield Caution("no-part-history", facts.reason)
    if model is None:
        yield Caution(
            "no-deck",
            "without a deck the CPU time and most verdicts are unknown; give the main deck of the run",
        )
        return
    yield from warn_about_titles(
        (fact.part for fact in facts.parts.values()), model.inventory
    )
    yield from warn_about_bodies(
        [row.id for row in rows if row.movable], model.inventory
    )
    yield from warn_about_solver((), model.inventory)
    yield from warn_about_left_rigid(run, model.inventory)
    yield from warn_about_cost(model)
    missing = [row.id for row in rows if row.elements is None and row.id in facts.parts]
    if missing:
        yield Caution(
            "parts-not-in-deck",
            f"{name_units(missing)} of the history {choose_verb(missing)} not in the deck",
        )
    if not any(row.movable for row in rows):
        yield Caution(
            "nothing-to-switch",
            "no part may be switched; the reasons are listed in the rows",
        )
    elif not any(part_set.recommended for part_set in sets):
        yield Caution(
            "no-set",
            "no set of parts can be recommended; the reasons are listed with the sets",
        )
    if sets and all(part_set.angle_error is None for part_set in sets):
        yield Caution("no-angle", _NO_ANGLE)
