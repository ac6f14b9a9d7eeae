"""The answer of ``suggest`` as one HTML page to be read, printed and signed; it needs nothing but itself."""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING

from d2rpick.judged_card import of_suggestion
from d2rpick.report.health import measures_of
from d2rpick.report.html import Markup, cautions, document, figure, join, pairs, resource, section, table, tag
from d2rpick.report.situation import heading
from d2rpick.report.suggestion import HEAD, outlook, rows
from d2rpick.report.tables import measure, short

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from d2rpick.choice import Pair, Suggestion
    from d2rpick.history import History
    from d2rpick.readers import Run

# More rows than one compares by eye; csv and json hold all.
_MOST_ROWS = 20


def as_page(answer: Suggestion, run: Run, command: Sequence[str], figures: Mapping[str, tuple[str, str]]) -> str:
    """Write the page.

    Parameters
    ----------
    answer : Suggestion
    run : Run
        What was read.
    command : sequence of str
        Arguments that repeat the answer.
    figures : mapping of str to (str, str)
        SVG elements by caption, each for a wide and for a narrow page, with ids of their own.
    """
    name = next((database.title for database in run.databases if database.title), "") or run.name
    sections = _sections(answer, run, command, figures)
    return document(f"Switch times: {name}", *sections, signed=("chosen by", "date", "signature"))


def _sections(
    answer: Suggestion, run: Run, command: Sequence[str], figures: Mapping[str, tuple[str, str]]
) -> Iterator[Markup]:
    yield _choice(answer)
    yield join(figure(caption, *svg) for caption, svg in figures.items())
    yield section("Candidates", *_candidates(answer))
    yield _parts(answer)
    yield section("What was read", _read(answer, run))
    yield section("Health of the reference run", *_health(answer))
    yield section("Method and limits", resource("method.html"))
    again = shlex.join(["d2rpick", *command])
    yield section("To repeat this", tag("pre", again, class_="wrap"))
    yield from _card(answer)


def better_pair(answer: Suggestion) -> Pair | None:
    """Give the better pair where it is another one than that recommended, to the digits that people read."""
    better, chosen = answer.better_td, answer.recommended
    same = (
        better and chosen and [short(t) for t in (better.tr, better.td)] == [short(t) for t in (chosen.tr, chosen.td)]
    )
    return None if same else better


def _choice(answer: Suggestion) -> Markup:
    history, better = answer.situation.history, better_pair(answer)
    cards = [_pair("Recommended", answer.recommended, history, class_="card chosen")]
    if better:
        cards.append(_pair("Better pair: td at the nearest peak", better, history, class_="card"))
    return tag("section", tag("div", *cards, class_="choice"), cautions(answer.cautions), pairs(outlook(answer)))


def _pair(title: str, pair: Pair | None, history: History, class_: str) -> Markup:
    if pair is None:
        return tag("div", tag("h3", title), tag("p", "No tr can be recommended for this td."), class_=class_)
    unit = f" {history.time_unit}" if history.time_unit else ""
    times = (tag("span", tag("i", name), f"{short(time)}{unit}") for name, time in (("tr", pair.tr), ("td", pair.td)))
    residual = "residual unknown" if pair.residual is None else f"residual {measure(pair.residual)}"
    share = (pair.td - pair.tr) / float(history.time[-1] - history.time[0])
    text = f"{residual}, rigid for {short(pair.td - pair.tr)}{unit}, {share:.0%} of the record"
    exact = f"in full: tr = {pair.tr!r}, td = {pair.td!r}"
    lines = (tag("p", text), tag("p", exact, class_="soft"))
    return tag("div", tag("h3", title), tag("div", *times, class_="times"), *lines, class_=class_)


def _parts(answer: Suggestion) -> Markup:
    """Show what each part has of the mismatch at the recommended pair."""
    best = next((candidate for candidate in answer.candidates if candidate.recommended), None)
    if best is None or not best.parts:
        return Markup()
    sign = {True: "same", False: "opposite", None: "unknown"}
    listed = [
        (one.name, sign[one.sign_match], "-" if one.share is None else f"{one.share:.0%}", one.reason or "")
        for one in best.parts
    ]
    return section("Parts at the recommended pair", table(("part", "sign", "share of the mismatch", ""), listed))


def _candidates(answer: Suggestion) -> Iterator[Markup]:
    if not answer.candidates:
        yield tag("p", "There are none.")
        return
    shown = answer.candidates[:_MOST_ROWS]
    marked = next((i for i, candidate in enumerate(shown) if candidate.recommended), None)
    yield table([name.replace("+-", "±") for name in HEAD[1:]], [row[1:] for row in rows(answer, _MOST_ROWS)], marked)
    left = len(answer.candidates) - len(shown)
    if left:
        yield tag("p", f"{left} more in the results as csv or json.", class_="soft")


def _read(answer: Suggestion, run: Run) -> Markup:
    from d2rpick.readers.source import sha256

    listed = [(line.partition(" ")[0], line.partition(" ")[2].strip()) for line in heading(answer.situation)]
    listed += [("SHA-256", f"{name}: {sha256(name)}") for name in run.sources]
    listed += [(f"{database.format} by", database.version) for database in run.databases if database.version]
    whole = "the files end behind a whole state" if answer.situation.history.complete else "only whole states were used"
    listed += [("complete", whole)]
    return pairs(listed + [("note", note) for note in answer.situation.history.notes])


def _health(answer: Suggestion) -> Iterator[Markup]:
    if answer.health is None or not any(one.value for one in measures_of(answer.health)):
        yield tag("p", "The files hold no energies that tell it.")
        return
    verdicts = {True: tag("span", "kept", class_="good"), False: tag("span", "exceeded", class_="bad"), None: "-"}
    listed = [
        (one.what, one.value or "not written", one.limit, verdicts[one.good]) for one in measures_of(answer.health)
    ]
    yield table(("measure", "this run", "practice", "verdict"), listed)
    window = answer.health.window
    where = " The window is {:.6g} to {:.6g}.".format(*window) if window else ""
    yield tag("p", f"Up to td; shares are of the peak of the internal energy.{where}", class_="soft")
    if answer.health.reason:
        yield tag("p", answer.health.reason)


def _card(answer: Suggestion) -> Iterator[Markup]:
    """Give the solver's input: LS-DYNA's card where the parts are known, else the command that prints one."""
    pair, history = answer.recommended, answer.situation.history
    if pair is None:
        return
    found = None if history.format.startswith("radioss") else of_suggestion(answer)
    if found:
        yield section("For the solver's input", tag("pre", found[0].text))
        return
    solver = "--solver radioss --node IDS" if history.format.startswith("radioss") else "--part IDS"
    command = f"d2rpick card --tr {pair.tr!r} --td {pair.td!r} {solver} --history {shlex.quote(history.source[0])}"
    yield section(
        "For the solver's input", tag("p", "Printed, and judged once more as printed, by"), tag("pre", command)
    )
