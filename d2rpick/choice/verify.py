"""Judging one pair of switch times."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from d2rpick.base.errors import RangeError
from d2rpick.choice.candidates import Candidate, judge
from d2rpick.choice.ranking import over_limits, quality_of
from d2rpick.choice.situation import examine
from d2rpick.choice.warnings import POOR_KINETIC_SHARE, Caution, cautions_of, out_of_place

if TYPE_CHECKING:
    from d2rpick.choice.comparison import Comparison
    from d2rpick.choice.health import Health
    from d2rpick.choice.ranking import Quality
    from d2rpick.choice.situation import Settings, Situation
    from d2rpick.histories.history import History


@dataclass(frozen=True)
class Verdict:
    """Answer of ``verify``: the measures of one pair, and what is right or wrong with it.

    ``tr_ok`` and ``td_ok`` are None where the record does not tell.
    """

    situation: Situation
    candidate: Candidate
    tr_ok: bool | None
    td_ok: bool | None
    verified: bool
    reasons: tuple[str, ...]
    cautions: tuple[Caution, ...]
    switched: Comparison | None = None
    health: Health | None = None

    @property
    def word(self) -> str:
        """The verdict in a few words."""
        if self.verified and self.situation.basis == "energy":
            return "verified by the energy level alone"
        return "verified" if self.verified else "unknown" if self.tr_ok is None else "not verified"

    @property
    def quality(self) -> Quality | None:
        """How good the pair is; None where it does not verify."""
        if not self.verified:
            return None
        from d2rpick.choice.expectation import expectation  # not above: an oscillator does without it

        return quality_of(self.situation, self.candidate, expectation(self.situation, self.candidate.energy))


def verify(history: History, tr: float, td: float, settings: Settings) -> Verdict:
    """Judge one pair; RangeError when a time lies outside the record or tr is not before td."""
    _in_order(tr, td)
    return verify_at(examine(history, td, settings), tr)


def verify_at(situation: Situation, tr: float) -> Verdict:
    """Judge one pair in a situation that is known; RangeError when tr lies outside the record or is not before td."""
    settings, td = situation.settings, situation.td
    _in_order(tr, td)
    situation.history.energy_at(tr, "tr")
    judged = judge(situation, [tr])
    candidate = judged[0]
    known = situation.flight.start is not None
    share = situation.kinetic_share
    limit = POOR_KINETIC_SHARE if settings.max_kinetic_share is None else settings.max_kinetic_share
    outside = td > situation.latest_td or (situation.earliest_tr is not None and td <= situation.earliest_tr)
    td_ok = False if outside else None if share is None else share <= limit
    return Verdict(
        situation=situation,
        candidate=candidate,
        tr_ok=candidate.acceptable if known else None,
        td_ok=td_ok,
        verified=bool(judged.kept[0]),
        reasons=(*candidate.notes, *over_limits(situation, candidate)),
        cautions=(*cautions_of(situation), *out_of_place(situation, tr)),
    )


def _in_order(tr: float, td: float) -> None:
    if not tr < td:
        raise RangeError(f"tr {tr:g} is not before td {td:g}; the part is rigid from tr to td")


def with_comparison(verdict: Verdict, comparison: Comparison) -> Verdict:
    """Add what a finished switched run shows; a wrong motion of it overrules the verdict."""
    return replace(
        verdict,
        switched=comparison,
        verified=verdict.verified and not comparison.objections,
        reasons=verdict.reasons + comparison.objections,
    )
