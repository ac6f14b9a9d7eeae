"""What HTML pages have in common: cards of a pair, what was read, and how to repeat it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.report.explorer import Explorer, explorer, scripts, styles
from d2rpick.report.html import Markup, document, drawings, join, pairs, resource, section, table, tag
from d2rpick.report.situation import heading, measures_of
from d2rpick.report.tables import shell_line, short

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from d2rpick.choice.candidates import Candidate
    from d2rpick.choice.cost import Weights
    from d2rpick.choice.health import Health
    from d2rpick.choice.judged_card import SolverInput
    from d2rpick.choice.question import Settings
    from d2rpick.choice.situation import Situation
    from d2rpick.histories.history import History
    from d2rpick.histories.opening import Run
    from d2rpick.report.keys import Read


_MOST_FILES: Final = 20  # of a deck that are named
# Lines of a page to be filled in by hand.
SIGNED: Final = ("chosen by", "date", "signature")
CHECKED: Final = ("checked by", "date", "signature")


class PageContext(NamedTuple):
    """What a page shows besides the answer.

    ``run`` is what was read, ``switched`` a finished switched run; ``command`` repeats the answer, ``judging`` are the
    options of ``card`` that judge by the same history.   ``card`` is the
    solver input of a pair that is recommended or verified; ``explorer`` makes the page live.
    """

    run: Run
    command: Sequence[str]
    judging: Sequence[str]
    card: SolverInput | None = None
    switched: Run | None = None
    explorer: Explorer | None = None


def run_page(run: Run, sections: Iterable[Markup], explored: Explorer | None = None) -> str:
    """Write a page about one run; with what can be ``explored`` it runs a script."""
    needed = {"styles": styles(), "scripts": scripts()} if explored else {}
    return document(f"Switch times: {title_of(run)}", *sections, signed=SIGNED, **needed)


def front(cards: Sequence[Markup], *below: Markup) -> Markup:
    """Give the first section: cards of what was chosen or judged beside each other, and what to know of them."""
    return tag("section", tag("div", *cards, class_="choice"), *below)


def refused(reason: str) -> Markup:
    """Give the card of an answer that recommends nothing."""
    return tag("div", tag("h2", "Nothing recommended"), tag("p", reason), class_="card refused")


def shown(figures: Mapping[str, str], record: PageContext) -> Iterator[Markup]:
    """Give what can be explored, and ``figures``, SVG elements by caption."""
    if record.explorer:
        yield explorer(record.explorer)
    yield drawings(figures)


def title_of(run: Run) -> str:
    """Title that the solver wrote, else the name of the file."""
    return next((database.title for database in run.databases if database.title), "") or run.name


def pair(title: str, times: tuple[float, float], told: Markup, history: History, class_: str) -> Markup:
    """Show (tr, td) large, what is ``told`` of them, and the times in full."""
    unit = f" {history.time_unit}" if history.time_unit else ""
    shown = (
        tag("span", tag("i", name), f"{short(time)}{unit}") for name, time in zip(("tr", "td"), times, strict=True)
    )
    full = (tag("span", f"{name} = {time!r}") for name, time in zip(("tr", "td"), times, strict=True))
    exact = tag("p", "in full: ", join(full, ", "), class_="soft exact")
    return tag("div", tag("h2", title), tag("div", *shown, class_="times"), told, exact, class_=class_)


def rigid_for(times: tuple[float, float], history: History) -> str:
    """Say how long a pair is rigid."""
    unit = f" {history.time_unit}" if history.time_unit else ""
    (tr, td), span = times, float(history.time[-1] - history.time[0])
    return f"rigid for {short(td - tr)}{unit}, {(td - tr) / span:.0%} of the record"


def digests(files: Iterable[Read]) -> list[tuple[str, str]]:
    """Name each file with the SHA-256 of what was read of it."""
    return [("SHA-256", f"{file.name}: {file.sha256()}") for file in files]


def deck_digests(deck: Iterable[Read], weights: Weights | None) -> list[tuple[str, str]]:
    """The same of a deck, its main file first, and of a file of weights; of many includes the first are named."""
    files = list({file.name: file for file in deck}.values())
    more = len(files) - _MOST_FILES
    left = [("SHA-256", f"of {more} more files of the deck: in the JSON result")] if more > 0 else []
    return [*digests(files[:_MOST_FILES]), *left, *digests([weights.file] if weights and weights.file else [])]


def digests_of(settings: Settings) -> list[tuple[str, str]]:
    """The same of the deck that an answer rests on; nothing without one."""
    used = settings.by_deck
    return deck_digests(used.files, used.weights) if used else []


def parts(candidate: Candidate | None) -> Markup:
    """Show what each part has of the mismatch at a pair; nothing where the parts are not known."""
    if candidate is None or not candidate.parts:
        return Markup()
    sign = {True: "same", False: "opposite", None: "unknown"}
    listed = [
        (one.name, sign[one.sign_match], "-" if one.share is None else f"{one.share:.0%}", one.reason or "")
        for one in candidate.parts
    ]
    title = "Parts at this pair"
    return section(title, table(title, ("part", "sign", "share of the mismatch", "remark"), listed))


def evidence(situation: Situation, health: Health | None, record: PageContext) -> Iterator[Markup]:
    """Tell what was read, how healthy it is, by what method it was judged, and how to repeat that."""
    yield section("What was read", _read(situation, record.run))
    yield section("Health of the reference run", *_health(health))
    yield from method(record.command, "-" in record.run.sources)


def method(command: Sequence[str], stdin: bool = False) -> Iterator[Markup]:
    """Tell by what method an answer was found, and how to repeat it."""
    folded = tag("details", tag("summary", tag("h2", "Method and limits")), resource("method.html"))
    yield tag("section", folded)
    yield repeated(command, stdin)


def repeated(command: Sequence[str], stdin: bool = False) -> Markup:
    """Give the arguments that repeat an answer as a line to paste."""
    said = [tag("p", "with the same history on standard input:")] if stdin else []
    return section("To repeat this", *said, tag("pre", shell_line(command), class_="wrap"))


def solver_input(times: tuple[float, float], record: PageContext) -> Markup:
    """Give the solver's card where it is known whom it switches, else the command that prints it."""
    title, card = "Solver input", record.card
    assert card is not None
    if card.refusal:
        return section(title, tag("p", f"No card can be printed for these times: {card.refusal}"))
    if card.text:
        return section(title, tag("pre", card.text, tabindex="0"))
    command = ["d2rpick", "card", "--tr", repr(times[0]), "--td", repr(times[1])]
    command += ["--solver", card.solver] if card.solver else []
    line = tag("pre", shell_line([*command, f"--{card.switches}", "IDS", *record.judging]), class_="wrap")
    return section(title, tag("p", "Printed, and judged again as printed, by"), line)


def _read(situation: Situation, run: Run) -> Markup:
    listed = [*heading(situation, verbose=True), *digests(run.files), *digests_of(situation.settings)]
    listed += [(f"{database.format} by", database.version) for database in run.databases if database.version]
    whole = "the files end after a complete state" if situation.history.complete else "only complete states were used"
    listed += [("complete", whole)]
    return pairs(listed + [("note", note) for note in situation.history.notes])


def _health(health: Health | None) -> Iterator[Markup]:
    if health is None or not any(one.value for one in measures_of(health)):
        yield tag("p", "The files do not hold the energies this needs.")
        return
    verdicts = {True: tag("span", "kept", class_="good"), False: tag("span", "exceeded", class_="bad"), None: "-"}
    listed = [(one.what, one.value or "not written", one.limit, verdicts[one.good]) for one in measures_of(health)]
    yield table("Health of the reference run", ("measure", "this run", "practice", "verdict"), listed)
    window = health.window
    where = " The window is {:.6g} to {:.6g}.".format(*window) if window else ""
    yield tag("p", f"Up to td; shares are of the peak of the internal energy.{where}", class_="soft")
    if health.reason:
        yield tag("p", health.reason)
