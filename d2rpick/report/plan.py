"""The answer of ``plan`` as table, JSON, CSV, Markdown and bare values."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from d2rpick.errors import printable
from d2rpick.report import tables
from d2rpick.report.situation import frame_of, what_was_read

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.choice.plan import Plan, Planned

SCHEMA = "d2rpick/plan/1"
HEAD = (
    "", "flight", "from", "to", "margin", "tr", "td", "rigid", "of record", "run time", "error", "out of place",
    "quality", "status",
)  # fmt: skip

# Keys of a window in JSON, and columns of the csv.
WINDOW = (
    "flight", "flight_start", "flight_end", "flight_source", "certain", "status", "reason", "tr", "td", "rigid_time",
    "rigid_fraction", "run_time_share", "locks_in", "basis", "kind", "level_error", "lock_in_error", "residual",
    "kinetic_share", "margin", "margin_source", "landing_spread", "landing", "landing_planned", "position_error",
    "position_error_part", "position_error_body", "position_error_assumes", "quality", "position_error_is_lower_bound",
)  # fmt: skip


def as_table(plan: Plan) -> str:
    """What was read, a row per flight, what the supported windows save, and why others are not supported."""
    table = tables.as_text(head(plan), rows(plan)) if plan.rows else "no flight"
    named = [f"flight {row.number}  {printable(row.reason)}" for row in plan.rows if row.reason]
    told = [f"{name.ljust(9)}  {printable(text)}" for name, text in outlook(plan)]
    lines = [heading(plan), "", table, "", *told, *named]
    return "\n".join(lines)


def as_markdown(plan: Plan) -> str:
    """The flights as a Markdown table, and below it what is saved, and why windows are not supported."""
    named = [(f"flight {row.number}", row.reason) for row in plan.rows if row.reason]
    told = [f"{name}: {tables.in_markdown(text)}" for name, text in (*outlook(plan), *named)]
    return "\n\n".join([tables.as_markdown(head(plan), rows(plan)), *told])


def as_csv(plan: Plan) -> str:
    """A row per flight, a column for each key of ``windows`` in the JSON output."""
    return tables.as_csv(WINDOW, (list(window(plan, row).values()) for row in plan.rows)).rstrip("\n")


def as_json(plan: Plan, command: Sequence[str]) -> str:
    """The whole plan by schema d2rpick/plan/1."""
    return tables.as_json(
        {
            **frame_of(plan.history, plan.settings, SCHEMA, command, plan.cautions),
            "min_rigid": plan.min_rigid,
            "windows": [window(plan, row) for row in plan.rows],
            "rigid_time": plan.rigid_time,
            "rigid_fraction": plan.rigid_fraction,
            "run_time_share": plan.run_time_share,
        }
    )


def as_value(plan: Plan, *, every: bool = False) -> str:
    """A line ``tr td`` for each window of the next run, in the shortest digits that read back.

    Those that are done, and the supported ones, or ``every`` new one; nothing where none is new.
    """
    return "\n".join(f"{tr!r} {td!r}" for tr, td in plan.next_run(every=every))


def window(plan: Plan, row: Planned) -> dict[str, Any]:
    """Keys of one flight and its window in JSON."""
    best, times, done = row.candidate, row.window, row.done
    situation = row.answer.situation if row.answer and times else None
    span = float(plan.history.time[-1] - plan.history.time[0])
    return {
        "flight": row.number,
        "flight_start": row.start,
        "flight_end": row.flight.end,
        "flight_source": row.flight.source,
        "certain": row.flight.certain,
        "status": row.status,
        "reason": row.reason,
        "tr": times[0] if times else None,
        "td": times[1] if times else None,
        "rigid_time": row.rigid_time,
        "rigid_fraction": None if row.rigid_time is None else row.rigid_time / span,
        "run_time_share": best.run_time_share if best else None,
        "locks_in": row.locks_in,
        "basis": situation.basis if situation else None,
        "kind": best.kind if best else None,
        "level_error": best.level_error if best else None,
        "lock_in_error": best.lock_in_error if best else None,
        "residual": best.residual if best else None,
        "kinetic_share": situation.kinetic_share if situation else None,
        "margin": None if done else row.margin.time,
        "margin_source": None if done else row.margin.source,
        "landing_spread": None if done else row.margin.spread,
        "landing": done.landing if done else None,
        "landing_planned": done.planned if done else None,
        "position_error": best.position_error if best else None,
        "position_error_part": best.position_error_part if best else None,
        "position_error_body": best.position_error_body if best else None,
        "position_error_assumes": best.position_error_assumes if best else None,
        "quality": row.quality.grade if row.quality else None,
        "position_error_is_lower_bound": best.position_error_is_lower_bound if best else None,
    }


def heading(plan: Plan) -> str:
    """What was read."""
    return f"history   {what_was_read(plan.history)}"


def outlook(plan: Plan) -> list[tuple[str, str]]:
    """What the supported windows save, and what comes next; a name and a sentence each."""
    supported, waiting = plan.supported, [row for row in plan.rows if row.status == "re-plan"]
    if not supported:
        return [("supported", "no window")]
    count = "1 window" if len(supported) == 1 else f"{len(supported)} windows"
    lines = [("supported", f"{count}, rigid for {plan.rigid_time:.6g}, {plan.rigid_fraction:.0%} of the record")]
    if plan.run_time_share is not None:
        lines.append(("run time", f"about {plan.run_time_share:.0%} of the reference's"))
    lines += [(f"flight {row.number}", given_up(row)) for row in supported if row.answer and row.answer.longer]
    graded = [(f"flight {row.number}", row.quality) for row in supported if row.quality]
    lines += [(name, quality.told) for name, quality in graded if quality.grade == "poor"]
    if any(row.candidate and row.candidate.position_error_assumes for row in plan.rows):
        told = "; `deck` tells which do" if plan.settings.bodies is None else ""
        lines.append(("place", f"out of place as listed if the parts become one rigid body{told}"))
    if waiting or plan.done:
        what = "with those that are done and these" if plan.done else "with these windows"
        after = ", and plan the others from that run (--done)" if waiting else ""
        lines.append(("next", f"run from the start {what}{after}"))
    return lines


def given_up(row: Planned) -> str:
    """How much rigid time of a window was given up for quality."""
    from d2rpick.report.suggestion import given_up as told

    assert row.answer is not None
    assert row.answer.longer is not None
    assert row.answer.recommended is not None
    return told(row.answer.longer, row.answer.recommended)


def head(plan: Plan) -> list[str]:
    """Columns of the table; run time and place only where they are known."""
    unknown = {"run time"} if plan.settings.cost_share is None else set()
    unknown |= set() if _placed(plan) else {"out of place"}
    return [name for name in HEAD if name not in unknown]


def rows(plan: Plan) -> list[list[tables.Cell]]:
    """Cells of all flights, below ``head``; those of supported windows have a star."""
    span = float(plan.history.time[-1] - plan.history.time[0])
    return [
        [
            "*" if row.status == "supported" else " ",
            row.number,
            row.start,
            "end of record" if row.flight.end is None else row.flight.end,
            "-" if row.done else f"{row.margin.time:.3g}",
            row.window[0] if row.window else None,
            row.window[1] if row.window else None,
            row.rigid_time,
            None if row.rigid_time is None else f"{row.rigid_time / span:.0%}",
            *([] if plan.settings.cost_share is None else [_run_time(row)]),
            error(row),
            *([_place(row)] if _placed(plan) else []),
            row.quality.grade if row.quality else None,
            row.status,
        ]
        for row in plan.rows
    ]


def error(row: Planned) -> str | None:
    """How well the pair of a window matches, in a word or two."""
    best = row.candidate
    if best is None:
        return None
    if best.kind == "start":
        return "nothing vibrates"
    name, off = ("level error", best.level_error) if best.residual is None else ("residual", best.residual)
    return f"{name} {tables.measure(off)}"


def _placed(plan: Plan) -> bool:
    """Whether it is known of any window how far a rigid body is out of place."""
    return any(row.candidate and row.candidate.position_error is not None for row in plan.rows)


def _place(row: Planned) -> str | None:
    """How far a rigid body is out of place at td [length]."""
    best = row.candidate
    if best is None or best.position_error is None:
        return None
    least = ">= " if best.position_error_is_lower_bound else ""
    return f"{least}{best.position_error:.2g}{' if one body' if best.position_error_assumes else ''}"


def _run_time(row: Planned) -> str | None:
    """Run time with this window alone."""
    share = row.candidate.run_time_share if row.candidate else None
    return None if share is None else f"{share:.0%}"
