"""HTML from nested calls: everything that is not HTML already is escaped."""

from __future__ import annotations

from base64 import b64encode
from hashlib import sha256
from html import escape
from importlib.resources import files
from typing import TYPE_CHECKING

from d2rpick.base import __version__
from d2rpick.report.tables import Cell, short

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from d2rpick.base.errors import Caution

# More columns than this do not fit on a narrow screen.
_FIT = 3
_HINT = "Where the table goes on to the right, scroll it sideways."
_VOID = frozenset({"meta", "link", "br", "hr", "input"})
_NOTHING = "'none'"
# Characters that no page may hold, and those that turn the text around them.
_TURNING = {*range(0x202A, 0x202F), *range(0x2066, 0x206A)}
_CONTROLS = dict.fromkeys({*range(32), *range(127, 160), *_TURNING} - {*map(ord, "\t\n")}, "\ufffd")


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
    given = "".join(f' {key.rstrip("_").replace("_", "-")}="{_escape(text)}"' for key, text in attributes.items())
    return Markup(f"<{name}{given}>" if name in _VOID else f"<{name}{given}>{join(children)}</{name}>")


def join(children: Iterable[str], between: str = "") -> Markup:
    """Put elements and texts one after the other."""
    return Markup(
        between.join(child if isinstance(child, Markup) else _escape(child, quote=False) for child in children)
    )


def document(
    title: str, *content: str, signed: Sequence[str], styles: Sequence[Markup] = (), scripts: Sequence[Markup] = ()
) -> str:
    """Give a whole page that needs nothing but itself, with lines ``signed`` to be filled in by hand.

    ``styles`` and ``scripts`` are what it needs beside the style of every page; nothing else takes effect on it.
    """
    sheets = (resource("style.css"), *styles)
    head = tag(
        "head",
        tag("meta", charset="utf-8"),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        tag("meta", http_equiv="Content-Security-Policy", content=_policy(sheets, scripts)),
        tag("title", title),
        *(tag("style", sheet) for sheet in sheets),
    )
    # on top, beside the times: behind a card of any length it may stand on a sheet of its own
    sign = tag("p", *(tag("span", line) for line in signed), class_="sign")
    header = tag("header", tag("h1", title), tag("p", f"d2rpick {__version__}", class_="soft"), sign)
    body = tag("body", header, tag("main", *content), *(tag("script", script) for script in scripts))
    return f"<!DOCTYPE html>\n{tag('html', head, body, lang='en')}\n"


def _policy(styles: Sequence[str], scripts: Sequence[str]) -> str:
    """Nothing is ever fetched, and only what the page itself is made of runs, whatever the files that were read hold.

    Drawings have styles of their own as attributes.  Older browsers know one rule for all styles only.
    """
    allowed = {"style-src-elem": styles, "script-src": scripts}
    rules = [f"{name} {' '.join(map(_digest, texts)) or _NOTHING}" for name, texts in allowed.items()]
    base = f"default-src {_NOTHING}; base-uri {_NOTHING}; form-action {_NOTHING}"
    return "; ".join([base, *rules, "style-src-attr 'unsafe-inline'", "style-src 'unsafe-inline'"])


def _digest(text: str) -> str:
    return f"'sha256-{b64encode(sha256(text.encode()).digest()).decode()}'"


def section(title: str, *content: str) -> Markup:
    """Give a section under its title."""
    return tag("section", tag("h2", title), *content)


def drawings(figures: Mapping[str, str]) -> Markup:
    """Show SVG elements with their captions."""
    return join(_figure(caption, svg) for caption, svg in figures.items())


def remarks(cautions: Iterable[Caution], reasons: Iterable[str] = ()) -> Markup:
    """List reasons and warnings; nothing where there are none."""
    lines = [tag("li", reason) for reason in reasons]
    lines += [tag("li", tag("b", caution.code), f": {caution.message}") for caution in cautions]
    return tag("ul", *lines, class_="warnings") if lines else Markup()


def resource(name: str) -> Markup:
    """Read a text that is part of the package."""
    return Markup(files("d2rpick.report").joinpath(name).read_text("utf-8"))


def table(title: str, head: Sequence[str], rows: Iterable[Sequence[Cell]], marked: int | None = None) -> Markup:
    """Give a table in a box that scrolls sideways where it is too wide; ``title`` is what a keyboard reaches it by."""
    box = tag("div", grid(head, rows, marked), class_="scroll", role="region", aria_label=title, tabindex="0")
    return join([tag("p", _HINT, class_="hint"), box]) if len(head) > _FIT else box


def grid(head: Sequence[str], rows: Iterable[Sequence[Cell]], marked: int | None = None) -> Markup:
    """Give a table alone; the row ``marked`` stands out.

    Columns of numbers, and of what is not known, are set to the right.  Lines break at blanks alone, never within a
    number.
    """
    body = [list(row) for row in rows]
    right = [all(row[i] is None or isinstance(row[i], (int, float)) for row in body) for i in range(len(head))]
    classes = [{"class_": "number"} if one else {} for one in right]
    top = (tag("th", name, scope="col", **own) for name, own in zip(head, classes, strict=True))
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


def _figure(caption: str, svg: str) -> Markup:
    drawn = tag("div", Markup(svg), role="img", aria_label=caption)
    return tag("figure", drawn, tag("figcaption", caption), class_="drawn")
