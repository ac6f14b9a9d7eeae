"""Write the result of ``suggest`` as a table, JSON, CSV, Markdown or a bare value."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from d2rpick.base.errors import name_units
from d2rpick.choice.pair.grades import DO_NOT_USE
from d2rpick.histories.digits import format_window
from d2rpick.report import keys, tables
from d2rpick.report.decision import (
    format_accuracy,
    format_rigid_time,
    format_saving,
    format_with_number,
    is_refused,
    list_numbered_reasons,
    list_statements,
    list_verdict_lines,
    number_reasons,
)
from d2rpick.report.fields import Document, Field, many, maybe, row, write_csv
from d2rpick.report.next_step import (
    add_step_to_copy,
    name_step_after_flight,
    name_step_after_refusal,
    name_step_with_pair,
    write_command,
)
from d2rpick.report.situation import list_situation_heading

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from d2rpick.choice.answers import AcceptableWindow, PairSuggestion
    from d2rpick.choice.pair.candidates import Candidate, Pair
    from d2rpick.choice.pair.decision import Decision
    from d2rpick.report.formats import DisplayOptions, RepeatedQuestion

# Largest number of windows of acceptable tr that a line of text lists.
_NAMED = 4
_WINDOW: Final = row(
    *keys.WINDOW.fields,
    Field("recommended", "flag", "true if the range contains the recommended tr"),
)
# Fields of a pair and of the decision on it.
_JUDGED_PAIR: Final = row(
    *keys.PAIR.fields,
    Field("verdict", keys.VERDICT, "what to do with this pair"),
    Field("verdict_reason", "text", "reason for the verdict, as text"),
)
# Fields of a candidate and of the decision on it.
CANDIDATE: Final = row(
    *keys.CANDIDATE.of_part(lambda candidate_and_decision: candidate_and_decision[0]),
    *keys.DECIDED.of_part(
        lambda candidate_and_decision: candidate_and_decision[1],
        ("verdict", "verdict_reason", "cure"),
    ),
    name="candidate",
)

# _SPARE: columns that are omitted first if the table of candidates is too wide.
# _IN_FULL: columns that are shown only with ``verbose``.
_SPARE: Final = ("timing tolerance", "+-", "kind", "E(tr)/E(td)", "rank")
_IN_FULL: Final = ("rank", "kind", "+-", "frozen-deformation error")


def _add_decisions(answer: PairSuggestion) -> list[tuple[Candidate, Decision]]:
    """Return each candidate together with the decision on it."""
    return [
        (candidate, answer.decision_on(candidate)) for candidate in answer.candidates
    ]


def _list_acceptable_windows(answer: PairSuggestion) -> list[dict[str, Any]] | None:
    """Return the windows of acceptable tr, marking the one that contains the recommended tr."""
    tr = answer.recommended.tr if answer.recommended else None
    windows = answer.windows
    if windows is None:
        return None
    return [
        {**window._asdict(), "recommended": has_recommended_tr(window, tr)}
        for window in windows
    ]


def _judge_pair_at_better_td(answer: PairSuggestion) -> dict[str, Any] | None:
    """Return the pair at a better td with the verdict of ``verify``."""
    better, decision = answer.better_pair, answer.decision_on_better
    if better is None or decision is None:
        return None
    pair = {"td": better.td, "tr": better.tr, "residual": better.residual}
    return {**pair, "verdict": decision.verdict, "verdict_reason": decision.reason}


DOCUMENT: Final = Document("d2rpick/suggest/2", "Answer of d2rpick suggest; times in the unit of the history.", row(
    *keys.FRAME,
    keys.TD,
    Field("td_window", "span?",
          "range in which td was chosen: --td-window, or the longest flight; null if td was given"),
    Field("longer_pair", maybe(keys.PAIR),
          "longest admissible pair in td_window, if it is much longer than the recommended pair but of lower quality",
          lambda answer: answer.longer),
    *keys.MECHANICS.of_part(lambda answer: answer.situation),
    Field("candidates", many(CANDIDATE), "values of tr for this td, from best to worst", _add_decisions),
    Field("acceptable_windows", maybe(many(_WINDOW)),
          "admissible tr ranges, if the basis is energy; otherwise null", _list_acceptable_windows),
    Field("recommended", maybe(keys.TIMES), "recommended pair; null if there is none"),
    *keys.QUALITY,
    keys.HEALTH,
    keys.EXPECTED,
    Field("better_td", maybe(_JUDGED_PAIR), "pair at a better td; null if there is none, or if it is the recommended "
                                            "pair",
          _judge_pair_at_better_td),
))  # fmt: skip


def as_table(answer: PairSuggestion, display: DisplayOptions) -> str:
    """Return the verdict, the evidence for it, and the first candidates; a star marks the recommended row.

    If nothing is recommended, candidates are listed only if all details are asked for.
    """
    above = list_situation_heading(answer.situation, verbose=display.verbose)
    listed = answer.candidates[: display.limit]
    lines = [
        *tables.format_in_line(
            (*list_verdict(answer), *list_next_step(answer, display.question))
        ),
        "",
        *tables.format_in_line(
            (*list_evidence(answer), *list_alternatives(answer), *above)
        ),
    ]
    if answer.candidates and (answer.recommended or display.verbose):
        lines += [
            "",
            tables.as_text(
                *_select_shown_candidates(answer, display), display.width, _SPARE
            ),
        ]
        lines += tables.format_in_line(list_candidate_reasons(answer, listed))
        hidden_count = len(answer.candidates) - display.limit
        lines += [f"... and {hidden_count} more (--limit)"] * (hidden_count > 0)
    return "\n".join(lines)


def as_markdown(answer: PairSuggestion, display: DisplayOptions) -> str:
    """Return the verdict, the candidates as a Markdown table and, below it, the evidence for the verdict."""
    above = tables.format_as_list(
        (*list_verdict(answer), *list_next_step(answer, display.question))
    )
    below = tables.format_as_list((*list_evidence(answer), *list_alternatives(answer)))
    table = tables.as_markdown(*_select_shown_candidates(answer, display))
    listed = answer.candidates[: display.limit]
    reasons = tables.format_as_list(list_candidate_reasons(answer, listed))
    return "\n\n".join([*above, table, *reasons, *below])


def _select_shown_candidates(
    answer: PairSuggestion, display: DisplayOptions
) -> tuple[list[str], list[list[tables.Cell]]]:
    """Return the first candidates without empty columns, as header and rows."""
    head, rows = tables.select_known_columns(
        *build_candidate_table(answer, display.limit)
    )
    shown_columns = [
        i for i, name in enumerate(head) if display.verbose or name not in _IN_FULL
    ]
    return tables.select_columns(head, rows, shown_columns)


def as_csv(answer: PairSuggestion, _: DisplayOptions) -> str:
    """Return CSV of all candidates, with a column for td and one for each JSON key except ``parts``."""
    left_out = ("notes", "parts")
    columns = [*(key for key in CANDIDATE.keys if key not in left_out), "td", "notes"]
    td = answer.situation.td
    return write_csv(
        columns,
        (
            {**CANDIDATE.plain(candidate), "td": td}
            for candidate in _add_decisions(answer)
        ),
    )


def list_verdict(answer: PairSuggestion) -> list[tuple[str, str]]:
    """Return (name, sentence) pairs: what to do with the recommended pair, why, and what to expect after td."""
    best = answer.chosen
    decision = answer.decision
    better = answer.clearly_better
    lines = [("no pair to use", answer.why_none)]
    if best and decision:
        lines = list_verdict_lines(decision, best.tr, answer.td)
    # A pair that cannot be used either is no way out, so it is left out.
    is_usable = not is_refused(answer.decision_on_better)
    if better and is_usable and not (decision and decision.better):
        lines.append(("better pair", _describe_better_pair(answer, better)))
    return lines


def _describe_better_pair(answer: PairSuggestion, better: Pair) -> str:
    """Describe the better pair with its verdict, if it was judged."""
    decision = answer.decision_on_better
    improvement = describe_improvement(answer, better)
    if decision is None:
        return f"{_format_times(better)}: {improvement}"
    return f"{_format_times(better)}: {decision.verdict}; {improvement}"


def list_evidence(answer: PairSuggestion) -> list[tuple[str, str]]:
    """Return the evidence for the verdict, the rigid time, and the accuracy of tr, each with its name."""
    best = answer.chosen
    decision = answer.decision
    if best is None or decision is None:
        return []
    lines = [
        *list_statements(decision),
        ("rigid for", format_rigid_time(best, answer.situation.history)),
    ]
    if saves := format_saving(best):
        lines.append(("saves", saves))
    if answer.situation.vibration.keeps_nothing:
        lines.append(("keeps", "nothing of the vibration: no tr can keep it"))
    if exact := format_accuracy(best):
        lines.append(("tr", exact))
    return lines


def list_next_step(
    answer: PairSuggestion, question: RepeatedQuestion
) -> list[tuple[str, str]]:
    """Return the next command: it leads to the card of a usable pair or, failing that, to a better pair."""
    decision = answer.decision
    pair = answer.recommended
    if decision is None or pair is None or decision.verdict == DO_NOT_USE:
        step = _name_step_after_refusal(answer, decision, question)
    else:
        times = (pair.tr, pair.td)
        step = name_step_with_pair(
            answer.situation, times, decision.better, question, "suggest"
        )
    return add_step_to_copy(answer.situation.history, [("next", step)])


def _lies_outside_flight(answer: PairSuggestion) -> bool:
    """Return True if the given td lies before or after the flight, so that no tr and no other parts help."""
    situation = answer.situation
    start = situation.flight.start
    if start is None or answer.td_window is not None or answer.recommended is not None:
        return False
    return situation.td <= start or situation.td > situation.latest_td


def _name_step_after_refusal(
    answer: PairSuggestion, decision: Decision | None, question: RepeatedQuestion
) -> str:
    """Return the step after an answer without a usable pair."""
    better = decision.better if decision else answer.clearly_better
    judged = answer.decision_on_better
    if decision is None and judged is not None and judged.verdict == DO_NOT_USE:
        better = None
    if better is None and _lies_outside_flight(answer):
        line = write_command(question, "suggest")
        return f"choose both times in the flight with {line}"
    is_given_window = "--td-window" in question.times
    is_compared = answer.td_window is not None or (decision and decision.best_of)
    if is_given_window:
        otherwise = f"compare all flights with {write_command(question, 'plan')}"
    elif is_compared or answer.situation.flight.start is None:
        otherwise = name_step_after_flight(answer.situation, decision, question)
    elif decision is None and answer.situation.flight.start is not None:
        otherwise = f"choose both times with {write_command(question, 'suggest')}"
    else:
        line = write_command(question, "explore", *question.times)
        otherwise = f"compare other td with {line}"
    return name_step_after_refusal(
        answer.situation, better, question, otherwise, decision
    )


def describe_improvement(answer: PairSuggestion, better: Pair) -> str:
    """Describe in which respects the better pair is better."""
    recommended = answer.recommended
    if recommended is None:
        return "it has an admissible tr"
    if better.residual is not None and recommended.residual is not None:
        residuals = [
            tables.format_measure(pair.residual) for pair in (better, recommended)
        ]
        return f"residual {residuals[0]} instead of {residuals[1]}"
    level = answer.situation.vibration.whole.energy(better.td)
    own_level = answer.situation.energy_td
    return f"the energy at td is {level / own_level:.3g} times as high, so more of the vibration can be kept"


def list_alternatives(answer: PairSuggestion) -> list[tuple[str, str]]:
    """Return the alternatives to the recommended pair, as (name, sentence) pairs."""
    chosen = answer.recommended.tr if answer.recommended else None
    # The energy in these windows matches that at td, but "admissible" would contradict the verdict "do not use".
    if answer.windows and not is_refused(answer.decision):
        lines = [("admissible", describe_acceptable_windows(answer.windows, chosen))]
    else:
        lines = []
    best = answer.chosen
    if best and best.position_error is not None:
        lines.append(
            (
                "position",
                describe_position_error(
                    best, deck=answer.situation.settings.bodies is not None
                ),
            )
        )
    if answer.longer and answer.recommended:
        lines.append(("longer", describe_given_up_time(answer)))
    return lines


def describe_position_error(best: Candidate, *, deck: bool) -> str:
    """Describe a body's position error at td, its cause and its assumptions; ``deck``: a deck is used."""
    assert best.position_error is not None
    taken = f" if {best.position_error_assumes}" if best.position_error_assumes else ""
    taken += " (`deck` shows which do)" if taken and not deck else ""
    if best.position_error_part is None:
        return f"in place at td{taken}, as far as the parts show: none moves relative to the others of its rigid body"
    parts = best.position_error_body
    body = f", the body of {name_units(map(int, parts.split(',')))}" if parts else ""
    bound_text = "at least " if best.position_error_is_lower_bound else ""
    size = f"{bound_text}{best.position_error:.2g}"
    return f"out of place by {size} at td{body}{taken}: {best.position_error_part} is frozen at another place"


def describe_given_up_time(answer: PairSuggestion) -> str:
    """Describe by how much the recommended pair of an answer is shorter than a longer pair, and why."""
    longer, chosen = answer.longer, answer.recommended
    assert longer is not None
    assert chosen is not None
    lost = longer.rigid_time - chosen.rigid_time
    times = (
        f"tr = {longer.tr:.6g}, td = {longer.td:.6g}, rigid for {longer.rigid_time:.6g}"
    )
    shorter = f"the {_name_choice(answer)} window is {lost:.3g} ({lost / longer.rigid_time:.0%}) shorter"
    return f"a longer window exists ({times}), but {_explain_shorter_window(answer, longer, chosen)}; {shorter}"


def _explain_shorter_window(answer: PairSuggestion, longer: Pair, chosen: Pair) -> str:
    """Return why a longer pair was not chosen: its verdict, its residual or the bound of it, its level, or its tr."""
    decision, own = answer.decision_on_longer, answer.decision
    if decision and own and not decision.reaches(own.grade):
        return f"its verdict is {decision.verdict!r}: {decision.reason}"
    if longer.residual is None or chosen.residual is None:
        return "it has a lower level at td"
    format_measure = tables.format_measure
    residual = format_measure(longer.residual)
    if longer.residual > chosen.residual and residual != format_measure(
        chosen.residual
    ):
        return (
            f"it has residual {residual} instead of {format_measure(chosen.residual)}"
        )
    bounds = longer.residual_high, chosen.residual_high
    highest, own_highest = map(format_measure, bounds)
    if (bounds[0] or 0.0) > (bounds[1] or 0.0) and highest != own_highest:
        return f"its residual may be up to {highest}, that of the {_name_choice(answer)} window up to {own_highest}"
    return "its tr is less certain"


def _name_choice(answer: PairSuggestion) -> str:
    """Return what the choice is called: a pair that must not be used is not recommended."""
    return "chosen" if is_refused(answer.decision) else "recommended"


def describe_acceptable_windows(
    windows: Sequence[AcceptableWindow], tr: float | None
) -> str:
    """Describe the windows of acceptable tr: the one with the recommended tr, the longest others, and the total."""
    share = sum(window.share for window in windows)
    if len(windows) == 1:
        return f"every tr from {format_window(*windows[0][:2])}, {share:.0%} of the flight up to td"
    named_windows = sorted(
        windows,
        key=lambda window: (
            not has_recommended_tr(window, tr),
            window.start - window.end,
        ),
    )[:_NAMED]
    window_texts = [
        f"{format_window(w.start, w.end)} ({w.share:.1%}{', recommended' * has_recommended_tr(w, tr)})"
        for w in named_windows
    ]
    if len(windows) > len(named_windows):
        shorter_text = f" and {len(windows) - len(named_windows)} shorter windows"
    else:
        shorter_text = ""
    return f"every tr from {'; '.join(window_texts)}{shorter_text}; in all {share:.0%} of the flight up to td"


def has_recommended_tr(window: AcceptableWindow, tr: float | None) -> bool:
    """Return True if the recommended tr lies in the window."""
    return tr is not None and window.start <= tr <= window.end


def as_value(answer: PairSuggestion, _: DisplayOptions) -> str:
    """Return the recommended tr, and td if it was chosen as well, with the fewest digits that preserve them exactly.

    The text is empty if there is no recommendation.
    """
    pair = answer.recommended
    if pair is None:
        return ""
    return f"{pair.tr!r} {pair.td!r}" if answer.td_window else repr(pair.tr)


def build_candidate_table(
    answer: PairSuggestion, limit: int
) -> tuple[list[str], list[list[tables.Cell]]]:
    """Return the column names and cells of the first ``limit`` candidates.

    `list_candidate_reasons` explains the numbers beside the verdicts.
    """
    listed = answer.candidates[:limit]
    numbers = _number_candidate_reasons(answer, listed)
    columns: dict[str, Callable[[Candidate], tables.Cell]] = {
        "": lambda c: "*" if c.recommended else " ",
        "rank": lambda c: c.rank,
        "tr": lambda c: c.tr,
        "+-": lambda c: tables.format_half_width(c.tr_low, c.tr_high),
        "kind": lambda c: c.kind,
        "E(tr)/E(td)": lambda c: c.level_ratio,
        "direction": lambda c: {True: "same", False: "opposite", None: None}[
            c.sign_match
        ],
        "frozen-deformation error": lambda c: tables.format_measure(c.lock_in_error),
        "residual": lambda c: tables.format_measure(c.residual),
        "timing tolerance": lambda c: tables.format_if_known(c.timing_tolerance, ".1e"),
        "rigid for": lambda c: c.rigid_time,
        "verdict": lambda c: format_with_number(answer.decision_on(c), numbers),
    }
    return tables.fill_table(columns, listed)


def list_candidate_reasons(
    answer: PairSuggestion, listed: Sequence[Candidate]
) -> list[tuple[str, str]]:
    """Return the reasons for the verdicts on the listed candidates, each with its number in the table."""
    return list_numbered_reasons(_number_candidate_reasons(answer, listed))


def _number_candidate_reasons(
    answer: PairSuggestion, listed: Sequence[Candidate]
) -> dict[str, int]:
    """Number the reasons why the listed candidates are not rated higher."""
    return number_reasons(map(answer.decision_on, listed))


def _format_times(pair: Pair) -> str:
    return f"tr = {pair.tr:.6g}, td = {pair.td:.6g}"
