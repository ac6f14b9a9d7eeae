"""Tables for reading, as Markdown and as CSV, numbers as people read them, command lines as a shell takes them."""

from __future__ import annotations

import re
from operator import gt
from typing import TYPE_CHECKING, Any, Final

from d2rpick.base.errors import UNSEEN, make_printable
from d2rpick.report.formats import WIDEST

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence


Cell = str | float | int | bool | None
Rows = "Iterable[Sequence[Cell]]"
# A longer word, as a path or a list of parts, is broken where a table would be too wide, and one of more than the least
# where that is not enough: no number is as long.
_WORD: Final = 32
_LEAST: Final = 12
# Before these signs, which spreadsheets of some languages also know in full width, a formula begins: in a cell, and
# behind a semicolon, which separates cells in languages that write decimals with a comma.  A number is none.
_NUMBER: Final = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_FORMULA: Final = rf"(?:^|;)\s*(?=[=+\-@＝＋－＠])(?!{_NUMBER}\s*(?:;|$))"
# A cell of more letters is text, which may go on in a further line before a column is left out.
_TEXT: Final = 20


def short(value: Cell) -> str:
    """Write a cell for people: six significant digits, a dash for what is not known.

    Examples
    --------
    >>> short(0.0128852793630525), short(None), short(True)
    ('0.0128853', '-', 'yes')
    """
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.6g}" if isinstance(value, float) else make_printable(str(value))


def measure(value: float | None) -> str:
    """Write a share or an error, for which three decimals say all: 0.957, 0.000, or a dash.

    Examples
    --------
    >>> measure(0.95744), measure(3e-16)
    ('0.957', '0.000')
    """
    return "-" if value is None else f"{value:.3f}"


def shown(value: float | None, form: str) -> str | None:
    """Write a number in a form of Python's, as ``.0%``; None where it is not known."""
    return None if value is None else format(value, form)


def half(low: float | None, high: float | None) -> str | None:
    """Write half the width of an interval, as it stands behind +-."""
    return None if low is None or high is None else f"{(high - low) / 2:.1e}"


def known(
    head: Sequence[str], rows: Sequence[Sequence[Cell]]
) -> tuple[list[str], list[list[Cell]]]:
    """Leave the columns out in which nothing is known.

    Examples
    --------
    >>> known(["tr", "sign", "R"], [[0.5, None, "-"], [0.7, None, "-"]])
    (['tr'], [[0.5], [0.7]])
    """
    kept = [
        i
        for i in range(len(head))
        if any(row[i] not in (None, "", "-") for row in rows)
    ]
    return [head[i] for i in kept], [[row[i] for i in kept] for row in rows]


def filled(
    columns: Mapping[str, Callable[[Any], Cell]], things: Iterable[Any]
) -> tuple[list[str], list[list[Cell]]]:
    """Give the names of columns, and below them the cells of each thing.

    Examples
    --------
    >>> filled({"word": str, "letters": len}, ["tr", "flight"])
    (['word', 'letters'], [['tr', 2], ['flight', 6]])
    """
    return list(columns), [
        [cell(thing) for cell in columns.values()] for thing in things
    ]


def unstarred(
    head: Sequence[str], rows: Iterable[Sequence[Cell]]
) -> tuple[list[str], list[list[Cell]]]:
    """Leave out the first column, which has a star for what is recommended; ``±`` as it is written on a page."""
    return [name.replace("+-", "±") for name in head[1:]], [
        list(row[1:]) for row in rows
    ]


def in_line(said: Iterable[tuple[str, Cell]], width: int = 0) -> list[str]:
    """Write lines of a name, in so many letters or those of the longest, and what it stands for."""
    lines = list(said)
    width = width or max(len(name) for name, _ in lines)
    return [f"{name.ljust(width)}  {short(value)}" for name, value in lines]


def listed(said: Iterable[tuple[str, str]]) -> list[str]:
    """Write the same as paragraphs of Markdown."""
    return [f"{name}: {in_markdown(text)}" for name, text in said]


def as_text(
    head: Sequence[str],
    rows: Iterable[Sequence[Cell]],
    width: int = WIDEST,
    spare: Iterable[str] = (),
) -> str:
    """Columns in line, numbers to the right of their column, two blanks between.

    Where it would be wider than ``width``, columns of ``spare`` are left out, the first of them first, and then words
    of the widest columns go on in further lines.

    Examples
    --------
    >>> print(as_text(["tr", "kind"], [[0.5, "crossing"], [10.25, "extremum"]]))
       tr  kind
      0.5  crossing
    10.25  extremum
    >>> print(as_text(["part", "why"], [[7, "never any internal energy"]], width=20))
    part  why
       7  never any
          internal
          energy
    """
    body = list(rows)
    columns = {name: [row[i] for row in body] for i, name in enumerate(head)}
    texts = {name: [short(name), *map(short, cells)] for name, cells in columns.items()}
    widths = {name: max(map(len, column)) for name, column in texts.items()}
    for name in spare:
        if (
            name in widths
            and sum(min(_TEXT, w) + 2 for w in widths.values()) - 2 > width
        ):
            del widths[name], texts[name]
    right = [
        all(cell is None or isinstance(cell, (int, float)) for cell in columns[name])
        for name in texts
    ]
    narrow = _narrowed([*zip(*texts.values(), strict=True)], [*widths.values()], width)
    lines = (
        "  ".join(
            t.rjust(w) if r else t.ljust(w)
            for t, w, r in zip(line, narrow, right, strict=True)
        )
        for row in zip(*texts.values(), strict=True)
        for line in _broken(row, narrow)
    )
    return "\n".join(line.rstrip() for line in lines)


def wrapped(text: str, width: int) -> str:
    r"""Break the lines of a text that are longer than ``width``; they go on below what follows a name.

    Examples
    --------
    >>> print(wrapped("quality  fair: the sign is unknown\nbasis    energy", 24))
    quality  fair: the sign
             is unknown
    basis    energy
    """
    return "\n".join(
        line if len(line) <= width else _below(line, width) for line in text.split("\n")
    )


def continued(line: str, width: int) -> str:
    r"""Break a command line that is longer than ``width`` before options, where a shell joins it again.

    Examples
    --------
    >>> print(continued("d2rpick drive --engine 'engine -i {deck}' -o driven", 44))
    d2rpick drive --engine 'engine -i {deck}' \
        -o driven
    """
    from textwrap import TextWrapper

    if len(line) <= width:
        return line
    indent = " " * (len(line) - len(line.lstrip()) + 4)
    wrapper = TextWrapper(
        width - 2,
        subsequent_indent=indent,
        break_long_words=False,
        break_on_hyphens=False,
    )
    wrapper.wordsep_simple_re = re.compile(r"(\s+)(?=--?[a-z][^']*(?:'[^']*'[^']*)*$)")
    return " \\\n".join(wrapper.wrap(line))


def _below(line: str, width: int) -> str:
    """Break a line behind the blanks that follow its name, or those that it begins with."""
    from textwrap import fill

    name = re.match(r"\s*(?:\S+ )*?\S+  +(?=\S)|\s*", line)
    indent = len(name[0]) if name and len(name[0]) <= width // 2 else 2
    return fill(
        line,
        width,
        subsequent_indent=" " * indent,
        break_long_words=False,
        break_on_hyphens=False,
    )


def _narrowed(
    texts: Sequence[Sequence[str]], widths: Sequence[int], width: int
) -> list[int]:
    """Take from the widest columns what is too much: names break before cells, and words at last."""
    found = list(widths)
    names, *cells = (
        [min(_WORD, max(map(len, text.split()), default=1)) for text in row]
        for row in texts
    )
    whole = [
        max(name, *(len(row[i]) for row in texts[1:])) for i, name in enumerate(names)
    ]
    words = [max(column) for column in zip(names, *cells, strict=True)]
    excess = sum(widths) + 2 * (len(widths) - 1) - width
    for least in (whole, words, [min(_LEAST, word) for word in words]):
        while excess > 0 and any(map(gt, found, least)):
            widest = max(
                (i for i in range(len(found)) if found[i] > least[i]),
                key=lambda i: found[i],
            )
            found[widest] -= 1
            excess -= 1
    return found


def _broken(row: Sequence[str], widths: Sequence[int]) -> Iterator[list[str]]:
    """Give the lines of a row whose cells are no wider than their columns."""
    from itertools import zip_longest

    cells = (
        _lines(text, width) if len(text) > width else [text]
        for text, width in zip(row, widths, strict=True)
    )
    yield from (list(line) for line in zip_longest(*cells, fillvalue=""))


def _lines(text: str, width: int) -> list[str]:
    """Break a text between words, or behind what joins names, folders and numbers of parts where one is too long."""
    from textwrap import TextWrapper

    wrapper = TextWrapper(width, break_on_hyphens=False)
    if max(map(len, text.split())) > width:
        wrapper.wordsep_simple_re = re.compile(r"(\s+)|(?<=[,/_-])(?=\w)")
    return wrapper.wrap(text)


def as_markdown(head: Sequence[str], rows: Iterable[Sequence[Cell]]) -> str:
    """Give a Markdown table; what would be markup in cells is escaped.

    Examples
    --------
    >>> print(as_markdown(["tr", "kind"], [[0.5, "crossing"]]))
    | tr | kind |
    | --- | --- |
    | 0.5 | crossing |
    """
    lines = [
        [short(name) for name in head],
        ["---"] * len(head),
        *([in_markdown(short(c)) for c in row] for row in rows),
    ]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def in_markdown(text: str) -> str:
    r"""Escape what Markdown would take for markup in a name, in printable text.

    Examples
    --------
    >>> print(in_markdown("a|b"), in_markdown("C:\\run"), in_markdown("<i>part_1</i>"))
    a\|b C:\\run \<i>part_1\</i>
    """
    return re.sub(
        r"[\\|<*\[~]|&(?=#?\w+;)|(?<![^\W_])_|_(?![^\W_])",
        r"\\\g<0>",
        make_printable(text),
    )


def as_csv(head: Sequence[str], rows: Iterable[Sequence[Cell]]) -> str:
    r"""Comma-separated at full precision, empty cells for what is not known, lines ending in a line feed.

    A text that a spreadsheet would compute as a formula gets an apostrophe before it: names and titles come from files.

    Examples
    --------
    >>> as_csv(["tr", "sign_match", "residual"], [[0.1, True, None]])
    'tr,sign_match,residual\n0.1,true,\n'
    >>> as_csv(["part", "energy"], [["=1+1", -2.5]])
    "part,energy\n'=1+1,-2.5\n"
    """
    import csv
    import io

    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(map(_exact, head))
    writer.writerows(map(_exact, row) for row in rows)
    return text.getvalue()


def _exact(value: Cell) -> Cell:
    if isinstance(value, bool):
        return str(value).lower()
    if not isinstance(value, str):
        return value
    return re.sub(_FORMULA, r"\g<0>'", make_printable(value))


def as_json(result: Any, indent: int | None = 2) -> str:
    r"""Write a result as JSON: full precision, null for what is not known; a NaN would be a fault and raises.

    Without an ``indent`` it is one line.  What commands a terminal or turns the text around is written as ``\u....``.
    """
    import json
    import unicodedata

    def seen(found: re.Match[str]) -> str:
        return (
            json.dumps(found[0])[1:-1]
            if unicodedata.category(found[0]) in UNSEEN
            else found[0]
        )

    return re.sub(
        r"[^\n -~]",
        seen,
        json.dumps(result, indent=indent, allow_nan=False, ensure_ascii=False),
    )


def shell_line(words: Iterable[str]) -> str:
    r"""Quote words so that bash, zsh and POSIX shells of 2024 give them back, in printable characters.

    Examples
    --------
    >>> print(shell_line(["d2rpick", "info", "my run.csv", "it's\n\udcff"]))
    d2rpick info 'my run.csv' $'it\'s\012\377'
    """
    import shlex  # not above: start-up

    return " ".join(
        shlex.quote(word)
        if word.isprintable()
        else f"$'{''.join(map(_escaped, word))}'"
        for word in words
    )


def positional(names: Sequence[str]) -> tuple[str, ...]:
    """Give names as they are typed behind the options: behind ``--`` where one could be taken for an option.

    Examples
    --------
    >>> positional(["glstat", "-"]), positional(["-run.csv"])
    (('glstat', '-'), ('--', '-run.csv'))
    """
    return (
        *(
            ["--"]
            if any(name.startswith("-") and name != "-" for name in names)
            else []
        ),
        *names,
    )


def _escaped(letter: str) -> str:
    if letter.isprintable():
        return f"\\{letter}" if letter in "\\'" else letter
    # Bytes of a file name that are no text come as lone surrogates.
    errors = "surrogateescape" if "\udc80" <= letter <= "\udcff" else "surrogatepass"
    # Three octal digits: of hexadecimal ones some shells take more than two, those of the name behind them.
    return "".join(f"\\{byte:03o}" for byte in letter.encode(errors=errors))
