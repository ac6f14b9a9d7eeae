"""Write the result of ``verify`` as a table, JSON, CSV or Markdown."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

from d2rpick.base.errors import list_names, make_printable
from d2rpick.choice.pair.grades import DO_NOT_USE, GOOD
from d2rpick.choice.pair.warnings import POOR_RESIDUAL
from d2rpick.choice.switched.same_model import MOST_MOMENTUM_ERROR
from d2rpick.report import keys, tables
from d2rpick.report.decision import (
    format_accuracy,
    format_rigid_time,
    format_saved_share,
    list_statements,
    list_verdict_lines,
)
from d2rpick.report.fields import Document, Field, get_kind, many, maybe, row
from d2rpick.report.next_step import (
    add_step_to_copy,
    name_step_after_flight,
    name_step_after_refusal,
    name_step_with_pair,
    write_command,
)
from d2rpick.report.situation import list_situation_heading

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.base.spans import Times
    from d2rpick.choice.answers import PairVerdict
    from d2rpick.choice.pair.decision import Decision
    from d2rpick.choice.switched.comparison import Comparison
    from d2rpick.report.formats import DisplayOptions, RepeatedQuestion

# Fields of the judged pair, of its measured values, and of the verdict on it.
MEASURES: Final = row(
    keys.TR._replace(get=lambda answer: answer.candidate.tr),
    keys.TD._replace(get=lambda answer: answer.situation.td),
    *keys.CANDIDATE.of_part(lambda answer: answer.candidate, keys.MEASURES),
    Field("tr_ok", "flag?", "true if tr is admissible; null if the flight is unknown"),
    Field(
        "td_ok",
        "flag?",
        "true if td lies in the flight and the kinetic fraction K does not exceed its limit (0.5, or "
        "--max-kinetic-share); null if K is unknown",
    ),
    Field(
        "verified",
        "flag",
        "true if the pair is admissible, not poor, and has a residual of at most 0.5; see verdict",
    ),
)
_IF_WRONG: Final = "null if the solver reports wrong energies of all compared parts"
SWITCHED: Final = row(
    Field("source", get_kind("texts", minItems=1), "files of the switched run"),
    Field("energy_frozen", "number?", f"energy of the switched run at td; {_IF_WRONG}"),
    Field("energy_td", "number", "energy of the reference run at td"),
    Field("level_ratio", "number?", "energy_frozen divided by energy_td; null if energy_td is only "
                                      "round-off or energy_frozen is null"),
    Field("end", "number", "end of the comparison, which begins at td"),
    Field("mean_after", "number?", f"mean energy after td in the switched run; {_IF_WRONG}"),
    Field("mean_after_reference", "number", "mean energy after td in the reference run"),
    Field("spread_after", "size?", f"standard deviation of the energy after td in the switched run; {_IF_WRONG}"),
    Field("spread_after_reference", get_kind("number", minimum=0), "standard deviation of the energy after td in the "
                                                                   "reference run"),
    Field("momentum_error", "size?",
          "largest deviation of the momentum after td, relative to the largest momentum of the reference run after td"),
    Field("displacement", "size?", "largest distance between the centres of the parts in the two runs after td"),
    Field("rigid_from", "number?", "time from which the energy of the switched run is constant in the window; null if "
                                   "it is not constant"),
    Field("rigid_to", "number?", "last time at which this energy is constant"),
    Field("objections", "texts", "reasons why the comparison failed; empty if it passed"),
    Field("notes", "texts", "what was left out or assumed when the switched run was read, and anomalies of this run"),
    Field("other_windows", many("span"), "other windows (tr, td) in which the "
          "switched run was rigid; they were not compared"),
    name="switched", later=("rigid_from", "rigid_to", "objections", "other_windows"),
)  # fmt: skip
DOCUMENT: Final = Document("d2rpick/verify/2", "Answer of d2rpick verify; times in the unit of the history.", row(
    *keys.FRAME,
    *keys.MECHANICS.of_part(lambda answer: answer.situation),
    *MEASURES.fields,
    *keys.QUALITY,
    keys.HEALTH,
    Field("reasons", "texts", "reasons for the verdict, and remarks"),
    Field("switched", maybe(SWITCHED), "comparison of a finished switched run with the reference run; null without "
                                       "--switched"),
))  # fmt: skip
# Step after a comparison within the limits of a pair that cannot be used.
_USE_MOTION_OF_SWITCHED_RUN: Final = (
    "use at most the motion of this switched run, up to the next contact, because nothing shows that its vibration "
    "after td is right; `min_quality` poor accepts it"
)
COMPARED = ("", "switched", "reference")


def as_table(answer: PairVerdict, display: DisplayOptions) -> str:
    """Return, as text, the verdict with reasons and improvements, its evidence, and the measured values of the pair."""
    decided = answer.decision.reason
    remarks = [("note", reason) for reason in answer.reasons if reason not in decided]
    above = list_situation_heading(answer.situation, verbose=display.verbose)
    verdict_lines = [
        *list_pair_verdict(answer),
        *list_next_step(answer, display),
    ]
    lines = tables.format_in_line([*list_comparison(answer), *verdict_lines])
    if answer.switched:
        lines += ["", *_format_comparison(answer.switched)]
    listed = [*list_pair_evidence(answer), *above, *remarks]
    printable = [(name, make_printable(text)) for name, text in listed]
    return "\n".join(
        [
            *lines,
            "",
            *tables.format_in_line(printable),
            "",
            *tables.format_in_line(list_known_measures(answer)),
        ]
    )


def list_pair_verdict(answer: PairVerdict) -> list[tuple[str, str]]:
    """Return what to do with the pair, why, and how to improve it, as (name, sentence) pairs."""
    return list_verdict_lines(answer.decision, answer.candidate.tr, answer.td)


def list_next_step(
    answer: PairVerdict, display: DisplayOptions
) -> list[tuple[str, str]]:
    """Return the next command: it leads to the card of a usable pair, a page on its switched run, or a better pair."""
    question = display.question
    decision = answer.decision
    situation = answer.situation
    if answer.is_of_other_run:
        line = write_command(question, "info")
        step = f"look at the reference run, and at the switched run in the same way: {line}"
    elif answer.is_of_other_times:
        line = write_command(question, "verify", *_leave_out_times(question.times))
        step = f"compare the window of the switched run with {line}"
    elif answer.is_incomplete:
        line = write_command(question, "verify", *question.times)
        step = f"finish the switched run, then compare it again with {line}"
    elif decision.verdict == DO_NOT_USE:
        if answer.switched and not answer.switched.objections:
            return add_step_to_copy(
                situation.history, [("next", _USE_MOTION_OF_SWITCHED_RUN)]
            )
        if decision.best_of or situation.flight.start is None:
            otherwise = name_step_after_flight(situation, decision, question)
        else:
            line = write_command(question, "explore", "--td", f"{answer.td:.6g}")
            otherwise = f"compare other td with {line}"
        step = name_step_after_refusal(
            situation, decision.better, question, otherwise, decision
        )
    elif later := _find_next_window(answer):
        line = _write_command_for_window(question, later)
        step = f"{_name_usable_results(answer)} up to {later[0]:.6g}; judge the next window with {line}"
    elif answer.switched and display.page:
        step = f"{_name_usable_results(answer)}; {display.page} contains the comparison"
    elif answer.switched:
        words = (*question.times, "--report", "verify.html")
        line = write_command(question, "verify", *words)
        step = f"{_name_usable_results(answer)}; keep the comparison with {line}"
    else:
        pair = (answer.candidate.tr, answer.td)
        step = name_step_with_pair(situation, pair, decision.better, question, "card")
    return add_step_to_copy(situation.history, [("next", step)])


def _find_next_window(answer: PairVerdict) -> Times | None:
    """Return the window of the switched run (tr, td) after the judged one [time]; None if there is none."""
    others = answer.switched.other_windows if answer.switched else ()
    return next((window for window in others if window[0] >= answer.td), None)


def _write_command_for_window(question: RepeatedQuestion, window: Times) -> str:
    """Return the command that compares the switched run in another of its windows."""
    tr, td = (f"{time:.6g}" for time in window)
    kept = _leave_out_times(question.times)
    return write_command(question, "verify", "--tr", tr, "--td", td, *kept)


def _leave_out_times(words: Sequence[str]) -> list[str]:
    """Return the words of a command without the given tr and td."""
    return [
        word
        for before, word in pairwise(("", *words))
        if not {before, word} & {"--tr", "--td"}
    ]


def _name_usable_results(answer: PairVerdict) -> str:
    """Return the advice to use the switched run, or only its motion if its vibration is known to be wrong."""
    decision = answer.decision
    switched = answer.switched
    is_kept = switched is None or _keeps_vibration(switched, decision)
    if decision.allows_only_motion or not is_kept:
        return "use only the motion of the switched run"
    care = "" if decision.grade == GOOD else " with care"
    return f"use the results of the switched run{care}"


def list_comparison(answer: PairVerdict) -> list[tuple[str, str]]:
    """Return a row with its name: whether the switched run agrees with the reference run; none without such a run.

    If the pair is not to be used although no limit is exceeded, the row states that the computed run compares well, and
    what this does not show.
    """
    switched = answer.switched
    if switched is None:
        return []
    compared = ", ".join(_list_limited_values(switched))
    is_within = _contradicts_verdict(switched, answer.decision)
    if is_within:
        verdict = "within limits, although the pair was poor"
    elif switched.is_incomplete:
        verdict = "incomplete for the reason below; within limits so far"
    elif switched.objections and _are_values_within_limits(switched):
        verdict = (
            "failed for the reason below, although these values are within their limits"
        )
    elif switched.objections:
        verdict = "failed"
    else:
        verdict = "passed" if compared else "not possible"
    remark = _describe_missing_energy(switched, answer.decision)
    if is_within and not remark:
        remark = f"this does not show that the vibration is kept: {_describe_spread(switched)}"
    elif not _keeps_vibration(switched, answer.decision):
        remark = remark or _describe_spread(switched)
    heading = f"{verdict}{_number_window(answer)}"
    compared = compared or "nothing with a limit is known"
    return [("comparison", "; ".join(filter(None, (f"{heading}: {compared}", remark))))]


def _number_window(answer: PairVerdict) -> str:
    """Return which window of the switched run is compared, if it has several; otherwise an empty text."""
    others = answer.switched.other_windows if answer.switched else ()
    if not others:
        return ""
    number = 1 + sum(tr < answer.candidate.tr for tr, _ in others)
    return f" in window {number} of {len(others) + 1}"


def _describe_missing_energy(switched: Comparison, decision: Decision) -> str:
    """Return why only the motion is compared; empty if the energies are compared."""
    if switched.mean_after is None:
        parts = list_names(switched.misreported)
        cause = "a fault of some solvers for solids that were rigid"
        return f"only the motion is compared, because the energies of {parts} are wrong after td, {cause}"
    if not switched.has_energy and decision.at_rest:
        return "only the motion is compared, because nothing vibrates"
    return ""


def _contradicts_verdict(switched: Comparison, decision: Decision) -> bool:
    """Return True if the comparison exceeds no limit, but the pair is not to be used."""
    return not switched.objections and decision.verdict == DO_NOT_USE


def _are_values_within_limits(switched: Comparison) -> bool:
    """Return True if values are compared and none exceeds its limit, so that the comparison failed otherwise."""
    within = []
    if switched.has_energy and switched.mean_after is not None:
        ratio = switched.mean_after / switched.mean_after_reference
        within.append(switched.min_mean <= ratio <= 2 - switched.min_mean)
    if switched.momentum_error is not None:
        within.append(switched.momentum_error <= MOST_MOMENTUM_ERROR)
    return bool(within) and all(within)


def _list_limited_values(switched: Comparison) -> list[str]:
    """Return the compared values that have limits, each with its limits."""
    compared = []
    if switched.has_energy and switched.mean_after is not None:
        ratio = switched.mean_after / switched.mean_after_reference
        limits = f"{100 * switched.min_mean:g}% to {100 * (2 - switched.min_mean):g}%"
        compared.append(
            f"mean energy after td {ratio:.0%} of the reference run (limits {limits})"
        )
    if switched.momentum_error is not None:
        limit = f"limit {MOST_MOMENTUM_ERROR:.0%}"
        compared.append(
            f"momentum error after td {switched.momentum_error:.2%} ({limit})"
        )
    return compared


def _keeps_vibration(switched: Comparison, decision: Decision) -> bool:
    """Return False if the amplitude after td is unknown or seems wrong by more than the largest usable residual.

    The energy varies with the square of the amplitude, and by less if the parts vibrate about a deformed shape.
    """
    if decision.at_rest:
        return True
    spread = switched.spread_after
    if spread is None:
        return False
    reference = switched.spread_after_reference
    smallest = (1 - POOR_RESIDUAL) ** 2 * reference
    largest = (1 + POOR_RESIDUAL) ** 2 * reference
    return smallest <= spread <= largest


def _describe_spread(switched: Comparison) -> str:
    """Return the standard deviation of the energy after td in the switched run, relative to the reference run."""
    if switched.spread_after is None:
        return ""
    spread = f"standard deviation of the energy after td {switched.spread_after:.3g}"
    return f"{spread}, in the reference run {switched.spread_after_reference:.3g}"


def list_pair_evidence(answer: PairVerdict) -> list[tuple[str, str]]:
    """Return the evidence for the verdict, the rigid time, and the accuracy of tr, each with its name."""
    best = answer.candidate
    lines = [
        *list_statements(answer.decision),
        ("rigid for", format_rigid_time(best, answer.situation.history)),
    ]
    if best.run_time_share is not None:
        lines.append(("saves", format_saved_share(best.run_time_share)))
    if exact := format_accuracy(best, answer.tr_interval):
        lines.append(("tr", exact))
    return lines


def list_known_measures(answer: PairVerdict) -> list[tuple[str, tables.Cell]]:
    """Return the known values of the pair with their displayed names."""
    best = answer.candidate
    direction = {True: "the same", False: "opposite", None: None}[best.sign_match]
    unit = answer.situation.history.energy_unit
    unit_text = f" [{make_printable(unit)}]" if unit else ""
    rows: list[tuple[str, tables.Cell]] = [
        (f"E(tr), energy at tr{unit_text}", best.energy),
        (f"E(td), energy at td{unit_text}", answer.energy_td),
        ("E(tr)/E(td)", best.level_ratio),
        ("level error", tables.format_if_known(best.level_error, ".3f")),
        ("direction of the deformation at tr", direction),
        ("kinetic fraction at td", tables.format_if_known(answer.kinetic_share, ".3f")),
        ("frozen-deformation error", tables.format_if_known(best.lock_in_error, ".3f")),
        ("residual, expected", tables.format_if_known(best.residual, ".3f")),
        ("residual, lowest", tables.format_if_known(best.residual_low, ".3f")),
        ("residual, highest", tables.format_if_known(best.residual_high, ".3f")),
        ("timing tolerance", best.timing_tolerance),
        ("position error", best.position_error),
    ]
    return [row for row in rows if row[1] is not None]


def as_markdown(answer: PairVerdict, display: DisplayOptions) -> str:
    """Return the verdict, and the values of the pair as a Markdown table with two columns."""
    switched = answer.switched
    verdict_lines = [*list_pair_verdict(answer), *list_next_step(answer, display)]
    paragraphs = tables.format_as_list(
        (*list_comparison(answer), *verdict_lines, *list_pair_evidence(answer))
    )
    table = tables.as_markdown(("measure", "value"), list_known_measures(answer))
    if switched:
        compared = [
            tables.as_markdown(COMPARED, compare_values(switched)),
            *tables.format_as_list(list_deviations(switched)),
        ]
    else:
        compared = []
    reasons = [f"* {tables.escape_markdown(reason)}" for reason in answer.reasons]
    return "\n\n".join([*paragraphs, table, *compared, *reasons])


def list_all_measures(answer: PairVerdict) -> dict[str, Any]:
    """Return the values of the pair by name; those of a switched run have the prefix ``switched_``."""
    situation = answer.situation
    measured: dict[str, Any] = {
        "energy_td": situation.energy_td,
        "kinetic_share": situation.kinetic_share,
        **MEASURES.plain(answer),
    }
    decided = {field.key: field.of(answer) for field in keys.DECISION}
    return {
        **measured,
        **_list_switched_measures(answer),
        **decided,
        "quality": answer.decision.grade,
        "reasons": "; ".join(answer.reasons),
    }


def as_csv(answer: PairVerdict, _: DisplayOptions) -> str:
    """Return one row of CSV with a column for each key that `list_all_measures` returns."""
    values = list_all_measures(answer)
    return tables.as_csv(list(values), [list(values.values())]).rstrip("\n")


def compare_values(switched: Comparison) -> list[tuple[str, float, float]]:
    """Return the numbers known for both runs as rows of name, switched run and reference run (see `COMPARED`)."""
    rows = [
        ("energy right after td", switched.energy_frozen, switched.energy_td),
        ("mean energy after td", switched.mean_after, switched.mean_after_reference),
        (
            "standard deviation after td",
            switched.spread_after,
            switched.spread_after_reference,
        ),
    ]
    return [
        (name, value, reference) for name, value, reference in rows if value is not None
    ]


def list_deviations(switched: Comparison) -> list[tuple[str, str]]:
    """Return how far the switched run deviates after td, and its other rigid windows, as (name, text) pairs."""
    error = switched.momentum_error
    displacement = switched.displacement
    rows = []
    if error is not None:
        rows.append(
            ("largest momentum error after td", f"{error:.2g} of the largest momentum")
        )
    if displacement is not None:
        rows.append(("largest displacement after td", f"{displacement:.3g}"))
    if switched.other_windows:
        others = [f"{tr:.6g} to {td:.6g}" for tr, td in switched.other_windows]
        rows.append(("rigid too, but not compared here", list_names(others)))
    return rows


def _format_comparison(switched: Comparison) -> list[str]:
    """Return the lines that compare the switched run with the reference run."""
    values = compare_values(switched)
    return [
        f"switched run  {make_printable(', '.join(switched.source))}; compared from td to {switched.end:.6g}",
        *([tables.as_text(COMPARED, values)] if values else []),
        *(f"{name.ljust(31)}  {text}" for name, text in list_deviations(switched)),
        *(f"note: {make_printable(note)}" for note in switched.notes),
    ]


def _list_switched_measures(answer: PairVerdict) -> dict[str, Any]:
    """Return the values of the switched run by name; empty if there is no switched run."""
    values = SWITCHED.plain(answer.switched) if answer.switched else {}
    values = {
        name: "; ".join(value) if name == "objections" else value
        for name, value in values.items()
    }
    return {
        f"switched_{name}": value
        for name, value in values.items()
        if name not in ("source", "notes", "other_windows")
    }
