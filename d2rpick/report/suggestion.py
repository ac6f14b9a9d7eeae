"""The answer of ``suggest`` as table, JSON, CSV, Markdown and bare value."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from d2rpick.base.errors import name_units
from d2rpick.choice.candidates import MUCH_HIGHER, Candidate
from d2rpick.histories.digits import format_window
from d2rpick.report import keys, tables
from d2rpick.report.fields import Document, Field, csv_of, many, maybe, row
from d2rpick.report.situation import heading

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from d2rpick.choice.aftermath import Kept
    from d2rpick.choice.answers import AcceptableWindow, Suggestion
    from d2rpick.choice.candidates import Pair
    from d2rpick.choice.quality import Grade, Quality
    from d2rpick.report.formats import Shown

# Windows of acceptable tr that a line names.
_NAMED = 4
_WINDOW: Final = row(
    *keys.WINDOW.fields, Field("recommended", "flag", "holds the recommended tr")
)
CANDIDATE: Final = row(
    *keys.CANDIDATE.fields, keys.MATCHES, name="candidate", later=(*keys.LATER, "parts")
)


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
    Field("candidates", many(CANDIDATE)),
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
_SPARE: Final = ("tolerance", "+-", "kind", "E(tr)/E(td)", "rank")
_IN_FULL: Final = ("kind", "L", "R")


def as_table(answer: Suggestion, shown: Shown) -> str:
    """The verdict, what it rests on, and the first candidates; the recommended row has a star.

    Where nothing is recommended the candidates stand there only if all is asked for.
    """
    lines = [
        *tables.in_line((*verdict(answer), *outlook(answer))),
        "",
        *tables.in_line(heading(answer.situation, verbose=shown.verbose)),
    ]
    if answer.candidates and (answer.recommended or shown.verbose):
        lines += ["", tables.as_text(*_some(answer, shown), shown.width, _SPARE)]
        left = len(answer.candidates) - shown.limit
        lines += [f"... and {left} more (--limit)"] * (left > 0)
    return "\n".join(lines)


def as_markdown(answer: Suggestion, shown: Shown) -> str:
    """The candidates as a Markdown table, and the verdict below it."""
    said = tables.listed((*verdict(answer), *outlook(answer)))
    return "\n\n".join([tables.as_markdown(*_some(answer, shown)), *said])


def _some(
    answer: Suggestion, shown: Shown
) -> tuple[list[str], list[list[tables.Cell]]]:
    """Give the first candidates, in the columns that hold something."""
    head, rows = tables.known(*table(answer, shown.limit))
    kept = [i for i, name in enumerate(head) if shown.verbose or name not in _IN_FULL]
    return [head[i] for i in kept], [[row[i] for i in kept] for row in rows]


def as_csv(answer: Suggestion, _: Shown) -> str:
    """All candidates, a column for each key of the JSON output but ``parts``, and the td they belong to."""
    columns = [*(key for key in keys.CANDIDATE.keys if key != "notes"), "td", "notes"]
    td = answer.situation.td
    return csv_of(
        columns, ({**keys.CANDIDATE.plain(one), "td": td} for one in answer.candidates)
    )


def headline(answer: Suggestion) -> str:
    """What the pair is called: a poor one of a td that was asked for is not recommended, it is the best it has."""
    bad = answer.td_window is None and answer.quality and answer.quality.grade == "poor"
    return "best of a bad td" if bad else "recommended"


def verdict(answer: Suggestion) -> list[tuple[str, str]]:
    """What to paste, what it saves, what it costs, and how sure that is; a name and a sentence each."""
    best, quality, better = answer.chosen, answer.quality, answer.clearly_better
    if best is None or quality is None:
        found = [("recommended", f"none: {answer.why_none}")]
    else:
        found = [
            (headline(answer), _pair(answer.recommended)),
            ("saves", _saved(best)),
            ("keeps", _kept(answer, best)),
            ("quality", _sure(best, quality)),
            *statements(quality),
        ]
    return (
        [*found, ("better pair", f"{_times(better)}: {better_about(answer, better)}")]
        if better
        else found
    )


def _saved(best: Candidate) -> str:
    return f"rigid for {best.rigid_fraction:.0%} of the record, {best.rigid_time:.6g}"


def _sure(best: Candidate, quality: Quality) -> str:
    """How good the pair is, why it is none better, and how exactly tr is known."""
    known = (
        ""
        if best.tr_high is None
        else f"; tr is known to ±{best.tr_high - best.tr:.1g}"
    )
    room = (
        ""
        if best.timing_tolerance is None
        else f" and may be off by {best.timing_tolerance:.1g}"
    )
    return f"{quality.told}{known}{room}"


def statements(quality: Quality) -> list[tuple[str, str]]:
    """What is said of motion and vibration, each by itself; nothing where both are good by themselves."""
    if quality.motion.grade == quality.alone.grade == "good":
        return []
    alone = quality.alone
    said = (
        alone.grade
        if alone.grade == quality.vibration.grade
        else f"{quality.vibration.grade}, by itself {alone.grade}"
    )
    worth = ""
    if quality.worth is not None:
        worth = f"; its error holds at most {quality.worth.share:.2g} of the energy of the next contact"
    return [
        ("motion", graded(quality.motion)),
        ("vibration", f"{graded(alone._replace(grade=said))}{worth}"),
    ]


def graded(grade: Grade) -> str:
    """Give a grade with the reasons why it is none better."""
    return f"{grade.grade}{': ' * bool(grade.reasons)}{'; '.join(grade.reasons)}"


def _kept(answer: Suggestion, best: Candidate) -> str:
    """What is left after td: of the mean energy, and of the vibration."""
    if answer.situation.at_rest:
        return "everything: nothing vibrates in the flight up to td"
    kept, found = answer.kept, []
    if kept is not None:
        found.append(f"{mean_energy(kept)} of the mean energy after td")
    if best.residual is not None:
        found.append(f"the vibration is off by {_off(best)}")
    if answer.situation.vibration.keeps_nothing:
        found.append("no switch keeps this vibration")
    return "; ".join(found) or "unknown"


def mean_energy(kept: Kept) -> str:
    """Give the bounds of the mean energy after td, one number if they read alike."""
    low, high = f"{kept.low:.0%}", f"{kept.high:.0%}"
    return low if low == high else f"{low} to {high}"


def _off(best: Candidate) -> str:
    """Give the residual, with its band where that is wide."""
    low, high = best.residual_low, best.residual_high
    if (
        best.residual is None
        or low is None
        or high is None
        or high <= best.residual + MUCH_HIGHER
    ):
        return f"{best.residual:.1%}"
    return f"{best.residual:.0%}, between {low:.0%} and {high:.0%}"


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
    if best and best.run_time_share is not None:
        lines.append(
            ("run time", f"about {best.run_time_share:.0%} of the reference's")
        )
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
        "E(tr)/E(td)": lambda c: c.energy_ratio,
        "sign": lambda c: {True: "same", False: "opposite", None: None}[c.sign_match],
        "L": lambda c: tables.measure(c.lock_in_error),
        "R": lambda c: tables.measure(c.residual),
        "tolerance": lambda c: tables.shown(c.timing_tolerance, ".1e"),
        "rigid": lambda c: c.rigid_time,
        "verdict": lambda c: (
            headline(answer)
            if c.recommended
            else "acceptable"
            if c.acceptable
            else c.notes[0]
        ),
    }
    return tables.filled(columns, answer.candidates[:limit])


def _pair(pair: Pair | None) -> str:
    if pair is None:
        return "none"
    residual = (
        "" if pair.residual is None else f", residual {tables.measure(pair.residual)}"
    )
    return f"{_times(pair)}{residual}"


def _times(pair: Pair) -> str:
    return f"tr = {pair.tr:.6g}, td = {pair.td:.6g}"
