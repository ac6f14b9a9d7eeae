"""Add the comparison of a finished switched run with its reference run to the verdict on a pair."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from d2rpick.choice.health import warn_about_engine
from d2rpick.choice.switched.comparison import compare_with_reference

if TYPE_CHECKING:
    from d2rpick.choice.answers import PairVerdict
    from d2rpick.choice.question import Reference


def add_comparison(
    verdict: PairVerdict,
    reference: Reference,
    switched: Reference,
    min_mean: float = 0.0,
) -> PairVerdict:
    """Add the comparison of a finished switched run with the reference run to a verdict.

    Both runs are read in the same way. ``min_mean`` is the smallest expected mean energy after td, relative to that of
    the reference run [-].

    Raises
    ------
    RangeError
        If one of the two runs does not continue after td.
    """
    comparison = compare_with_reference(
        verdict.situation, verdict.candidate.tr, reference, switched, min_mean
    )
    return replace(
        verdict,
        switched=comparison,
        computed=switched.history,
        # If the switched run deviates too much, the pair is inadmissible, whatever the reference run shows.
        admissible=verdict.admissible and not comparison.objections,
        reasons=verdict.reasons + comparison.objections,
        cautions=(*verdict.cautions, *warn_about_engine(switched.run.sources)),
    )
