"""The answer of ``suggest`` as table, JSON, CSV, Markdown and bare value."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.report import keys, tables
from d2rpick.report.situation import frame, heading, mechanics

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.choice.suggest import AcceptableWindow, Pair, Suggestion

SCHEMA = "d2rpick/suggest/1"
# Windows of acceptable tr that a line names.
_NAMED = 4
HEAD = ("", "rank", "tr", "+-", "kind", "E(tr)/E(td)", "sign", "L", "R", "tolerance", "rigid", "verdict")


def as_table(answer: Suggestion, limit: int) -> str:
    """Heading, the first ``limit`` candidates, the recommended and the better pair; the recommended row has a star."""
    table = tables.as_text(HEAD, rows(answer, limit)) if answer.candidates else "no candidates"
    lines = [*heading(answer.situation), "", table]
    left = len(answer.candidates) - limit
    if left > 0:
        lines.append(f"... and {left} more (--limit)")
    lines += ["", f"recommended  {_pair(answer.recommended)}", f"better pair  {_pair(answer.better_pair)}"]
    lines += [f"{name.ljust(11)}  {text}" for name, text in outlook(answer)]
    return "\n".join(lines)


def as_markdown(answer: Suggestion, limit: int) -> str:
    """The candidates as a Markdown table, and the two pairs below it."""
    table = tables.as_markdown(HEAD, rows(answer, limit))
    lines = [("recommended", _pair(answer.recommended)), ("better pair", _pair(answer.better_pair)), *outlook(answer)]
    return "\n\n".join([table, *(f"{name}: {text}" for name, text in lines)])


def as_csv(answer: Suggestion) -> str:
    """All candidates, a column for each key of the JSON output but ``parts``, and the td they belong to."""
    names = [name for name in keys.CANDIDATE if name != "notes"]
    cells = (
        [*(keys.CANDIDATE[name](c) for name in names), answer.situation.td, "; ".join(c.notes)]
        for c in answer.candidates
    )
    return tables.as_csv([*names, "td", "notes"], cells).rstrip("\n")


def as_json(answer: Suggestion, command: Sequence[str]) -> str:
    """The whole answer by schema d2rpick/suggest/1."""
    recommended = answer.recommended
    return tables.as_json(
        {
            **frame(answer.situation, SCHEMA, command, answer.cautions),
            "td": answer.situation.td,
            "td_window": list(answer.td_window) if answer.td_window else None,
            "longer_pair": keys.of_pair(answer.longer),
            **mechanics(answer.situation),
            "candidates": [{**keys.of_candidate(c), "parts": keys.of_matches(c.parts)} for c in answer.candidates],
            "acceptable_windows": None
            if answer.windows is None
            else [
                {
                    "start": w.start,
                    "end": w.end,
                    "share": w.share,
                    "recommended": holds(w, recommended.tr if recommended else None),
                }
                for w in answer.windows
            ],
            "recommended": {"tr": recommended.tr, "td": recommended.td} if recommended else None,
            "health": keys.of_health(answer.health),
            "expected": keys.of_expected(answer.expected),
            "better_td": keys.of_pair(answer.better_pair),
        }
    )


def outlook(answer: Suggestion) -> list[tuple[str, str]]:
    """What can be expected of the recommended pair, a name and a sentence each."""
    chosen = answer.recommended.tr if answer.recommended else None
    lines = [("acceptable", acceptable(answer.windows, chosen))] if answer.windows else []
    best = answer.chosen
    if best and best.run_time_share is not None:
        rigid = f"rigid for {best.rigid_fraction:.0%} of the record"
        lines.append(("run time", f"about {best.run_time_share:.0%} of the reference's, {rigid}"))
    if answer.longer and answer.recommended:
        lines.append(("longer", given_up(answer.longer, answer.recommended)))
    expected = answer.expected
    if expected:
        at_level = f"{expected.ratio_at_level:.0%} with the energy of td"
        own = (
            ""
            if expected.ratio is None
            else f"{expected.ratio:.0%} of the reference's ({expected.ratio_low:.0%} if all of it vibrates), "
        )
        lines.append(("mean after", f"about {own}{at_level}; mean in flight {expected.mean_energy:.6g}"))
    return lines


def given_up(longer: Pair, chosen: Pair) -> str:
    """How much rigid time was given up for a better level or residual, and for which."""
    what = "a lower level at td" if longer.residual is None else f"residual {tables.measure(longer.residual)}"
    lost = longer.rigid_time - chosen.rigid_time
    times = f"tr = {longer.tr:.6g}, td = {longer.td:.6g} is rigid for {longer.rigid_time:.6g}"
    return f"{times}, with {what}: {lost:.6g} ({lost / longer.rigid_time:.0%}) is given up for quality"


def acceptable(windows: Sequence[AcceptableWindow], tr: float | None) -> str:
    """The windows of acceptable tr: the one with the recommended tr, the longest others, and what they share."""
    named = sorted(windows, key=lambda one: (not holds(one, tr), one.start - one.end))[:_NAMED]
    share = sum(one.share for one in windows)
    shown = [f"{w.start:.6g} to {w.end:.6g} ({w.share:.1%}{', recommended' * holds(w, tr)})" for w in named]
    more = f" and {len(windows) - len(named)} shorter windows" if len(windows) > len(named) else ""
    return f"every tr from {'; '.join(shown)}{more}; in all {share:.0%} of the flight up to td"


def holds(window: AcceptableWindow, tr: float | None) -> bool:
    """Whether the recommended tr lies in a window."""
    return tr is not None and window.start <= tr <= window.end


def as_value(answer: Suggestion) -> str:
    """The recommended tr, and td where it was chosen too, in the shortest digits that read back; empty without one."""
    pair = answer.recommended
    if pair is None:
        return ""
    return f"{pair.tr!r} {pair.td!r}" if answer.td_window else repr(pair.tr)


def rows(answer: Suggestion, limit: int) -> list[list[tables.Cell]]:
    """Cells of the first ``limit`` candidates, below ``HEAD``."""
    return [
        [
            "*" if c.recommended else " ",
            c.rank,
            c.tr,
            None if c.tr_low is None or c.tr_high is None else f"{(c.tr_high - c.tr_low) / 2:.1e}",
            c.kind,
            c.energy_ratio,
            None if c.sign_match is None else "same" if c.sign_match else "opposite",
            tables.measure(c.lock_in_error),
            tables.measure(c.residual),
            None if c.timing_tolerance is None else f"{c.timing_tolerance:.1e}",
            c.rigid_time,
            "recommended" if c.recommended else "acceptable" if c.acceptable else c.notes[0],
        ]
        for c in answer.candidates[:limit]
    ]


def _pair(pair: Pair | None) -> str:
    if pair is None:
        return "none"
    residual = "" if pair.residual is None else f", residual {tables.measure(pair.residual)}"
    return f"tr = {pair.tr:.6g}, td = {pair.td:.6g}{residual}"
