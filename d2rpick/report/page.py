"""Build HTML pages from elements, which nested calls make and which escape all text, and from shared sections.

Shared sections are the cards of a pair, the input that was read, and how to reproduce the answer.
"""

from __future__ import annotations

from base64 import b64encode
from hashlib import sha256
from html import escape
from importlib.resources import files
from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.base import __version__
from d2rpick.choice.pair.grades import DO_NOT_USE, USE, USE_WITH_CARE
from d2rpick.deck.beside import SOME_NODES, SOME_PARTS
from d2rpick.deck.printing import DEFAULT, SOLVERS
from d2rpick.report.decision import list_verdict_lines
from d2rpick.report.situation import list_health_measures, list_situation_heading
from d2rpick.report.tables import (
    Cell,
    format_short,
    quote_shell_line,
    split_at_commands,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from d2rpick.base.errors import Caution
    from d2rpick.choice.health import Health
    from d2rpick.choice.pair.decision import Decision
    from d2rpick.choice.pair.situation import Situation
    from d2rpick.choice.parts.cost import Weights
    from d2rpick.choice.question import Settings
    from d2rpick.choice.td.trade_off import TradeOff
    from d2rpick.deck.printed_card import PrintedCard, Printing
    from d2rpick.histories.history import History
    from d2rpick.histories.opening import OpenedRun
    from d2rpick.report.formats import RepeatedQuestion
    from d2rpick.report.keys import Read

# Smallest number of sections of a page with a table of contents.
_LONG: Final = 4
# Largest number of table columns that fit on a narrow screen.
_FIT = 3
_HINT = "Where the table goes on to the right, scroll it sideways."
_VOID = frozenset({"meta", "link", "br", "hr", "input"})
_NOTHING = "'none'"
# Characters that change the direction of the surrounding text, and are therefore replaced in pages.
_TURNING = {*range(0x202A, 0x202F), *range(0x2066, 0x206A)}
_CONTROLS = dict.fromkeys(
    {*range(32), *range(127, 160), *_TURNING} - {*map(ord, "\t\n")}, "\ufffd"
)
# What the options of a card switch, by option.
_SWITCHED: Final = {"part": "parts", "node": "main nodes"}
_MOST_FILES: Final = 20  # Largest number of deck files that are named on a page.
# Labels of the lines that the reader of a page fills in by hand.
SIGNED: Final = ("chosen by", "date", "signature")
CHECKED: Final = ("checked by", "date", "signature")

# CSS class of the card and the badge by verdict.
CLASSES: Final = {USE: "use", USE_WITH_CARE: "care", DO_NOT_USE: "refused"}


class Markup(str):
    """Text that is HTML already and needs no escaping."""

    __slots__ = ()


class PageSection(Markup):
    """A section of a page, with its title and the id to which the table of contents links.

    A section that ``needs_script`` is hidden until its script runs, and so is its link.
    """

    name: str
    anchor: str
    needs_script: bool = False


def make_element(name: str, /, *children: str, **attributes: str) -> Markup:
    """Return an element. In attribute names, ``_`` stands for ``-``; a final underscore avoids Python keywords.

    Examples
    --------
    >>> make_element("p", "a < b, ", make_element("b", "bold"), class_="note")
    '<p class="note">a &lt; b, <b>bold</b></p>'
    >>> make_element("meta", charset="utf-8")
    '<meta charset="utf-8">'
    """
    written_attributes = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{_replace_markup(text)}"'
        for key, text in attributes.items()
    )
    return Markup(
        f"<{name}{written_attributes}>"
        if name in _VOID
        else f"<{name}{written_attributes}>{join(children)}</{name}>"
    )


def join(children: Iterable[str], between: str = "") -> Markup:
    """Join elements and strings into a single piece of markup."""
    return Markup(
        between.join(
            child if isinstance(child, Markup) else _replace_markup(child, quote=False)
            for child in children
        )
    )


def build_document(
    title: str,
    *content: str,
    signed: Sequence[str],
    styles: Sequence[Markup] = (),
    scripts: Sequence[Markup] = (),
) -> str:
    """Return a complete page that needs no other file; the lines ``signed`` are to be filled in by hand.

    ``styles`` and ``scripts`` are added to the common style of all pages; the policy of the page blocks all others.
    """
    sheets = (read_resource("style.css"), *styles)
    if any("<pre" in part for part in content):
        scripts = (read_resource("copy.js"), *scripts)
    head = make_element(
        "head",
        make_element("meta", charset="utf-8"),
        make_element(
            "meta", name="viewport", content="width=device-width, initial-scale=1"
        ),
        make_element(
            "meta",
            http_equiv="Content-Security-Policy",
            content=_make_policy(sheets, scripts),
        ),
        make_element("title", title),
        *(make_element("style", sheet) for sheet in sheets),
    )
    # The lines to be signed are at the top, because below a long card they might be printed on a separate sheet.
    sign = make_element(
        "p", *(make_element("span", line) for line in signed), class_="sign"
    )
    header = make_element(
        "header",
        make_element("h1", title),
        make_element("p", f"d2rpick {__version__}", class_="soft"),
        sign,
    )
    body = make_element(
        "body",
        header,
        build_contents(content),
        make_element("main", *content),
        *(make_element("script", script) for script in scripts),
    )
    return f"<!DOCTYPE html>\n{make_element('html', head, body, lang='en')}\n"


def _make_policy(styles: Sequence[str], scripts: Sequence[str]) -> str:
    """Return the content security policy: nothing is fetched, and only the page's own scripts and styles are used.

    The policy applies whatever the input files contain.  Drawings have their styles in attributes.  Older browsers
    support only one rule for all styles.
    """
    allowed = {"style-src-elem": styles, "script-src": scripts}
    rules = [
        f"{name} {' '.join(map(_compute_digest, texts)) or _NOTHING}"
        for name, texts in allowed.items()
    ]
    base = f"default-src {_NOTHING}; base-uri {_NOTHING}; form-action {_NOTHING}"
    return "; ".join(
        [base, *rules, "style-src-attr 'unsafe-inline'", "style-src 'unsafe-inline'"]
    )


def _compute_digest(text: str) -> str:
    return f"'sha256-{b64encode(sha256(text.encode()).digest()).decode()}'"


def build_section(title: str, *content: str) -> PageSection:
    """Return a section with a title."""
    return _make_section(title, make_element("h2", title), *content)


def name_section(
    content: Markup, title: str, anchor: str, *, needs_script: bool = False
) -> PageSection:
    """Return markup as a section to which the table of contents links."""
    section = PageSection(content)
    section.name, section.anchor = title, anchor
    section.needs_script = needs_script
    return section


def _make_section(title: str, *content: str) -> PageSection:
    """Return a section with an id made from its title."""
    letters = (letter if letter.isalnum() else "-" for letter in title.casefold())
    anchor = f"section-{''.join(letters)}"
    return name_section(make_element("section", *content, id=anchor), title, anchor)


def build_contents(content: Iterable[str]) -> Markup:
    """Return a table of contents with links to the sections of a page; empty if the page is short."""
    sections = [part for part in content if isinstance(part, PageSection)]
    if len(sections) < _LONG:
        return Markup()
    links = (
        make_element(
            "li",
            make_element("a", section.name, href=f"#{section.anchor}"),
            class_="of-script" if section.needs_script else "of-page",
        )
        for section in sections
    )
    return make_element(
        "nav", make_element("ul", *links), class_="contents", aria_label="Contents"
    )


def build_drawing(caption: str, svg: str) -> Markup:
    """Return an SVG element as a figure with a caption."""
    drawn = make_element("div", Markup(svg), role="img", aria_label=caption)
    return make_element(
        "figure", drawn, make_element("figcaption", caption), class_="drawn"
    )


def build_remarks(cautions: Iterable[Caution], reasons: Iterable[str] = ()) -> Markup:
    """Return a list of reasons and warnings; empty if there are none."""
    lines = [make_element("li", reason) for reason in reasons]
    lines += [
        make_element("li", make_element("b", caution.code), f": {caution.message}")
        for caution in cautions
    ]
    return make_element("ul", *lines, class_="warnings") if lines else Markup()


def read_resource(name: str) -> Markup:
    """Read a text file of the package."""
    return Markup(files("d2rpick.report").joinpath(name).read_text("utf-8"))


def build_scrolling_table(
    title: str,
    head: Sequence[str],
    rows: Iterable[Sequence[Cell]],
    marked: int | None = None,
) -> Markup:
    """Return a table in a box that scrolls sideways if needed; ``title`` names the box for keyboard users."""
    box = make_element(
        "div",
        build_grid(head, rows, marked),
        class_="scroll",
        role="region",
        aria_label=title,
        tabindex="0",
    )
    return (
        join([make_element("p", _HINT, class_="hint"), box])
        if len(head) > _FIT
        else box
    )


def build_grid(
    head: Sequence[str], rows: Iterable[Sequence[Cell]], marked: int | None = None
) -> Markup:
    """Return a table without a scrolling box; the row ``marked`` is highlighted.

    Columns of numbers are right-aligned.  Lines break only at blanks, never within a number.
    """
    body = [list(row) for row in rows]
    is_number = [
        name == "±"
        or all(row[i] is None or isinstance(row[i], (int, float)) for row in body)
        for i, name in enumerate(head)
    ]
    classes = [{"class_": "number"} if is_right else {} for is_right in is_number]
    top = (
        make_element("th", name, scope="col", **cell_class)
        for name, cell_class in zip(head, classes, strict=True)
    )
    lines = [
        make_element(
            "tr",
            *(
                _build_cell(cell, cell_class)
                for cell, cell_class in zip(row, classes, strict=True)
            ),
            **({"class_": "marked"} if i == marked else {}),
        )
        for i, row in enumerate(body)
    ]
    return make_element(
        "table",
        make_element("thead", make_element("tr", *top)),
        make_element("tbody", *lines),
    )


def _build_cell(cell: Cell, attributes: Mapping[str, str]) -> Markup:
    text = cell if isinstance(cell, Markup) else format_short(cell)
    return make_element(
        "td", text, **(attributes or ({"class_": "words"} if " " in text else {}))
    )


def build_pairs(rows: Iterable[tuple[str, str]]) -> Markup:
    """Return a list of names and descriptions; empty if there are none."""
    listed = [
        make_element("div", make_element("dt", name), make_element("dd", text))
        for name, text in rows
    ]
    return make_element("dl", *listed) if listed else Markup()


def build_steps(rows: Iterable[tuple[str, str]]) -> Markup:
    """Return a list of names and descriptions in which each command has a line of its own, with a button to copy it.

    Examples
    --------
    >>> print(build_steps([("next", "look with d2rpick info 'my run.csv' (the run)")]))
    <dl><div><dt>next</dt><dd>look with <pre class="wrap">d2rpick info 'my run.csv'</pre> (the run)</dd></div></dl>
    """
    return build_pairs((name, _mark_commands(text)) for name, text in rows)


def _mark_commands(text: str) -> Markup:
    return join(
        make_element("pre", piece, class_="wrap") if is_command else piece
        for piece, is_command in split_at_commands(text)
    )


def _replace_markup(text: str, *, quote: bool = True) -> str:
    return escape(text, quote=quote).translate(_CONTROLS)


class Explorer(NamedTuple):
    """Trade-offs of one or several flights that can be explored on a page.

    ``command`` has the words of the command line for a td, those before and those after the value of td.
    """

    trade_offs: tuple[TradeOff, ...]
    command: tuple[Sequence[str], Sequence[str]]


class PageContext(NamedTuple):
    """Content of a page in addition to the answer.

    ``run`` is the input, ``switched`` a finished switched run.  ``command`` repeats the answer; ``judging`` are the
    options of ``card`` that select the same history.  ``printing`` is how the card of a recommended
    or verified pair is printed; ``card`` is None if there are no parts to switch, or if ``refusal`` says why it cannot
    be printed.  ``explorer`` makes the page interactive.  ``question`` has the words with which the next command asks
    about the same run.
    """

    run: OpenedRun
    command: Sequence[str]
    judging: Sequence[str]
    printing: Printing | None = None
    card: PrintedCard | None = None
    refusal: str = ""
    switched: OpenedRun | None = None
    explorer: Explorer | None = None
    question: RepeatedQuestion | None = None


def build_front(cards: Sequence[Markup], *below: Markup) -> Markup:
    """Return the first section: the cards of the chosen or judged pairs side by side, with remarks below them."""
    return make_element("section", make_element("div", *cards, class_="choice"), *below)


def build_refusal(reason: str) -> Markup:
    """Return the card of an answer that recommends nothing."""
    return make_element(
        "div",
        make_element(
            "h2", make_element("span", "nothing to use", class_="badge refused")
        ),
        make_element("p", reason),
        class_="card refused",
    )


def get_title(run: OpenedRun) -> str:
    """Return the run title from the solver or, without a title, the file name."""
    return (
        next((database.title for database in run.databases if database.title), "")
        or run.name
    )


def build_pair_card(
    title: str,
    times: tuple[float, float],
    description: Markup,
    history: History,
    class_: str,
) -> Markup:
    """Return the card of (tr, td): the times in large type, a description of the pair, and the full-precision times."""
    unit = f" {history.time_unit}" if history.time_unit else ""
    large_times = (
        make_element("span", make_element("i", name), f"{format_short(time)}{unit}")
        for name, time in zip(("tr", "td"), times, strict=True)
    )
    full = (
        make_element("span", f"{name} = {time!r}")
        for name, time in zip(("tr", "td"), times, strict=True)
    )
    exact = make_element("p", "in full: ", join(full, ", "), class_="soft exact")
    return make_element(
        "div",
        make_element("h2", title),
        make_element("div", *large_times, class_="times"),
        description,
        exact,
        class_=class_,
    )


def build_verdict_card(
    title: str,
    decision: Decision,
    times: tuple[float, float],
    history: History,
    facts: Iterable[tuple[str, str]],
) -> Markup:
    """Return the card with a verdict: ``title``, the verdict as a badge, the times in large type, and the reason."""
    _, *why = list_verdict_lines(decision, *times)
    return build_pair_card(
        join([title, build_badge(decision)]),
        times,
        build_pairs([*why, *facts]),
        history,
        f"card {CLASSES[decision.verdict]}",
    )


def build_badge(decision: Decision) -> Markup:
    """Return the verdict in a frame of its colour."""
    class_ = f"badge {CLASSES[decision.verdict]}"
    return make_element("span", decision.verdict, class_=class_)


def list_digests(files: Iterable[Read]) -> list[tuple[str, str]]:
    """Return each file with the SHA-256 digest of its content."""
    return [("SHA-256", f"{file.name}: {file.sha256()}") for file in files]


def list_deck_digests(
    deck: Iterable[Read], weights: Weights | None
) -> list[tuple[str, str]]:
    """Return the digests of the files of a deck, main file first, and of the weights; long lists are truncated."""
    files = list({file.name: file for file in deck}.values())
    hidden_count = len(files) - _MOST_FILES
    if hidden_count > 0:
        hidden = [
            ("SHA-256", f"of {hidden_count} more files of the deck: in the JSON result")
        ]
    else:
        hidden = []
    return [
        *list_digests(files[:_MOST_FILES]),
        *hidden,
        *list_digests([weights.file] if weights and weights.file else []),
    ]


def list_digests_of_settings(settings: Settings) -> list[tuple[str, str]]:
    """Return the digests of the deck on which an answer is based; empty without a deck."""
    used = settings.by_deck
    return list_deck_digests(used.files, used.weights) if used else []


def build_evidence(
    situation: Situation, health: Health | None, record: PageContext
) -> Iterator[Markup]:
    """Return the sections on the input, its health, the method, and the command that repeats the answer."""
    yield build_section("What was read", _build_input(situation, record.run))
    yield build_section("Health of the reference run", *_build_health(health))
    yield from build_method(record.command, "-" in record.run.sources)


def build_method(command: Sequence[str], stdin: bool = False) -> Iterator[Markup]:
    """Return the sections on the method of an answer, and on the command that repeats the answer."""
    folded = make_element(
        "details",
        make_element("summary", make_element("h2", "Method and limits")),
        read_resource("method.html"),
    )
    yield _make_section("Method and limits", folded)
    yield build_command(command, stdin)


def build_command(command: Sequence[str], stdin: bool = False) -> PageSection:
    """Return the section with the shell command that repeats the answer."""
    stdin_note = (
        [make_element("p", "with the same history on standard input:")] if stdin else []
    )
    return build_section(
        "To repeat this",
        *stdin_note,
        make_element("pre", quote_shell_line(command), class_="wrap"),
    )


def build_solver_input(
    decision: Decision, times: tuple[float, float], record: PageContext
) -> Markup:
    """Return the D2R card of a pair, or the command that prints it; it is collapsed if the verdict is "do not use"."""
    title = "Solver input"
    contents = _list_solver_input(times, record)
    if decision.verdict != DO_NOT_USE:
        return build_section(title, *contents)
    badge = make_element("span", decision.verdict, class_="badge refused")
    cure = f" To improve: {decision.cure}." if decision.cure else ""
    return build_section(
        title,
        make_element("p", badge),
        make_element("p", f"{decision.reason}.{cure}"),
        make_element(
            "details",
            make_element("summary", "Show the card that must not be used"),
            *contents,
            class_="unused",
        ),
    )


def _list_solver_input(
    times: tuple[float, float], record: PageContext
) -> tuple[Markup, ...]:
    """Return the D2R card if the parts to be switched are known; otherwise return the command that prints it."""
    printing = record.printing
    assert printing is not None
    if record.refusal:
        reason = f"No card can be printed for these times: {record.refusal}"
        return (make_element("p", reason),)
    if record.card:
        return (make_element("pre", record.card.text, tabindex="0"),)
    solver = printing.solver or DEFAULT
    command = ["d2rpick", "card", "--tr", repr(times[0]), "--td", repr(times[1])]
    command += [] if solver == DEFAULT else ["--solver", solver]
    kind = SOLVERS[solver].switches
    example = SOME_NODES if kind == "node" else SOME_PARTS
    line = make_element(
        "pre",
        quote_shell_line([*command, f"--{kind}", example, *record.judging]),
        class_="wrap",
    )
    title = _SWITCHED[kind]
    return (
        make_element(
            "p",
            f"No file of this answer names the {title} to be switched. In the command below, put their ids in place of "
            f"{example}; it prints the card and judges its times.",
        ),
        line,
    )


def _build_input(situation: Situation, run: OpenedRun) -> Markup:
    listed = [
        *list_situation_heading(situation, verbose=True),
        *list_digests(run.files),
        *list_digests_of_settings(situation.settings),
    ]
    listed += [
        (f"{database.format} by", database.version)
        for database in run.databases
        if database.version
    ]
    if situation.history.complete:
        whole = "the files end after a complete state"
    else:
        whole = "only complete states were used"
    listed += [("complete", whole)]
    return build_pairs(listed + [("note", note) for note in situation.history.notes])


def _build_health(health: Health | None) -> Iterator[Markup]:
    if health is None or not any(
        health_measure.value for health_measure in list_health_measures(health)
    ):
        yield make_element("p", "The files do not hold the energies this needs.")
        return
    verdicts = {
        True: make_element("span", "kept", class_="good"),
        False: make_element("span", "exceeded", class_="bad"),
        None: "-",
    }
    listed = [
        (
            health_measure.what,
            health_measure.value or "not written",
            health_measure.limit,
            verdicts[health_measure.good],
        )
        for health_measure in list_health_measures(health)
    ]
    yield build_scrolling_table(
        "Health of the reference run",
        ("measure", "this run", "usual limit", "verdict"),
        listed,
    )
    window = health.window
    where = " The window is {:.6g} to {:.6g}.".format(*window) if window else ""
    yield make_element(
        "p",
        f"Up to td; shares are of the peak of the internal energy.{where}",
        class_="soft",
    )
    if health.reason:
        yield make_element("p", health.reason)
