"""The answer of ``suggest`` as table, JSON, CSV, Markdown and bare value."""

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

# Windows of acceptable tr that a line names.
_NAMED = 4
_WINDOW: Final = row(
    *keys.WINDOW.fields, Field("recommended", "flag", "holds the recommended tr")
)
# A candidate, and the decision on it.
CANDIDATE: Final = row(
    *keys.CANDIDATE.of_part(lambda one: one[0]),
    keys.MATCHES._replace(get=lambda one: one[0].parts),
    *keys.DECIDED.of_part(lambda one: one[1], ("verdict", "verdict_reason", "cure")),
    name="candidate",
    later=(*keys.LATER, "parts", "verdict", "verdict_reason", "cure"),
)


def _decided(answer: Suggestion) -> list[tuple[Candidate, Decision]]:
    """Give the candidates, each with the decision on it."""
    return [(one, answer.decision_on(one)) for one in answer.candidates]


def _windows(answer: Suggestion) -> list[dict[str, Any]] | None:
    """Give the windows of acceptable tr, and which of them holds the recommended one."""
    tr = answer.recommended.tr if answer.recommended else None
    windows = answer.windows
    return (
        None
        if windows is None
        else [{**one._asdict(), "recommended": holds(one, tr)} for one in windows]
    )


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


# Columns that are left out first where a table would be too wide, and those that only a close look asks for.
_SPARE: Final = ("timing tolerance", "+-", "kind", "E(tr)/E(td)", "rank")
_IN_FULL: Final = ("rank", "kind", "+-", "lock-in error")


def as_table(answer: Suggestion, shown: Shown) -> str:
    """The verdict, what it rests on, and the first candidates; the recommended row has a star.

    Where nothing is recommended the candidates stand there only if all is asked for.
    """
    above = heading(answer.situation, verbose=shown.verbose)
    lines = [
        *tables.in_line((*verdict(answer), *next_step(answer))),
        "",
        *tables.in_line((*facts(answer), *outlook(answer), *above)),
    ]
    if answer.candidates and (answer.recommended or shown.verbose):
        lines += ["", tables.as_text(*_some(answer, shown), shown.width, _SPARE)]
        left = len(answer.candidates) - shown.limit
        lines += [f"... and {left} more (--limit)"] * (left > 0)
    return "\n".join(lines)


def as_markdown(answer: Suggestion, shown: Shown) -> str:
    """The verdict, the candidates as a Markdown table, and below it what the verdict rests on."""
    above = tables.listed((*verdict(answer), *next_step(answer)))
    below = tables.listed((*facts(answer), *outlook(answer)))
    table = tables.as_markdown(*_some(answer, shown))
    return "\n\n".join([*above, table, *below])


def _some(
    answer: Suggestion, shown: Shown
) -> tuple[list[str], list[list[tables.Cell]]]:
    """Give the first candidates, in the columns that hold something."""
    head, rows = tables.known(*table(answer, shown.limit))
    kept = [i for i, name in enumerate(head) if shown.verbose or name not in _IN_FULL]
    return [head[i] for i in kept], [[row[i] for i in kept] for row in rows]


def as_csv(answer: Suggestion, _: Shown) -> str:
    """All candidates, a column for each key of the JSON output but ``parts``, and the td they belong to."""
    left_out = ("notes", "parts")
    columns = [*(key for key in CANDIDATE.keys if key not in left_out), "td", "notes"]
    td = answer.situation.td
    return csv_of(
        columns, ({**CANDIDATE.plain(one), "td": td} for one in _decided(answer))
    )


def verdict(answer: Suggestion) -> list[tuple[str, str]]:
    """What to do with the recommended pair, why, and what comes after td; a name and a sentence each."""
    best, decision, better = answer.chosen, answer.decision, answer.clearly_better
    lines = [("no pair to use", answer.why_none)]
    if best and decision:
        lines = headed(decision, best.tr, answer.td)
    if better and not (decision and decision.better):
        lines.append(
            ("better pair", f"{_times(better)}: {better_about(answer, better)}")
        )
    return lines


def facts(answer: Suggestion) -> list[tuple[str, str]]:
    """What the verdict rests on, how long the parts are rigid, and how exactly tr is known."""
    best, decision = answer.chosen, answer.decision
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
    """What to type next: for a pair that can be used."""
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
    """What is better about the better pair."""
    own = answer.recommended
    if own is None:
        return "there an acceptable tr exists"
    if better.residual is not None and own.residual is not None:
        return f"residual {tables.measure(better.residual)} instead of {tables.measure(own.residual)}"
    level, here = (
        answer.situation.vibration.whole.energy(better.td),
        answer.situation.energy_td,
    )
    return f"the energy there is {level / here:.3g} times as high, so that more of the vibration can be kept"


def outlook(answer: Suggestion) -> list[tuple[str, str]]:
    """What else there is to choose from; a name and a sentence each."""
    chosen = answer.recommended.tr if answer.recommended else None
    lines = (
        [("acceptable", acceptable(answer.windows, chosen))] if answer.windows else []
    )
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
    """How far a body is out of place at td, why, and what that takes for granted, with a ``deck`` or without."""
    assert best.position_error is not None
    taken = f" if {best.position_error_assumes}" if best.position_error_assumes else ""
    taken += " (`deck` tells which do)" if taken and not deck else ""
    if best.position_error_part is None:
        return f"in place at td{taken}, as far as parts tell: none moves against the others of its rigid body"
    parts = best.position_error_body
    body = f", the body of {name_units(map(int, parts.split(',')))}" if parts else ""
    least = "at least " if best.position_error_is_lower_bound else ""
    return f"off by {least}{best.position_error:.2g} at td{body}{taken}: {best.position_error_part} is frozen elsewhere"


def given_up(longer: Pair, chosen: Pair) -> str:
    """How much rigid time was given up for a better level or residual, and for which."""
    what = (
        "a lower level at td"
        if longer.residual is None
        else f"residual {tables.measure(longer.residual)}"
    )
    lost = longer.rigid_time - chosen.rigid_time
    times = f"tr = {longer.tr:.6g}, td = {longer.td:.6g} is rigid for {longer.rigid_time:.6g}"
    return f"{times}, with {what}: {lost:.6g} ({lost / longer.rigid_time:.0%}) is given up for quality"


def acceptable(windows: Sequence[AcceptableWindow], tr: float | None) -> str:
    """The windows of acceptable tr: the one with the recommended tr, the longest others, and what they share."""
    share = sum(one.share for one in windows)
    if len(windows) == 1:
        return f"every tr from {format_window(*windows[0][:2])}, {share:.0%} of the flight up to td"
    named = sorted(windows, key=lambda one: (not holds(one, tr), one.start - one.end))[
        :_NAMED
    ]
    shown = [
        f"{format_window(w.start, w.end)} ({w.share:.1%}{', recommended' * holds(w, tr)})"
        for w in named
    ]
    more = (
        f" and {len(windows) - len(named)} shorter windows"
        if len(windows) > len(named)
        else ""
    )
    return f"every tr from {'; '.join(shown)}{more}; in all {share:.0%} of the flight up to td"


def holds(window: AcceptableWindow, tr: float | None) -> bool:
    """Whether the recommended tr lies in a window."""
    return tr is not None and window.start <= tr <= window.end


def as_value(answer: Suggestion, _: Shown) -> str:
    """The recommended tr, and td where it was chosen too, in the shortest digits that read back; empty without one."""
    pair = answer.recommended
    if pair is None:
        return ""
    return f"{pair.tr!r} {pair.td!r}" if answer.td_window else repr(pair.tr)


def table(answer: Suggestion, limit: int) -> tuple[list[str], list[list[tables.Cell]]]:
    """Give names of columns and cells of the first ``limit`` candidates."""
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
