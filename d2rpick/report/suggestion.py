"""Write the result of ``suggest`` as a table, JSON, CSV, Markdown and a bare value."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from d2rpick.base.errors import name_units
from d2rpick.choice.grades import DO_NOT_USE
from d2rpick.histories.digits import format_window
from d2rpick.report import keys, tables
from d2rpick.report.decision import (
    accuracy,
    headed,
    in_short,
    rigid_for,
    saving,
    statements,
)
from d2rpick.report.fields import Document, Field, csv_of, many, maybe, row
from d2rpick.report.situation import heading

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from d2rpick.choice.answers import AcceptableWindow, Suggestion
    from d2rpick.choice.candidates import Candidate, Pair
    from d2rpick.choice.decision import Decision
    from d2rpick.report.formats import Shown

# largest number of windows of acceptable tr that a line names
_NAMED = 4
_WINDOW: Final = row(
    *keys.WINDOW.fields, Field("recommended", "flag", "holds the recommended tr")
)
# a candidate and the decision on it
CANDIDATE: Final = row(
    *keys.CANDIDATE.of_part(lambda candidate_and_decision: candidate_and_decision[0]),
    keys.MATCHES._replace(
        get=lambda candidate_and_decision: candidate_and_decision[0].parts
    ),
    *keys.DECIDED.of_part(
        lambda candidate_and_decision: candidate_and_decision[1],
        ("verdict", "verdict_reason", "cure"),
    ),
    name="candidate",
    later=(*keys.LATER, "parts", "verdict", "verdict_reason", "cure"),
)

# Columns that are left out first if a table would be too wide, and those shown only with ``verbose``.
_SPARE: Final = ("timing tolerance", "+-", "kind", "E(tr)/E(td)", "rank")
_IN_FULL: Final = ("rank", "kind", "+-", "lock-in error")


def _decided(answer: Suggestion) -> list[tuple[Candidate, Decision]]:
    """Return each candidate with the decision on it."""
    return [
        (candidate, answer.decision_on(candidate)) for candidate in answer.candidates
    ]


def _windows(answer: Suggestion) -> list[dict[str, Any]] | None:
    """Return the windows of acceptable tr, and which of them contains the recommended tr."""
    tr = answer.recommended.tr if answer.recommended else None
    windows = answer.windows
    if windows is None:
        return None
    return [
        {**window._asdict(), "recommended": holds(window, tr)} for window in windows
    ]


DOCUMENT: Final = Document("d2rpick/suggest/1", "Answer of d2rpick suggest; times in the unit of the history.", row(
    *keys.FRAME,
    Field("td", "number"),
    Field("td_window", "span?",
          "where td was chosen: --td-window, or the longest flight; null where it was given"),
    Field("longer_pair", maybe(keys.PAIR),
          "the longest acceptable pair in td_window, where much rigid time was given up for quality",
          lambda answer: answer.longer),
    *keys.MECHANICS.of_part(lambda answer: answer.situation),
    Field("candidates", many(CANDIDATE), get=_decided),
    Field("acceptable_windows", maybe(many(_WINDOW)),
          "on basis energy: windows in which every tr is acceptable, null on another basis", _windows),
    Field("recommended", maybe(keys.TIMES)),
    *keys.QUALITY,
    keys.HEALTH,
    keys.EXPECTED,
    Field("better_td", maybe(keys.PAIR), "null where there is none, or it is the recommended one",
          lambda answer: answer.better_pair),
    later=("health", "kinetic_share_estimated", "modes", "unsigned_parts", "td_window", "expected", "quality",
           "quality_reasons"),
))  # fmt: skip


def as_table(answer: Suggestion, display: Shown) -> str:
    """Return the verdict, its evidence, and the first candidates; the recommended row has a star.

    If nothing is recommended, candidates are listed only if all details are asked for.
    """
    above = heading(answer.situation, verbose=display.verbose)
    lines = [
        *tables.in_line((*verdict(answer), *next_step(answer))),
        "",
        *tables.in_line((*facts(answer), *outlook(answer), *above)),
    ]
    if answer.candidates and (answer.recommended or display.verbose):
        lines += ["", tables.as_text(*_some(answer, display), display.width, _SPARE)]
        hidden_count = len(answer.candidates) - display.limit
        lines += [f"... and {hidden_count} more (--limit)"] * (hidden_count > 0)
    return "\n".join(lines)


def as_markdown(answer: Suggestion, display: Shown) -> str:
    """Return the verdict, the candidates as a Markdown table, and the evidence for the verdict below it."""
    above = tables.listed((*verdict(answer), *next_step(answer)))
    below = tables.listed((*facts(answer), *outlook(answer)))
    table = tables.as_markdown(*_some(answer, display))
    return "\n\n".join([*above, table, *below])


def _some(
    answer: Suggestion, display: Shown
) -> tuple[list[str], list[list[tables.Cell]]]:
    """Return the first candidates, without empty columns."""
    head, rows = tables.known(*table(answer, display.limit))
    shown_columns = [
        i for i, name in enumerate(head) if display.verbose or name not in _IN_FULL
    ]
    return [head[i] for i in shown_columns], [
        [row[i] for i in shown_columns] for row in rows
    ]


def as_csv(answer: Suggestion, _: Shown) -> str:
    """Return CSV with all candidates, a column for each key of the JSON output but ``parts``, and the td."""
    left_out = ("notes", "parts")
    columns = [*(key for key in CANDIDATE.keys if key not in left_out), "td", "notes"]
    td = answer.situation.td
    return csv_of(
        columns,
        ({**CANDIDATE.plain(candidate), "td": td} for candidate in _decided(answer)),
    )


def verdict(answer: Suggestion) -> list[tuple[str, str]]:
    """Return what to do with the recommended pair, why, and what to expect after td, each with its name."""
    best = answer.chosen
    decision = answer.decision
    better = answer.clearly_better
    lines = [("no pair to use", answer.why_none)]
    if best and decision:
        lines = headed(decision, best.tr, answer.td)
    if better and not (decision and decision.better):
        lines.append(
            ("better pair", f"{_times(better)}: {better_about(answer, better)}")
        )
    return lines


def facts(answer: Suggestion) -> list[tuple[str, str]]:
    """Return the evidence for the verdict, the rigid time, and the accuracy of tr, each with its name."""
    best = answer.chosen
    decision = answer.decision
    if best is None or decision is None:
        return []
    lines = [*statements(decision), ("rigid for", rigid_for(best))]
    if saves := saving(best):
        lines.append(("saves", saves))
    if answer.situation.vibration.keeps_nothing:
        lines.append(("keeps", "no switch keeps this vibration"))
    if exact := accuracy(best):
        lines.append(("tr", exact))
    return lines


def next_step(answer: Suggestion) -> list[tuple[str, str]]:
    """Return the next command for a pair that can be used."""
    decision = answer.decision
    if decision is None or decision.verdict == DO_NOT_USE:
        return []
    return [
        (
            "next",
            "print the cards with -f card, or a page of the evidence with --report FILE",
        )
    ]


def better_about(answer: Suggestion, better: Pair) -> str:
    """Return in which respect the better pair is better."""
    recommended = answer.recommended
    if recommended is None:
        return "there an acceptable tr exists"
    if better.residual is not None and recommended.residual is not None:
        better_residual = tables.measure(better.residual)
        return f"residual {better_residual} instead of {tables.measure(recommended.residual)}"
    level = answer.situation.vibration.whole.energy(better.td)
    own_level = answer.situation.energy_td
    return f"the energy there is {level / own_level:.3g} times as high, so that more of the vibration can be kept"


def outlook(answer: Suggestion) -> list[tuple[str, str]]:
    """Return the alternatives to the recommended pair, as pairs of a name and a sentence."""
    chosen = answer.recommended.tr if answer.recommended else None
    if answer.windows:
        lines = [("acceptable", acceptable(answer.windows, chosen))]
    else:
        lines = []
    best = answer.chosen
    if best and best.position_error is not None:
        lines.append(
            (
                "position",
                position(best, deck=answer.situation.settings.bodies is not None),
            )
        )
    if answer.longer and answer.recommended:
        lines.append(("longer", given_up(answer.longer, answer.recommended)))
    return lines


def position(best: Candidate, *, deck: bool) -> str:
    """Return the position error of a body at td, its cause, and its assumptions, with or without a ``deck``."""
    assert best.position_error is not None
    taken = f" if {best.position_error_assumes}" if best.position_error_assumes else ""
    taken += " (`deck` tells which do)" if taken and not deck else ""
    if best.position_error_part is None:
        return f"in place at td{taken}, as far as parts tell: none moves against the others of its rigid body"
    parts = best.position_error_body
    body = f", the body of {name_units(map(int, parts.split(',')))}" if parts else ""
    bound_text = "at least " if best.position_error_is_lower_bound else ""
    size = f"{bound_text}{best.position_error:.2g}"
    return f"off by {size} at td{body}{taken}: {best.position_error_part} is frozen elsewhere"


def given_up(longer: Pair, chosen: Pair) -> str:
    """Return how much rigid time was given up for a better level or residual, and how much better it is."""
    if longer.residual is None:
        better_quality = "a lower level at td"
    else:
        better_quality = f"residual {tables.measure(longer.residual)}"
    lost = longer.rigid_time - chosen.rigid_time
    times = f"tr = {longer.tr:.6g}, td = {longer.td:.6g} is rigid for {longer.rigid_time:.6g}"
    return f"{times}, with {better_quality}: {lost:.6g} ({lost / longer.rigid_time:.0%}) is given up for quality"


def acceptable(windows: Sequence[AcceptableWindow], tr: float | None) -> str:
    """Return the windows of acceptable tr: that of the recommended tr, the longest others, and their total share."""
    share = sum(window.share for window in windows)
    if len(windows) == 1:
        return f"every tr from {format_window(*windows[0][:2])}, {share:.0%} of the flight up to td"
    named_windows = sorted(
        windows, key=lambda window: (not holds(window, tr), window.start - window.end)
    )[:_NAMED]
    window_texts = [
        f"{format_window(w.start, w.end)} ({w.share:.1%}{', recommended' * holds(w, tr)})"
        for w in named_windows
    ]
    if len(windows) > len(named_windows):
        shorter_text = f" and {len(windows) - len(named_windows)} shorter windows"
    else:
        shorter_text = ""
    return f"every tr from {'; '.join(window_texts)}{shorter_text}; in all {share:.0%} of the flight up to td"


def holds(window: AcceptableWindow, tr: float | None) -> bool:
    """Return True if the recommended tr lies in the window."""
    return tr is not None and window.start <= tr <= window.end


def as_value(answer: Suggestion, _: Shown) -> str:
    """Return the recommended tr, and td if it was chosen too, with the fewest digits that give the same number.

    Without a recommendation the text is empty.
    """
    pair = answer.recommended
    if pair is None:
        return ""
    return f"{pair.tr!r} {pair.td!r}" if answer.td_window else repr(pair.tr)


def table(answer: Suggestion, limit: int) -> tuple[list[str], list[list[tables.Cell]]]:
    """Return the column names and cells of the first ``limit`` candidates."""
    columns: dict[str, Callable[[Candidate], tables.Cell]] = {
        "": lambda c: "*" if c.recommended else " ",
        "rank": lambda c: c.rank,
        "tr": lambda c: c.tr,
        "+-": lambda c: tables.half(c.tr_low, c.tr_high),
        "kind": lambda c: c.kind,
        "E(tr)/E(td)": lambda c: c.level_ratio,
        "direction": lambda c: {True: "same", False: "opposite", None: None}[
            c.sign_match
        ],
        "lock-in error": lambda c: tables.measure(c.lock_in_error),
        "residual": lambda c: tables.measure(c.residual),
        "timing tolerance": lambda c: tables.shown(c.timing_tolerance, ".1e"),
        "rigid for": lambda c: c.rigid_time,
        "verdict": lambda c: _shorten_verdict(answer, c),
    }
    return tables.filled(columns, answer.candidates[:limit])


def _shorten_verdict(answer: Suggestion, candidate: Candidate) -> str:
    """Return the verdict on a candidate with its reason, unless the lines above the table give the same reason."""
    decision = answer.decision_on(candidate)
    answered = answer.decision
    if answered is not None and decision.reason == answered.reason:
        return decision.verdict
    return in_short(decision)


def _times(pair: Pair) -> str:
    return f"tr = {pair.tr:.6g}, td = {pair.td:.6g}"
