"""Write the result of ``parts`` as a table, JSON, CSV or Markdown."""

from __future__ import annotations

from math import isinf
from typing import TYPE_CHECKING, Any, Final

from d2rpick.base.errors import format_ranges, list_names, make_printable
from d2rpick.deck.engine_files import CAP_SHARE
from d2rpick.report import keys, tables
from d2rpick.report.decision import (
    format_saved_share,
    is_refused,
    list_verdict_lines,
)
from d2rpick.report.fields import (
    Document,
    Field,
    each,
    many,
    maybe,
    one_of,
    row,
    write_csv,
)
from d2rpick.report.formats import RepeatedQuestion
from d2rpick.report.next_step import name_deck_of_run, write_command

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from d2rpick.choice.parts.sets_of_parts import Parts, PartSet
    from d2rpick.choice.parts.switchable_parts import PartRow
    from d2rpick.report.formats import DisplayOptions

# Column names of the table of sets, and of the two tables between which the columns for parts are divided.
SETS = (
    "set",
    "parts",
    "tr",
    "td",
    "CPU time saved",
    "saved while rigid",
    "position error",
    "rotation error [deg]",
    "verdict",
)
TABLES = {
    "Parts": (
        "part",
        "title",
        "make rigid?",
        "flies",
        "deforms",
        "mean energy",
        "energy scatter",
        "why",
    ),
    "Elements": (
        "part",
        "title",
        "elements",
        "formulation",
        "material",
        "mass",
        "share of CPU time",
        "time step",
        "shares nodes with",
    ),
}

_COUNTS: Final = maybe(each("integer"))
_IN_FLIGHT: Final = row(
    Field(
        "energy",
        "number?",
        "mean internal energy in the flight",
        lambda part_set: part_set.mean,
    ),
    Field(
        "energy_change",
        "number?",
        "energy at the end of the flight minus energy at its start",
        lambda part_set: part_set.change,
    ),
    Field(
        "energy_scatter",
        "number?",
        "coefficient of variation of the energy in the flight",
        lambda part_set: part_set.scatter,
    ),
    Field("flies", "flag?", "true if the part flies with the other parts"),
    Field(
        "deforms",
        "flag?",
        "true if the standard deviation of the energy is at least 10 % of its mean",
    ),
)
# The fields for the behaviour of a part in flight describe the longest flight.
PART: Final = row(
    *keys.PART.fields,
    Field("elements", _COUNTS, "numbers of elements by kind; null without a deck"),
    Field("formulations", "texts", "element formulations"),
    Field("material", "text?", "material law; null without a deck"),
    Field(
        "kind",
        maybe(one_of("deformable", "rigid", "spring", "airbag", "void", "particles")),
        "type of the part, derived from its elements and material; null without a deck",
    ),
    Field("mass", "number?", "mass; null if unknown"),
    Field(
        "mass_source",
        maybe(one_of("history", "deck")),
        "source of the mass; null if it is unknown",
    ),
    *_IN_FLIGHT.of_part(lambda part: part.flight),
    Field(
        "cost_share",
        "number?",
        "cost of the elements of the part, relative to the cost of all elements",
    ),
    Field("smallest_step", "number?", "smallest stable time step"),
    Field(
        "step_source",
        maybe(one_of("deck", "glstat", "d3hsp")),
        "source of smallest_step; null if it is unknown",
    ),
    Field(
        "shares_nodes",
        maybe(many("integer")),
        "parts that share nodes with this part; null without a deck",
    ),
    Field(
        "verdict",
        one_of("switch", "merge", "keep", "unknown"),
        "whether to make the part rigid: yes (switch), yes with the part merge_with (merge), no (keep), or unknown",
    ),
    Field(
        "merge_with",
        "integer?",
        "lead part of the rigid body that this part must join; null for verdicts other than merge",
    ),
    Field("reasons", "texts", "reasons for the verdict"),
)

_HISTORY: Final = row(
    Field("source", "texts", "files of the history", lambda run: run.sources),
    Field(
        "sha256",
        "texts",
        "SHA-256 of each file",
        lambda run: [file.sha256() for file in run.files],
    ),
    Field(
        "format",
        "text",
        "file format; the formats of companion files are joined by ' + '",
        lambda run: " + ".join(database.format for database in run.databases),
    ),
    Field("notes", "texts", "what was left out or assumed when the files were read"),
)
_DECK: Final = row(
    *keys.FILES,
    Field(
        "solver", one_of("ls-dyna", "radioss"), "solver for which the deck was written"
    ),
    Field("parts", "integer", "number of parts", lambda deck: len(deck.parts)),
    Field(
        "elements",
        "integer",
        "number of elements",
        lambda deck: sum(sum(counts.values()) for counts in deck.counts.values()),
    ),
    Field("complete", "flag", "false if elements or parts may be missing"),
    Field("notes", "texts", "cards that d2rpick cannot read, or that switch parts"),
)
_WEIGHTS: Final = row(
    *keys.WEIGHTS,
    Field(
        "element_share",
        "number",
        "fraction of a time step of the deformable model that is spent on elements",
    ),
    Field("rigid_node", "number", "cost of a node of a rigid body"),
    Field("per_element", each("number"), "cost of an element by formulation"),
)
_FLIGHT: Final = row(
    Field("start", "number", "start of the flight"),
    Field("end", "number", "end of the flight"),
    Field("longest", "flag", "true for the longest flight"),
)
_MOST_SHOWN = 6
# Explanation of the position errors, if some sets have none and those of others are unknown.
_ZERO_BESIDE_UNKNOWN: Final = (
    "the error is 0 if each rigid body is a single part; it is unknown if a body has several parts, and the files do "
    "not show how they move relative to each other"
)
# Columns that are omitted, in this order, if a terminal is too narrow.
_SPARE: Final = (
    "material",
    "saved while rigid",
    "time step",
    "mass",
    "rotation error [deg]",
    "energy scatter",
)
# Advice if the history contains no parts.
_NAME_HISTORY_WITH_PARTS: Final = "name a history with parts: matsum or binout of LS-DYNA, T01 of Radioss with /TH/PART"
# Displayed verdicts on parts, keyed by verdict.
_VERDICTS: Final = {"switch": "yes", "keep": "no"}
# Displayed names of the sets, keyed by set name.
_SET_NAMES: Final = {
    "all that may": "all eligible parts",
    "all but what moves": "all eligible parts except loose ones",
    "heavy": "heaviest half by mass",
}


def is_limited_by_no_part(part_set: PartSet) -> bool | None:
    """Return True if no deformable part limits the time step; None if this is unknown."""
    return None if part_set.step_growth is None else isinf(part_set.step_growth)


SET: Final = row(
    Field("name", "text", "name of the set"),
    Field("recommended", "flag", "true for the recommended set"),
    Field("parts", many("integer"), "part numbers of the set"),
    Field("bodies", maybe(many(many("integer"))), "rigid bodies that the parts of the set form; null without a deck",
          lambda part_set: part_set.bodies or None),
    Field("elements", "integer?", "number of elements that are rigid while the set is rigid"),
    Field("element_fraction", "number?", "elements as a fraction of all elements of the deck; null without a deck"),
    Field("mass_fraction", "number?", "mass as a fraction of the mass of all flying parts; null if a mass is unknown"),
    Field("cost_share", "number?", "saved fraction of the CPU time of a time step while the set is rigid"),
    Field("step_growth", "number?", "smallest factor by which the time step may grow while the set is rigid",
          lambda part_set: None if is_limited_by_no_part(part_set) else part_set.step_growth),
    Field("step_free", "flag?", "true if no deformable element limits the time step while the set is rigid",
          is_limited_by_no_part),
    Field("tr", "number?", "time at which the set becomes rigid; null if no tr is recommended",
          lambda part_set: part_set.window and part_set.window[0]),
    Field("td", "number?", "time at which the set becomes deformable again; null if no tr is recommended",
          lambda part_set: part_set.window and part_set.window[1]),
    Field("rigid_fraction", "number?", "rigid time as a fraction of the simulated time"),
    keys.CANDIDATE.field("run_time_share")._replace(kind="number?"),
    Field("saving", "number?", "estimated saving of CPU time relative to the reference run"),
    keys.CANDIDATE.field("position_error")._replace(kind="number?"),
    Field("position_limit", "number?", "limit of the position error: 1 % of the distance travelled in flight"),
    Field("position_part", maybe(many(keys.PART)), "part that causes the position error, as a list of one part",
          lambda part_set: part_set.position_part and (part_set.position_part,)),
    Field("position_body", maybe(many("integer")),
          "parts of the displaced rigid body if there are several bodies; otherwise null",
          lambda part_set: part_set.position_body or None),
    keys.CANDIDATE.field("position_error_assumes")._replace(key="position_assumes"),
    Field("angle_error", "number?",
          "rotation error of the body at td [degrees]; null if unknown"),
    Field("reasons", "texts", "reasons why values of this set are unknown, and remarks on its position error"),
    keys.CANDIDATE.field("position_error_is_lower_bound")._replace(key="position_is_lower_bound"),
    *(field for field in keys.DECISION if field.key in ("verdict", "verdict_reason", "cure")),
)  # fmt: skip


def _list_flights(answer: Parts) -> list[dict[str, Any]]:
    facts = answer.facts
    return [
        {"start": span[0], "end": span[1], "longest": at == facts.longest}
        for at, span in enumerate(facts.flights)
    ]


DOCUMENT: Final = Document(
    "d2rpick/parts/1",
    "Answer of d2rpick parts; times, masses and energies in the units of the history.",
    row(
        keys.WARNINGS,
        Field(
            "history",
            _HISTORY,
            "history that the answer is based on",
            lambda answer: answer.files,
        ),
        Field(
            "deck",
            maybe(_DECK),
            "deck that the answer is based on; null without a deck",
            lambda answer: answer.inventory,
        ),
        Field(
            "weights",
            maybe(_WEIGHTS),
            "element costs that the estimate of the CPU time uses; null without a deck",
        ),
        Field(
            "step_ratio",
            "number",
            "time step while the parts are rigid, divided by the time step before (--step-ratio)",
            lambda answer: answer.settings.step_ratio,
        ),
        Field("flights", many(_FLIGHT), "flights of the run", _list_flights),
        Field(
            "parts",
            many(
                row(
                    *PART.fields,
                    Field(
                        "flights",
                        many(_IN_FLIGHT),
                        "values of the part in each flight, in the order of the list flights; the keys with the same "
                        "names in parts[] refer to the longest flight",
                    ),
                )
            ),
            "parts of the run or deck",
            lambda answer: answer.rows,
        ),
        Field("sets", many(SET), "sets of parts that were compared"),
        Field(
            "recommended",
            maybe(
                row(
                    Field("name", "text", "name of the set"),
                    Field("parts", many("integer"), "part numbers of the set"),
                )
            ),
            "recommended set; null if there is none",
        ),
    ),
    closed=True,
)


def as_table(answer: Parts, display: DisplayOptions) -> str:
    """Return the recommended set, the next command, a table of the sets, two tables of the parts, and the input."""
    lines = tables.format_in_line(
        (*list_verdict_on_set(answer), *list_next_step(answer, display.question))
    )
    if answer.sets:
        lines += [
            "",
            tables.as_text(*build_set_table(answer, SETS), display.width, _SPARE),
        ]
    for names in TABLES.values():
        head, body = tables.select_known_columns(*build_part_table(answer, names))
        if body and {*head} - {"", "part", "title"}:
            lines += ["", tables.as_text(head, body, display.width, _SPARE)]
    below = [*list_remarks(answer), *list_heading(answer)]
    return "\n".join([*lines, "", *tables.format_in_line(below)])


def as_markdown(answer: Parts, display: DisplayOptions) -> str:
    """Return the recommended set, the sets and the parts as Markdown tables, and the input."""
    sets = [tables.as_markdown(*build_set_table(answer))] if answer.sets else []
    above = tables.format_as_list(
        (*list_verdict_on_set(answer), *list_next_step(answer, display.question))
    )
    below = tables.format_as_list(list_remarks(answer))
    return "\n\n".join(
        [*above, *sets, tables.as_markdown(*build_part_table(answer)), *below]
    )


def as_csv(answer: Parts, _: DisplayOptions) -> str:
    """Return CSV with a row per part and a column for each key of ``parts`` in the JSON output; lists use ``;``."""
    return write_csv(PART.keys, map(PART.plain, answer.rows), ";")


def as_value(answer: Parts, _: DisplayOptions) -> str:
    """Return the part ids of the recommended set in the form of ``--part``; empty if no set is recommended."""
    return ",".join(map(str, answer.recommended.parts)) if answer.recommended else ""


def list_heading(answer: Parts) -> list[tuple[str, str]]:
    """Return descriptions of the input, as (name, description) pairs."""
    run = answer.files
    deck = answer.inventory
    formats = " + ".join(database.format for database in run.databases)
    lines = [
        (
            "history",
            f"{', '.join(run.sources)}: {formats}, {format_count(len(run.parts), 'part')}",
        )
    ]
    if deck is None:
        lines.append(("deck", "none"))
    else:
        number = sum(sum(counts.values()) for counts in deck.counts.values())
        lines.append(
            (
                "deck",
                f"{deck.solver}, {format_count(len(deck.parts), 'part')}, {format_count(number, 'element')}",
            )
        )
    longest = answer.facts.longest
    if longest is not None:
        start, end = answer.facts.flights[longest]
        lines.append(
            (
                "flight",
                f"{start:.6g} to {end:.6g}, the longest of {len(answer.facts.flights)}",
            )
        )
    return [(name, make_printable(text)) for name, text in lines]


def build_part_table(
    answer: Parts, names: Iterable[str] = ()
) -> tuple[list[str], list[list[tables.Cell]]]:
    """Return header and rows of a table of parts with the given columns; parts of the recommended set have a star."""
    best = set(answer.recommended.parts) if answer.recommended else set()
    columns = {name: COLUMNS[name] for name in names or COLUMNS}
    return tables.fill_table(
        {"": lambda row: "*" if row.id in best else " ", **columns}, answer.rows
    )


def build_set_table(
    answer: Parts, names: Iterable[str] = ()
) -> tuple[list[str], list[list[tables.Cell]]]:
    """Return the header and rows of a table of sets, with all or some columns; a star marks the recommended set."""
    columns = {name: SET_COLUMNS[name] for name in names or SET_COLUMNS}
    return tables.fill_table(
        {"": lambda part_set: "*" if part_set.recommended else " ", **columns},
        answer.sets,
    )


def _format_position_error(part_set: PartSet) -> str:
    """Return the position error of a set as text, with the assumption on which it is based."""
    error = _format_lower_bound(part_set, part_set.position_error)
    return f"{error} if one body" if part_set.position_assumes else error


def _format_lower_bound(part_set: PartSet, value: float | None) -> str:
    """Return an error as text, with ">=" if it is only a lower limit; "unknown" if it is None."""
    if value is None:
        return "unknown"
    sign = ">= " if part_set.position_is_lower_bound else ""
    return f"{sign}{value:.3g}"


def name_verdict(row: PartRow) -> str:
    """Return in one or two words whether to make a part rigid."""
    if row.merge_with is not None:
        return f"yes, with {row.merge_with}"
    return _VERDICTS.get(row.verdict, row.verdict)


def list_verdict_on_set(answer: Parts) -> list[tuple[str, str]]:
    """Return which parts to make rigid, why, and what that saves, as (name, sentence) pairs."""
    best = answer.recommended
    if best is None and not answer.files.parts:
        return [
            (
                "make rigid",
                "unknown: the history contains no data for individual parts",
            ),
            ("to improve", _NAME_HISTORY_WITH_PARTS),
        ]
    if best is None and answer.inventory is None:
        return [
            (
                "make rigid",
                "unknown: without the deck of the run no part can be judged",
            ),
            ("to improve", "give the main deck with `deck`"),
        ]
    if best is None:
        why = next(
            (part_set.reasons[0] for part_set in answer.sets if part_set.reasons),
            _explain_no_part(answer),
        )
        return [
            ("make rigid", "nothing: no set of parts can be recommended"),
            ("why", why),
        ]
    if len(best.bodies) == 1:
        bodies = "one rigid body"
    else:
        bodies = f"{len(best.bodies)} rigid bodies"
    flights = len(answer.facts.flights)
    if flights > 1:
        where = f", if rigid in the longest of {flights} flights only"
    else:
        where = ""
    share = best.run_time_share
    if share is None:
        saves = f"unknown: {best.cost_reason}" if best.cost_reason else "unknown"
    else:
        saves = f"{format_saved_share(share)}{where}"
    return [
        *_list_verdict_of_set(
            best,
            f"--part {format_part_ranges(best.parts)}, {name_set(best)} ({bodies})",
        ),
        ("saves", saves),
    ]


def list_next_step(answer: Parts, question: RepeatedQuestion) -> list[tuple[str, str]]:
    """Return the next command: ``plan`` with the recommended set; without a usable set, a step to something else."""
    best = answer.recommended
    if best is None:
        return [("next", _name_step_without_set(answer, question))]
    if is_refused(best.decision):
        return [("next", _name_step_after_refused_set(best, question))]
    parts = [format_part_ranges(best.parts)]
    return [("next", write_command(question, "plan", new_parts=parts))]


def _name_step_after_refused_set(best: PartSet, question: RepeatedQuestion) -> str:
    """Return the step if even the best set cannot be used: to other times, or out of the run if all are compared."""
    # Imported here to keep start-up fast.
    from d2rpick.choice.td.flights import has_other_flights

    assert best.decision is not None
    assert best.situation is not None
    situation = best.situation
    plan = write_command(question, "plan", new_parts=[format_part_ranges(best.parts)])
    if question.times:
        return f"no set can be used at these times; compare all flights with {plan}"
    if has_other_flights(situation.history, situation.settings, situation.td):
        return f"no set can be used in the longest flight; compare the other flights with {plan}"
    cure = best.decision.cure_without_other_times or "run it without switching"
    return f"no set of parts can be used in this run: {cure}"


def _name_step_without_set(answer: Parts, question: RepeatedQuestion) -> str:
    """Return the step if no set is recommended: to the missing deck, or to the verdict on all parts."""
    # The options name a deck that was not used.
    of_files = RepeatedQuestion(files=question.files)
    if not answer.files.parts:
        line = write_command(question, "plan")
        return f"judge the energy of the whole model with {line}"
    if answer.inventory is None:
        deck = name_deck_of_run(question)
        line = write_command(of_files, "parts", "--deck", deck.name)
        return f"judge the parts with {line}{deck.hint}"
    if question.times:
        line = write_command(question, "parts")
        return f"choose the times with {line}"
    if not any(row.flight and row.flight.flies is not None for row in answer.rows):
        line = write_command(question, "plan", new_parts=["all"])
        return f"if all parts fly together, plan their switching with {line}"
    return write_command(of_files, "info")


def _explain_no_part(answer: Parts) -> str:
    """Explain why no set was compared: no part can be switched, or it is unknown whether some parts can."""
    unknown_rows = [row for row in answer.rows if row.verdict == "unknown"]
    if not unknown_rows:
        return "no part can be switched"
    reasons = next((row.reasons for row in unknown_rows if row.reasons), ())
    return "; ".join(["no part can be judged", *reasons])


def _list_verdict_of_set(best: PartSet, name: str) -> list[tuple[str, str]]:
    """Return the verdict on the recommended set and its window, with reason and cure."""
    decision = best.decision
    if decision is None or best.window is None:
        return [("make rigid", name)]
    tr, td = best.window
    verdict, *why_and_cure = list_verdict_lines(decision, tr, td)[:-1]
    action = "best set" if is_refused(decision) else "make rigid"
    return [(verdict[0], f"{action} {name}; {verdict[1]}"), *why_and_cure]


def name_set(part_set: PartSet) -> str:
    """Return the displayed name of a set."""
    return _SET_NAMES.get(part_set.name, part_set.name)


def list_remarks(answer: Parts) -> list[tuple[str, str]]:
    """Return the meaning of the star and the remarks of a page, as (name, sentence) pairs."""
    is_refused_set = is_refused(answer.recommended and answer.recommended.decision)
    name = "best" if is_refused_set else "recommended"
    star = ("*", f"the {name} set and its parts (d2rpick plan --part recommended)")
    remarks = list_page_remarks(answer)
    return [star, *remarks] if answer.recommended else remarks


def list_page_remarks(answer: Parts) -> list[tuple[str, str]]:
    """Return remarks on the recommended set, and why other sets are not compared, as (name, sentence) pairs."""
    lines: list[tuple[str, str]] = []
    best = answer.recommended
    if best and best.step_growth is not None and best.step_growth > 1:
        if isinf(best.step_growth):
            much = "without limit"
        else:
            much = f"{best.step_growth:.2g} times"
        grows = f"may grow {much} while these parts are rigid"
        cures = (
            f"the cards limit it to 1/{CAP_SHARE} of the rigid time (--step-cap sets another limit); "
            "to include the longer time step in the saving, give --step-ratio"
        )
        lines.append(("time step", f"{grows}; {cures}"))
    errors = [part_set.position_error for part_set in answer.sets]
    if None in errors and 0.0 in errors:
        lines.append(("position", _ZERO_BESIDE_UNKNOWN))
    lines += [
        (name_set(part_set), reason)
        for part_set in answer.sets
        for reason in part_set.reasons
    ]
    return lines


def format_count(count: int, noun: str) -> str:
    """Return a count with its noun, which is plural unless the count is 1."""
    return f"{count} {noun}{'s' * (count != 1)}"


def _format_element_counts(row: PartRow) -> str | None:
    if row.elements is None:
        return None
    return ", ".join(f"{count} {kind}" for kind, count in row.elements.items())


def _format_sharing_parts(row: PartRow) -> str | None:
    if row.shares_nodes is None:
        return None
    return list_names(row.shares_nodes, most=_MOST_SHOWN, between=",")


def format_part_ranges(ids: Sequence[int]) -> str:
    """Return part ids in the form of ``--part``.

    Examples
    --------
    >>> format_part_ranges([1, 2, 3, 5, 6, 12])
    '1-3,5,6,12'
    """
    return ",".join(format_ranges(ids))


def _format_short(value: float | None) -> str | None:
    return tables.format_if_known(value, ".3g")


def _format_percent(value: float | None) -> str | None:
    return None if value is None else f"{100 * value:.3g}%"


COLUMNS: Final[dict[str, Callable[[PartRow], tables.Cell]]] = {
    "part": lambda row: row.id,
    "title": lambda row: row.title,
    "make rigid?": name_verdict,
    "elements": _format_element_counts,
    "formulation": lambda row: ", ".join(row.formulations) or None,
    "material": lambda row: row.material,
    "mass": lambda row: _format_short(row.mass),
    "mean energy": lambda row: _format_short(row.flight.mean if row.flight else None),
    "energy scatter": lambda row: _format_percent(
        row.flight.scatter if row.flight else None
    ),
    "flies": lambda row: row.flight.flies if row.flight else None,
    "deforms": lambda row: row.flight.deforms if row.flight else None,
    "share of CPU time": lambda row: _format_percent(row.cost_share),
    "time step": lambda row: _format_short(row.smallest_step),
    "shares nodes with": _format_sharing_parts,
    "why": lambda row: "; ".join(row.reasons),
}
SET_COLUMNS: Final[dict[str, Callable[[PartSet], tables.Cell]]] = {
    "set": name_set,
    "parts": lambda part_set: format_part_ranges(part_set.parts),
    "elements": lambda part_set: part_set.elements,
    "mass": lambda part_set: _format_percent(part_set.mass_fraction),
    "saved while rigid": lambda part_set: _format_percent(part_set.cost_share),
    "time step grows": lambda part_set: (
        "free"
        if is_limited_by_no_part(part_set)
        else tables.format_if_known(part_set.step_growth, ".2g")
    ),
    "tr": lambda part_set: part_set.window[0] if part_set.window else None,
    "td": lambda part_set: part_set.window[1] if part_set.window else None,
    "CPU time left": lambda part_set: _format_percent(part_set.run_time_share),
    "CPU time saved": lambda part_set: _format_percent(part_set.saving),
    "position error": _format_position_error,
    "rotation error [deg]": lambda part_set: _format_lower_bound(
        part_set, part_set.angle_error
    ),
    "verdict": lambda part_set: part_set.decision and part_set.decision.verdict,
}
