"""Write the verdict on a pair of times: what to do, why, what to expect after td, and how to improve the pair."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.base.errors import make_printable
from d2rpick.choice.pair.decision import join_cures
from d2rpick.choice.pair.grades import DO_NOT_USE, GOOD
from d2rpick.choice.pair.quality import MOST_WORTH_OF_FAIR

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from d2rpick.choice.pair.aftermath import Worth
    from d2rpick.choice.pair.candidates import Candidate
    from d2rpick.choice.pair.decision import Decision
    from d2rpick.choice.pair.quality import Grade
    from d2rpick.histories.history import History

    Lines = list[tuple[str, str]]


def is_refused(decision: Decision | None) -> bool:
    """Return True if a pair must not be used; such a pair is never called recommended or admissible."""
    return decision is not None and decision.verdict == DO_NOT_USE


def list_verdict_lines(decision: Decision, tr: float, td: float) -> Lines:
    """Return what to do with a pair, why, and how to improve it, as (name, sentence) pairs."""
    lines = [
        (decision.verdict, f"tr = {tr:.6g}, td = {td:.6g}"),
        ("why", decision.reason),
    ]
    if decision.cure:
        lines.append(("to improve", decision.cure))
    # If a switched run was compared, the screen also shows the measured values.
    name = "predicted" if decision.is_compared else "expect"
    return [*lines, (name, describe_expectation(decision))]


def describe_expectation(decision: Decision) -> str:
    """Return, as text, the expected error after td and the largest possible error."""
    worst = decision.worst_case
    if worst == "the same":
        return decision.expected
    effect = ""
    if decision.allows_only_motion:
        effect = "; its energy is small compared with that of the next contact"
    return f"{decision.expected}. At worst: {worst}{effect}"


def list_statements(decision: Decision) -> Lines:
    """Return a sentence on the motion and a sentence on the vibration; omit what the verdict already states."""
    motion = decision.quality.motion
    vibration = decision.quality.vibration
    alone = decision.quality.alone
    worth = decision.quality.worth
    raised = ""
    if alone.grade != vibration.grade:
        raised = f" ({alone.grade} without regard to the next contact)"
    share = ""
    if worth:
        share = f"; the energy of its error is {_format_worth(worth)}"
    return [
        ("motion", f"{motion.grade}{explain_grade(motion, decision)}"),
        (
            "vibration",
            f"{vibration.grade}{raised}{share}{explain_grade(alone, decision)}",
        ),
    ]


def _format_worth(worth: Worth) -> str:
    """Return the largest energy of the vibration error, relative to the next contact and its limit, as text."""
    if worth.share <= MOST_WORTH_OF_FAIR:
        return f"at most {worth.share:.2%} of the energy of the next contact"
    share = f"up to {worth.share:.0%} of the energy of the next contact"
    return f"{share} (at most {MOST_WORTH_OF_FAIR:.0%} can be used with care)"


def explain_grade(grade: Grade, decision: Decision) -> str:
    """Return why a grade is not better and how to improve it, unless the verdict already states both."""
    causes = [cause for cause in grade.causes if cause.reason not in decision.reason]
    if not causes:
        return ""
    reasons = "; ".join(cause.reason for cause in causes)
    # Causes that a better pair removes are omitted, because the verdict already names this pair.
    curable = [
        cause
        for cause in causes
        if not (decision.better is not None and cause.needs_other_times)
    ]
    cures = join_cures(
        cure
        for cure in map(decision.specify_cure, curable)
        if cure not in decision.cure
    )
    return f". Reason: {reasons}{f'. To improve: {cures}' if cures else ''}"


def number_reasons(decisions: Iterable[Decision]) -> dict[str, int]:
    """Number the reasons why verdicts are no better, each of which is explained once below a table."""
    reasons = (
        decision.general_reason for decision in decisions if decision.grade != GOOD
    )
    return {
        reason: number for number, reason in enumerate(dict.fromkeys(reasons), start=1)
    }


def format_with_number(decision: Decision, numbers: Mapping[str, int]) -> str:
    """Return the verdict with the number of the reason why it is no better."""
    if decision.grade == GOOD:
        return decision.verdict
    return f"{decision.verdict} ({numbers[decision.general_reason]})"


def list_numbered_reasons(numbers: Mapping[str, int]) -> Lines:
    """Return the numbered reasons to which a table of verdicts refers."""
    return [(f"({number})", reason) for reason, number in numbers.items()]


def format_in_full(decision: Decision) -> str:
    """Return the verdict, the reason why it is not better, what would improve it, and what to expect after td."""
    return f"{decision.verdict}: {decision.reason}. {format_outlook(decision)}"


def format_outlook(decision: Decision) -> str:
    """Return what would improve a pair, if anything is known to, and what to expect after td."""
    expectation = f"Expect: {describe_expectation(decision)}"
    if not decision.cure:
        return expectation
    return f"To improve: {decision.cure}. {expectation}"


def format_rigid_time(best: Candidate, history: History) -> str:
    """Format the time for which the parts are rigid."""
    share = format_rigid_share(best.rigid_fraction, history)
    unit = f" {make_printable(history.time_unit)}" if history.time_unit else ""
    return f"{best.rigid_time:.6g}{unit}, {share}"


def format_rigid_share(fraction: float, history: History) -> str:
    """Format a rigid time as a ``fraction`` of the simulated time, or of the record if its file is cut [-]."""
    whole = "the simulated time" if history.complete else "the record that was read"
    return f"{fraction:.0%} of {whole}"


def format_accuracy(best: Candidate, read_interval: float | None = None) -> str:
    """Return the accuracy and the timing tolerance of tr as text; empty if both are unknown.

    ``read_interval`` is the output interval that contains a tr that was read from a switched run [time]; None if tr was
    chosen or given.
    """
    if read_interval is not None:
        accuracy = f"read from the switched run, to within one output interval, {read_interval:.2g}"
    elif best.tr_high is not None:
        accuracy = f"accurate to ±{best.tr_high - best.tr:.1g}"
    else:
        accuracy = ""
    if best.timing_tolerance is None:
        room = ""
    else:
        room = f"timing tolerance ±{best.timing_tolerance:.1g} (the error grows by at most 0.05)"
    return "; ".join(filter(None, (accuracy, room)))


def format_saving(best: Candidate) -> str | None:
    """Return how much CPU time the pair saves; None if the cost of the parts is unknown."""
    share = best.run_time_share
    return None if share is None else format_saved_share(share)


def format_saved_share(run_time_share: float) -> str:
    """Return the saved CPU time as text, for a run that takes the fraction ``run_time_share`` of the CPU time."""
    return f"about {1 - run_time_share:.0%} of the CPU time"
