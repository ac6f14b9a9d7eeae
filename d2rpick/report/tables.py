"""Write tables as text, Markdown and CSV, numbers with few digits, and command lines with shell quoting."""

from __future__ import annotations

import os
import re
from operator import gt
from typing import TYPE_CHECKING, Any, Final

from d2rpick.base.errors import UNSEEN, make_printable
from d2rpick.report.formats import WIDEST

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence


Cell = str | float | int | bool | None
Rows = "Iterable[Sequence[Cell]]"
# _WORD: in a table that is too wide, words longer than this number of characters (e.g. paths) are split first.
# _LEAST: in a table that is still too wide, words of more characters than this are split. All numbers are shorter.
_WORD: Final = 32
_LEAST: Final = 12
# Pattern of a word that cmd and PowerShell pass on unchanged without quotes.
_PLAIN_ON_WINDOWS: Final = r"[\w./\\:=+-]+"
# _ARGUMENT: pattern of an argument as `quote_shell_line` writes it.
# _COMMAND: pattern of a command in a sentence, with at least one argument, to the end of the clause.
# _FOLDER: pattern of an argument that names the current folder or the one above it.
_FOLDER: Final = r"\.{1,2}"
_ARGUMENT: Final = r"""(?:\$'(?:\\.|[^'\\])*'|'[^']*'|"[^"]*"|[^\s'"()])+"""
_COMMAND: Final = (
    rf"\bd2rpick [a-z]+(?: (?:{_FOLDER}(?!\S)|{_ARGUMENT}(?<![.,;:])))*(?: {_ARGUMENT})"
)
# Beginning of a line whose text tells what to do next.
_NEXT: Final = r"next(?=  )|next(?=: )"
# _NUMBER: pattern of a number, which is not treated as a spreadsheet formula.
# _SIGNS: =, +, -, @ and their full-width, small, raised and lowered forms, which normalisation turns into these signs.
# _FORMULA: pattern of a spreadsheet formula, which begins with one of these signs.
# A formula may follow a semicolon, because some spreadsheets use it to separate the cells of a CSV file.
_NUMBER: Final = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_SIGNS: Final = r"=+\-@＝＋－＠﹦﹢﹣﹫⁼⁺₌₊⩵⩶﬩"
_FORMULA: Final = rf"(?:^|;)\s*(?=[{_SIGNS}])(?!{_NUMBER}\s*(?:;|$))"
# Largest number of characters in a cell that is not wrapped; longer cells are wrapped before columns are omitted.
_TEXT: Final = 20


def format_short(value: Cell) -> str:
    """Format a cell for display: six significant digits, or a dash if the value is unknown.

    Examples
    --------
    >>> format_short(0.0128852793630525), format_short(None), format_short(True)
    ('0.0128853', '-', 'yes')
    """
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.6g}" if isinstance(value, float) else make_printable(str(value))


def format_measure(value: float | None) -> str:
    """Format a fraction or an error with three decimals, such as 0.957; a dash if it is unknown.

    Examples
    --------
    >>> format_measure(0.95744), format_measure(3e-16)
    ('0.957', '0.000')
    """
    return "-" if value is None else f"{value:.3f}"


def format_if_known(value: float | None, form: str) -> str | None:
    """Format a number with a Python format such as ``.0%``; return None if the number is unknown."""
    return None if value is None else format(value, form)


def format_half_width(low: float | None, high: float | None) -> str | None:
    """Return half the width of an interval as text, for use after "+-"; None if the width is unknown."""
    return None if low is None or high is None else f"{(high - low) / 2:.1e}"


def select_known_columns(
    head: Sequence[str], rows: Sequence[Sequence[Cell]]
) -> tuple[list[str], list[list[Cell]]]:
    """Drop the columns that contain only unknown values.

    Examples
    --------
    >>> select_known_columns(["tr", "sign", "R"], [[0.5, None, "-"], [0.7, None, "-"]])
    (['tr'], [[0.5], [0.7]])
    """
    known_columns = [
        i
        for i in range(len(head))
        if any(row[i] not in (None, "", "-") for row in rows)
    ]
    return select_columns(head, rows, known_columns)


def select_columns(
    head: Sequence[str], rows: Sequence[Sequence[Cell]], columns: Sequence[int]
) -> tuple[list[str], list[list[Cell]]]:
    """Return the columns of a table with these indices."""
    selected_rows = [[row[i] for i in columns] for row in rows]
    return [head[i] for i in columns], selected_rows


def fill_table(
    columns: Mapping[str, Callable[[Any], Cell]], things: Iterable[Any]
) -> tuple[list[str], list[list[Cell]]]:
    """Return the names of the columns, and one row of cells per object.

    Examples
    --------
    >>> fill_table({"word": str, "letters": len}, ["tr", "flight"])
    (['word', 'letters'], [['tr', 2], ['flight', 6]])
    """
    return list(columns), [
        [cell(thing) for cell in columns.values()] for thing in things
    ]


def remove_star_column(
    head: Sequence[str], rows: Iterable[Sequence[Cell]]
) -> tuple[list[str], list[list[Cell]]]:
    """Remove the first column, in which a star marks the recommendation, and replace +- by ``±`` for a page."""
    return [name.replace("+-", "±") for name in head[1:]], [
        list(row[1:]) for row in rows
    ]


def format_in_line(
    named_texts: Iterable[tuple[str, Cell]], width: int = 0
) -> list[str]:
    """Return a line per name and text, aligned at ``width`` characters (by default, the length of the longest name)."""
    lines = list(named_texts)
    width = width or max((len(name) for name, _ in lines), default=0)
    return [f"{name.ljust(width)}  {format_short(value)}" for name, value in lines]


def format_as_list(named_texts: Iterable[tuple[str, str]]) -> list[str]:
    """Return (name, text) pairs as Markdown paragraphs."""
    return [f"{name}: {escape_markdown(text)}" for name, text in named_texts]


def as_text(
    head: Sequence[str],
    rows: Iterable[Sequence[Cell]],
    width: int = WIDEST,
    spare: Iterable[str] = (),
) -> str:
    """Return a table as text, with right-aligned numbers and two spaces between columns.

    A table wider than ``width`` first loses the columns in ``spare``, in that order; then the widest columns
    wrap their text.

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
    texts = {
        name: [format_short(name), *map(format_short, cells)]
        for name, cells in columns.items()
    }
    widths = {name: max(map(len, column)) for name, column in texts.items()}
    for name in spare:
        if (
            name in widths
            and sum(min(_TEXT, w) + 2 for w in widths.values()) - 2 > width
        ):
            del widths[name], texts[name]
    is_number = [
        all(cell is None or isinstance(cell, (int, float)) for cell in columns[name])
        for name in texts
    ]
    narrow = _reduce_widths(
        [*zip(*texts.values(), strict=True)], [*widths.values()], width
    )
    lines = (
        "  ".join(
            t.rjust(w) if r else t.ljust(w)
            for t, w, r in zip(line, narrow, is_number, strict=True)
        )
        for row in zip(*texts.values(), strict=True)
        for line in _wrap_cells(row, narrow)
    )
    return "\n".join(line.rstrip() for line in lines)


def wrap_lines(text: str, width: int) -> str:
    r"""Wrap lines longer than ``width``; continuation lines are indented to the text after the name.

    In a line that tells what to do next, each command gets a line of its own, which is not wrapped, so that it can be
    copied.

    Examples
    --------
    >>> print(wrap_lines("quality  fair: the sign is unknown\nbasis    energy", 24))
    quality  fair: the sign
             is unknown
    basis    energy
    """
    return "\n".join(
        line if len(line) <= width else _wrap_below_name(line, width)
        for line in text.split("\n")
    )


def wrap_command(line: str, width: int) -> str:
    r"""Wrap a command line longer than ``width`` before its options; a shell still reads it as one command.

    Examples
    --------
    >>> print(wrap_command("d2rpick drive --engine 'engine -i {deck}' -o driven", 44))
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


def _wrap_below_name(line: str, width: int) -> str:
    """Wrap a line; its continuation lines are indented to the text after the name or, without a name, like the line."""
    from textwrap import TextWrapper

    name = re.match(r"\s*(?:\S+ )*?\S+  +(?=\S)|\s*", line)
    indent = " " * (len(name[0]) if name and len(name[0]) <= width // 2 else 2)
    wrapper = TextWrapper(
        width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
    )
    if not re.match(_NEXT, line):
        return wrapper.fill(line)
    label = name[0] if name else ""
    lines: list[str] = []
    for piece, is_command in split_at_commands(line.removeprefix(label)):
        beginning = indent if lines else label
        if is_command:
            lines.append(f"{beginning}{piece}")
        elif piece.strip():
            wrapper.initial_indent = beginning
            lines += wrapper.wrap(piece.strip())
    return "\n".join(lines)


def split_at_commands(text: str) -> Iterator[tuple[str, bool]]:
    """Yield the pieces of a text in their order, and whether each is a command.

    A command ends before a hint in parentheses, or with the clause.

    Examples
    --------
    >>> list(split_at_commands("look with d2rpick info 'my run.csv' (the run)"))
    [('look with ', False), ("d2rpick info 'my run.csv'", True), (' (the run)', False)]
    >>> list(split_at_commands("look with d2rpick verify --switched . run.csv"))
    [('look with ', False), ('d2rpick verify --switched . run.csv', True), ('', False)]
    """
    end = 0
    for match in re.finditer(_COMMAND, text):
        command = match[0]
        if not re.search(rf" {_FOLDER}$", command):
            command = command.rstrip(".,;:")
        yield text[end : match.start()], False
        yield command, True
        end = match.start() + len(command)
    yield text[end:], False


def _reduce_widths(
    texts: Sequence[Sequence[str]], widths: Sequence[int], width: int
) -> list[int]:
    """Reduce the widest columns until a table fits: wrap column names first, then cells, and split words last."""
    narrowed = list(widths)
    names, *cells = (
        [min(_WORD, max(map(len, text.split()), default=1)) for text in row]
        for row in texts
    )
    whole = [
        max(name, *(len(row[i]) for row in texts[1:])) for i, name in enumerate(names)
    ]
    words = [max(column) for column in zip(names, *cells, strict=True)]
    excess = sum(widths) + 2 * (len(widths) - 1) - width
    for floor_widths in (whole, words, [min(_LEAST, word) for word in words]):
        while excess > 0 and any(map(gt, narrowed, floor_widths)):
            widest = max(
                (i for i in range(len(narrowed)) if narrowed[i] > floor_widths[i]),
                key=lambda i: narrowed[i],
            )
            narrowed[widest] -= 1
            excess -= 1
    return narrowed


def _wrap_cells(row: Sequence[str], widths: Sequence[int]) -> Iterator[list[str]]:
    """Yield the lines of a row whose cells are wrapped to the widths of their columns."""
    from itertools import zip_longest

    cells = (
        _wrap_words(text, width) if len(text) > width else [text]
        for text, width in zip(row, widths, strict=True)
    )
    yield from (list(line) for line in zip_longest(*cells, fillvalue=""))


def _wrap_words(text: str, width: int) -> list[str]:
    """Wrap a string between words. Longer words break after the characters that join names, paths and part ids."""
    from textwrap import TextWrapper

    wrapper = TextWrapper(width, break_on_hyphens=False)
    if max(map(len, text.split())) > width:
        wrapper.wordsep_simple_re = re.compile(r"(\s+)|(?<=[,/_-])(?=\w)")
    return wrapper.wrap(text)


def as_markdown(head: Sequence[str], rows: Iterable[Sequence[Cell]]) -> str:
    """Return a Markdown table with escaped cells.

    Examples
    --------
    >>> print(as_markdown(["tr", "kind"], [[0.5, "crossing"]]))
    | tr | kind |
    | --- | --- |
    | 0.5 | crossing |
    """
    lines = [
        [format_short(name) for name in head],
        ["---"] * len(head),
        *([escape_markdown(format_short(c)) for c in row] for row in rows),
    ]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def escape_markdown(text: str) -> str:
    r"""Escape the Markdown markup in a name, and replace unprintable characters.

    Examples
    --------
    >>> print(escape_markdown("a|b"), escape_markdown("C:\\run"), escape_markdown("<i>part_1</i>"))
    a\|b C:\\run \<i>part_1\</i>
    """
    return re.sub(
        r"[\\|<*\[~]|&(?=#?\w+;)|(?<![^\W_])_|_(?![^\W_])",
        r"\\\g<0>",
        make_printable(text),
    )


def as_csv(head: Sequence[str], rows: Iterable[Sequence[Cell]]) -> str:
    r"""Return CSV at full precision, with commas, line feeds as line endings, and empty cells for unknown values.

    A string that a spreadsheet would treat as a formula gets a leading apostrophe: names and titles come from files.

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
    writer.writerow(map(_make_exact_cell, head))
    writer.writerows(map(_make_exact_cell, row) for row in rows)
    return text.getvalue()


def _make_exact_cell(value: Cell) -> Cell:
    if isinstance(value, bool):
        return str(value).lower()
    if not isinstance(value, str):
        return value
    return re.sub(_FORMULA, r"\g<0>'", make_printable(value))


def as_json(result: Any, indent: int | None = 2) -> str:
    r"""Write a result as JSON at full precision, with null for unknown values. A NaN is a bug and raises ValueError.

    If ``indent`` is not given, the result is one line.  Characters that control a terminal or change the text direction
    become ``\u....``.
    """
    import json
    import unicodedata

    def seen(match: re.Match[str]) -> str:
        if unicodedata.category(match[0]) in UNSEEN:
            return json.dumps(match[0])[1:-1]
        return match[0]

    return re.sub(
        r"[^\n -~]",
        seen,
        json.dumps(result, indent=indent, allow_nan=False, ensure_ascii=False),
    )


def quote_shell_line(words: Iterable[str]) -> str:
    r"""Quote words with printable characters only, so that bash, zsh and POSIX.1-2024 shells read them back unchanged.

    On Windows, the words are quoted for cmd and PowerShell.

    Examples
    --------
    >>> print(quote_shell_line(["d2rpick", "info", "my run.csv", "it's\n\udcff"]))
    d2rpick info 'my run.csv' $'it\'s\012\377'
    """
    if os.name == "nt":
        return quote_windows_line(words)
    import shlex  # Imported here to keep start-up fast.

    return " ".join(
        shlex.quote(word)
        if word.isprintable()
        else f"$'{''.join(map(_escape_letter, word))}'"
        for word in words
    )


def quote_windows_line(words: Iterable[str]) -> str:
    r"""Quote words with double quotes, so that programs started by cmd and PowerShell read them back.

    PowerShell would split an unquoted word at a comma.

    Examples
    --------
    >>> print(quote_windows_line(["d2rpick", "plan", "--part", "1,2", "C:\\my run\\", "runs\\a"]))
    d2rpick plan --part "1,2" "C:\my run\\" runs\a
    """
    return " ".join(map(_quote_windows_word, words))


def _quote_windows_word(word: str) -> str:
    """Return a word in double quotes, unless no shell changes it; the backslashes before a quote are doubled."""
    if re.fullmatch(_PLAIN_ON_WINDOWS, word):
        return word
    escaped = re.sub(r'(\\*)"', r'\1\1\\"', make_printable(word))
    return '"{}"'.format(re.sub(r"(\\+)$", r"\1\1", escaped))


def make_positional(names: Sequence[str]) -> tuple[str, ...]:
    """Return names as typed after the options of a command, with ``--`` first if a name looks like an option.

    Examples
    --------
    >>> make_positional(["glstat", "-"]), make_positional(["-run.csv"])
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


def _escape_letter(letter: str) -> str:
    if letter.isprintable():
        return f"\\{letter}" if letter in "\\'" else letter
    # Bytes of a file name that are not valid text appear as lone surrogates.
    errors = "surrogateescape" if "\udc80" <= letter <= "\udcff" else "surrogatepass"
    # Octal escapes have exactly three digits, whereas some shells read more than two digits of a hexadecimal escape.
    return "".join(f"\\{byte:03o}" for byte in letter.encode(errors=errors))
