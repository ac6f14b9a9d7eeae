"""HTML pages: elements from nested calls, in which all that is not HTML already is escaped, and what pages share.

They share cards of a pair, what was read, and how to repeat it.
"""

from __future__ import annotations

from base64 import b64encode
from hashlib import sha256
from html import escape
from importlib.resources import files
from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.base import __version__
from d2rpick.choice.grades import DO_NOT_USE, USE, USE_WITH_CARE
from d2rpick.report.decision import headed
from d2rpick.report.situation import heading, measures_of
from d2rpick.report.tables import Cell, shell_line, short

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from d2rpick.base.errors import Caution
    from d2rpick.choice.candidates import Candidate
    from d2rpick.choice.cost import Weights
    from d2rpick.choice.decision import Decision
    from d2rpick.choice.health import Health
    from d2rpick.choice.judged_card import SolverInput
    from d2rpick.choice.question import Settings
    from d2rpick.choice.situation import Situation
    from d2rpick.choice.trade_off import TradeOff
    from d2rpick.histories.history import History
    from d2rpick.histories.opening import Run
    from d2rpick.report.keys import Read

# More columns than this do not fit on a narrow screen.
_FIT = 3
_HINT = "Where the table goes on to the right, scroll it sideways."
_VOID = frozenset({"meta", "link", "br", "hr", "input"})
_NOTHING = "'none'"
# Characters that no page may hold, and those that turn the text around them.
_TURNING = {*range(0x202A, 0x202F), *range(0x2066, 0x206A)}
_CONTROLS = dict.fromkeys(
    {*range(32), *range(127, 160), *_TURNING} - {*map(ord, "\t\n")}, "\ufffd"
)
_MOST_FILES: Final = 20  # of a deck that are named
# Lines of a page to be filled in by hand.
SIGNED: Final = ("chosen by", "date", "signature")
CHECKED: Final = ("checked by", "date", "signature")


class Markup(str):
    """Text that is HTML already."""

    __slots__ = ()


def tag(name: str, /, *children: str, **attributes: str) -> Markup:
    """Give an element; attributes that are Python's words end in an underscore, blanks in names are written so too.

    Examples
    --------
    >>> tag("p", "a < b, ", tag("b", "bold"), class_="note")
    '<p class="note">a &lt; b, <b>bold</b></p>'
    >>> tag("meta", charset="utf-8")
    '<meta charset="utf-8">'
    """
    given = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{_escape(text)}"'
        for key, text in attributes.items()
    )
    return Markup(
        f"<{name}{given}>"
        if name in _VOID
        else f"<{name}{given}>{join(children)}</{name}>"
    )


def join(children: Iterable[str], between: str = "") -> Markup:
    """Put elements and texts one after the other."""
    return Markup(
        between.join(
            child if isinstance(child, Markup) else _escape(child, quote=False)
            for child in children
        )
    )


def document(
    title: str,
    *content: str,
    signed: Sequence[str],
    styles: Sequence[Markup] = (),
    scripts: Sequence[Markup] = (),
) -> str:
    """Give a whole page that needs nothing but itself, with lines ``signed`` to be filled in by hand.

    ``styles`` and ``scripts`` are what it needs beside the style of every page; nothing else takes effect on it.
    """
    sheets = (resource("style.css"), *styles)
    head = tag(
        "head",
        tag("meta", charset="utf-8"),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        tag(
            "meta",
            http_equiv="Content-Security-Policy",
            content=_policy(sheets, scripts),
        ),
        tag("title", title),
        *(tag("style", sheet) for sheet in sheets),
    )
    # on top, beside the times: behind a card of any length it may stand on a sheet of its own
    sign = tag("p", *(tag("span", line) for line in signed), class_="sign")
    header = tag(
        "header",
        tag("h1", title),
        tag("p", f"d2rpick {__version__}", class_="soft"),
        sign,
    )
    body = tag(
        "body",
        header,
        tag("main", *content),
        *(tag("script", script) for script in scripts),
    )
    return f"<!DOCTYPE html>\n{tag('html', head, body, lang='en')}\n"


def _policy(styles: Sequence[str], scripts: Sequence[str]) -> str:
    """Nothing is ever fetched, and only what the page itself is made of runs, whatever the files that were read hold.

    Drawings have styles of their own as attributes.  Older browsers know one rule for all styles only.
    """
    allowed = {"style-src-elem": styles, "script-src": scripts}
    rules = [
        f"{name} {' '.join(map(_digest, texts)) or _NOTHING}"
        for name, texts in allowed.items()
    ]
    base = f"default-src {_NOTHING}; base-uri {_NOTHING}; form-action {_NOTHING}"
    return "; ".join(
        [base, *rules, "style-src-attr 'unsafe-inline'", "style-src 'unsafe-inline'"]
    )


def _digest(text: str) -> str:
    return f"'sha256-{b64encode(sha256(text.encode()).digest()).decode()}'"


def section(title: str, *content: str) -> Markup:
    """Give a section under its title."""
    return tag("section", tag("h2", title), *content)


def drawing(caption: str, svg: str) -> Markup:
    """Show an SVG element with its caption."""
    drawn = tag("div", Markup(svg), role="img", aria_label=caption)
    return tag("figure", drawn, tag("figcaption", caption), class_="drawn")


def remarks(cautions: Iterable[Caution], reasons: Iterable[str] = ()) -> Markup:
    """List reasons and warnings; nothing where there are none."""
    lines = [tag("li", reason) for reason in reasons]
    lines += [
        tag("li", tag("b", caution.code), f": {caution.message}")
        for caution in cautions
    ]
    return tag("ul", *lines, class_="warnings") if lines else Markup()


def resource(name: str) -> Markup:
    """Read a text that is part of the package."""
    return Markup(files("d2rpick.report").joinpath(name).read_text("utf-8"))


def table(
    title: str,
    head: Sequence[str],
    rows: Iterable[Sequence[Cell]],
    marked: int | None = None,
) -> Markup:
    """Give a table in a box that scrolls sideways where it is too wide; ``title`` is what a keyboard reaches it by."""
    box = tag(
        "div",
        grid(head, rows, marked),
        class_="scroll",
        role="region",
        aria_label=title,
        tabindex="0",
    )
    return join([tag("p", _HINT, class_="hint"), box]) if len(head) > _FIT else box


def grid(
    head: Sequence[str], rows: Iterable[Sequence[Cell]], marked: int | None = None
) -> Markup:
    """Give a table alone; the row ``marked`` stands out.

    Columns of numbers, and of what is not known, are set to the right.  Lines break at blanks alone, never within a
    number.
    """
    body = [list(row) for row in rows]
    right = [
        name == "±"
        or all(row[i] is None or isinstance(row[i], (int, float)) for row in body)
        for i, name in enumerate(head)
    ]
    classes = [{"class_": "number"} if one else {} for one in right]
    top = (
        tag("th", name, scope="col", **own)
        for name, own in zip(head, classes, strict=True)
    )
    lines = [
        tag(
            "tr",
            *(_cell(cell, own) for cell, own in zip(row, classes, strict=True)),
            **({"class_": "marked"} if i == marked else {}),
        )
        for i, row in enumerate(body)
    ]
    return tag("table", tag("thead", tag("tr", *top)), tag("tbody", *lines))


def _cell(cell: Cell, own: Mapping[str, str]) -> Markup:
    text = cell if isinstance(cell, Markup) else short(cell)
    return tag("td", text, **(own or ({"class_": "words"} if " " in text else {})))


def pairs(rows: Iterable[tuple[str, str]]) -> Markup:
    """Give a list of names, each with what it stands for; nothing where there are none."""
    listed = [tag("div", tag("dt", name), tag("dd", text)) for name, text in rows]
    return tag("dl", *listed) if listed else Markup()


def _escape(text: str, *, quote: bool = True) -> str:
    return escape(text, quote=quote).translate(_CONTROLS)


class Explorer(NamedTuple):
    """What can be explored: the trade-offs of one or several flights.

    ``command`` is the command line that asks for the pair of a td, in front of td and behind it.
    """

    trade_offs: tuple[TradeOff, ...]
    command: tuple[Sequence[str], Sequence[str]]


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


def front(cards: Sequence[Markup], *below: Markup) -> Markup:
    """Give the first section: cards of what was chosen or judged beside each other, and what to know of them."""
    return tag("section", tag("div", *cards, class_="choice"), *below)


def refused(reason: str) -> Markup:
    """Give the card of an answer that recommends nothing."""
    return tag(
        "div",
        tag("h2", tag("span", "nothing to use", class_="badge refused")),
        tag("p", reason),
        class_="card refused",
    )


def title_of(run: Run) -> str:
    """Title that the solver wrote, else the name of the file."""
    return (
        next((database.title for database in run.databases if database.title), "")
        or run.name
    )


def pair(
    title: str, times: tuple[float, float], told: Markup, history: History, class_: str
) -> Markup:
    """Show (tr, td) large, what is ``told`` of them, and the times in full."""
    unit = f" {history.time_unit}" if history.time_unit else ""
    shown = (
        tag("span", tag("i", name), f"{short(time)}{unit}")
        for name, time in zip(("tr", "td"), times, strict=True)
    )
    full = (
        tag("span", f"{name} = {time!r}")
        for name, time in zip(("tr", "td"), times, strict=True)
    )
    exact = tag("p", "in full: ", join(full, ", "), class_="soft exact")
    return tag(
        "div",
        tag("h2", title),
        tag("div", *shown, class_="times"),
        told,
        exact,
        class_=class_,
    )


# The class of the card of a verdict, and of its badge.
CLASSES: Final = {USE: "use", USE_WITH_CARE: "care", DO_NOT_USE: "refused"}


def decided(
    title: str,
    decision: Decision,
    times: tuple[float, float],
    history: History,
    facts: Iterable[tuple[str, str]],
) -> Markup:
    """Show the verdict on a pair as a badge, its times large, and why; ``title`` stands before the verdict."""
    kind = CLASSES[decision.verdict]
    badge = tag("span", decision.verdict, class_=f"badge {kind}")
    _, *why = headed(decision, *times)
    return pair(
        join([title, badge]), times, pairs([*why, *facts]), history, f"card {kind}"
    )


def digests(files: Iterable[Read]) -> list[tuple[str, str]]:
    """Name each file with the SHA-256 of what was read of it."""
    return [("SHA-256", f"{file.name}: {file.sha256()}") for file in files]


def deck_digests(
    deck: Iterable[Read], weights: Weights | None
) -> list[tuple[str, str]]:
    """The same of a deck, its main file first, and of a file of weights; of many includes the first are named."""
    files = list({file.name: file for file in deck}.values())
    more = len(files) - _MOST_FILES
    left = (
        [("SHA-256", f"of {more} more files of the deck: in the JSON result")]
        if more > 0
        else []
    )
    return [
        *digests(files[:_MOST_FILES]),
        *left,
        *digests([weights.file] if weights and weights.file else []),
    ]


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
        (
            one.name,
            sign[one.sign_match],
            "-" if one.share is None else f"{one.share:.0%}",
            one.reason or "",
        )
        for one in candidate.parts
    ]
    title = "Parts at this pair"
    return section(
        title, table(title, ("part", "sign", "share of the mismatch", "remark"), listed)
    )


def evidence(
    situation: Situation, health: Health | None, record: PageContext
) -> Iterator[Markup]:
    """Tell what was read, how healthy it is, by what method it was judged, and how to repeat that."""
    yield section("What was read", _read(situation, record.run))
    yield section("Health of the reference run", *_health(health))
    yield from method(record.command, "-" in record.run.sources)


def method(command: Sequence[str], stdin: bool = False) -> Iterator[Markup]:
    """Tell by what method an answer was found, and how to repeat it."""
    folded = tag(
        "details",
        tag("summary", tag("h2", "Method and limits")),
        resource("method.html"),
    )
    yield tag("section", folded)
    yield repeated(command, stdin)


def repeated(command: Sequence[str], stdin: bool = False) -> Markup:
    """Give the arguments that repeat an answer as a line to paste."""
    said = [tag("p", "with the same history on standard input:")] if stdin else []
    return section(
        "To repeat this", *said, tag("pre", shell_line(command), class_="wrap")
    )


def solver_input(times: tuple[float, float], record: PageContext) -> Markup:
    """Give the solver's card where it is known whom it switches, else the command that prints it."""
    title, card = "Solver input", record.card
    assert card is not None
    if card.refusal:
        return section(
            title, tag("p", f"No card can be printed for these times: {card.refusal}")
        )
    if card.text:
        return section(title, tag("pre", card.text, tabindex="0"))
    command = ["d2rpick", "card", "--tr", repr(times[0]), "--td", repr(times[1])]
    command += ["--solver", card.solver] if card.solver else []
    line = tag(
        "pre",
        shell_line([*command, f"--{card.switches}", "IDS", *record.judging]),
        class_="wrap",
    )
    return section(title, tag("p", "Printed, and judged again as printed, by"), line)


def _read(situation: Situation, run: Run) -> Markup:
    listed = [
        *heading(situation, verbose=True),
        *digests(run.files),
        *digests_of(situation.settings),
    ]
    listed += [
        (f"{database.format} by", database.version)
        for database in run.databases
        if database.version
    ]
    whole = (
        "the files end after a complete state"
        if situation.history.complete
        else "only complete states were used"
    )
    listed += [("complete", whole)]
    return pairs(listed + [("note", note) for note in situation.history.notes])


def _health(health: Health | None) -> Iterator[Markup]:
    if health is None or not any(one.value for one in measures_of(health)):
        yield tag("p", "The files do not hold the energies this needs.")
        return
    verdicts = {
        True: tag("span", "kept", class_="good"),
        False: tag("span", "exceeded", class_="bad"),
        None: "-",
    }
    listed = [
        (one.what, one.value or "not written", one.limit, verdicts[one.good])
        for one in measures_of(health)
    ]
    yield table(
        "Health of the reference run",
        ("measure", "this run", "practice", "verdict"),
        listed,
    )
    window = health.window
    where = " The window is {:.6g} to {:.6g}.".format(*window) if window else ""
    yield tag(
        "p",
        f"Up to td; shares are of the peak of the internal energy.{where}",
        class_="soft",
    )
    if health.reason:
        yield tag("p", health.reason)
