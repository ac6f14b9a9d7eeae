"""The verdict on a pair of times for people: what to do, why, what comes after td, and what would be better."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.choice.grades import GOOD

if TYPE_CHECKING:
    from d2rpick.choice.candidates import Candidate
    from d2rpick.choice.decision import Decision
    from d2rpick.choice.quality import Grade

    Lines = list[tuple[str, str]]


def headed(decision: Decision, tr: float, td: float) -> Lines:
    """What to do with a pair, why, and what would be better; a name and a sentence each."""
    lines = [
        (decision.verdict, f"tr = {tr:.6g}, td = {td:.6g}"),
        ("why", decision.reason),
    ]
    if decision.cure:
        lines.append(("to improve", decision.cure))
    return [*lines, ("expect", outlook(decision))]


def outlook(decision: Decision) -> str:
    """What is expected after td, and the worst case if that is another one."""
    worst = decision.worst_case
    return (
        decision.expected
        if worst == "the same"
        else f"{decision.expected}. At worst: {worst}"
    )


def statements(decision: Decision) -> Lines:
    """What is said of motion and vibration, each by itself, with what the verdict does not say already."""
    motion, vibration = decision.quality.motion, decision.quality.vibration
    alone, worth = decision.quality.alone, decision.quality.worth
    raised = "" if alone.grade == vibration.grade else f", by itself {alone.grade}"
    share = (
        f"; its error holds at most {worth.share:.2%} of the energy of the next contact"
        if worth
        else ""
    )
    return [
        ("motion", f"{motion.grade}{_further(motion, decision)}"),
        ("vibration", f"{vibration.grade}{raised}{_further(alone, decision)}{share}"),
    ]


def _further(grade: Grade, decision: Decision) -> str:
    """Give why a grade is none better, and what would make it better, if the verdict does not say so."""
    causes = [cause for cause in grade.causes if cause.reason not in decision.reason]
    if not causes:
        return ""
    cures = "; ".join(dict.fromkeys(cause.cure for cause in causes))
    return f": {'; '.join(cause.reason for cause in causes)}. To improve: {cures}"


def in_short(decision: Decision) -> str:
    """Give the verdict, and why it is none better."""
    if decision.grade == GOOD:
        return decision.verdict
    return f"{decision.verdict}: {decision.reason}"


def in_full(decision: Decision) -> str:
    """Give the verdict, why it is none better, and what would make it better."""
    if decision.grade == GOOD:
        return f"{decision.verdict}: {decision.reason}"
    return f"{decision.verdict}: {decision.reason}. To improve: {decision.cure}"


def rigid_for(best: Candidate) -> str:
    """Say how long the parts are rigid."""
    return f"{best.rigid_time:.6g}, {best.rigid_fraction:.0%} of the simulated time"


def accuracy(best: Candidate) -> str:
    """Say how exactly tr is known, and how far another one may lie from it; empty if nothing is known of either."""
    known = "" if best.tr_high is None else f"accurate to ±{best.tr_high - best.tr:.1g}"
    room = (
        ""
        if best.timing_tolerance is None
        else f"any tr within ±{best.timing_tolerance:.1g} is nearly as good (error larger by at most 0.05)"
    )
    return "; ".join(filter(None, (known, room)))


def saving(best: Candidate) -> str | None:
    """Say how much processor time is saved; None if the cost of the parts is not known."""
    share = best.run_time_share
    return None if share is None else saved(share)


def saved(run_time_share: float) -> str:
    """Say how much processor time is saved, by what is left of it."""
    return f"about {1 - run_time_share:.0%} of the processor time"
