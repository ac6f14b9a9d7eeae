"""Read those cards of an LS-DYNA deck and its includes that matter for switching, in reading order."""

from __future__ import annotations

import os
import re
from bisect import bisect_right
from collections import defaultdict
from dataclasses import field
from functools import lru_cache
from itertools import chain
from typing import TYPE_CHECKING, Final

from d2rpick.base.caching import cached_property
from d2rpick.base.data_classes import dataclass
from d2rpick.base.errors import DeckError
from d2rpick.base.tuples import NamedTuple
from d2rpick.deck.card import (
    LONG,
    STANDARD,
    Card,
    CardField,
    Problem,
    Row,
    Scope,
    Transform,
)
from d2rpick.deck.ls_dyna_columns import (
    ID_OFFSETS,
    OTHER_OFFSET,
    TRANSFORMATION,
    UNIT_FACTORS,
)
from d2rpick.deck.source import Block, SourceFile

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path


_CONTINUED = " +"
UNKNOWN_KIND = "this kind of include is not read"

_KEPT: Final = (
    *(
        "DEFORMABLE_TO_RIGID",
        "RIGID_DEFORMABLE",
        "CONTROL_TERMINATION",
        "DATABASE_GLSTAT",
        "DATABASE_MATSUM",
    ),
    *(
        "PART",
        "SET_PART",
        "MAT_",
        "ELEMENT_",
        "SECTION_",
        "NODE",
        "CONTACT_",
        "RIGIDWALL_",
    ),
    *(
        "SET_NODE",
        "CONSTRAINED_",
        "DATABASE_HISTORY_NODE",
        "BOUNDARY_SPC",
        "BOUNDARY_PRESCRIBED_MOTION",
    ),
    *("LOAD_", "AIRBAG_", "INITIAL_VELOCITY", "DEFINE_CURVE"),
    *("SENSOR_CONTROL", "SENSOR_SWITCH", "SENSOR_DEFINE"),
)
_READ_INCLUDES: Final = ("INCLUDE", "INCLUDE_TRANSFORM")
# Paths on both cards are relative to the folder of the main deck.
_PATHS: Final = (
    "INCLUDE_PATH",
    "INCLUDE_PATH_RELATIVE",
)
_LONG: Final = r"\bLONG\s*=\s*([YSK])"  # This pattern is compiled on first use to keep start-up fast.
# Pattern of keywords that resemble switching keywords.
SWITCHING: Final = re.compile(r"\*\s*(DEFORMABLE|RIGID.DEFORMABLE)", re.IGNORECASE)
_SUFFIXES: Final = "+-%"
_DEEPEST = 60  # Largest depth of nested includes.
_MOST_FILES = 10_000
_MESH: Final = (
    r"\*(ELEMENT_|NODE\b)|"
    r"/(NODE|SHELL|SH3N|BRICK|TETRA4|TETRA10|PENTA6|QUAD|TRIA|BEAM|TRUSS|SPRING|BRIC20|SHEL16|SPHCEL|XELEM)(/|\s*\Z)"
)
# Engine keywords that require values; a file that ends with such a keyword line is truncated.
_WITH_VALUES: Final = (
    "RUN",
    "RBODY",
    "DT",
    "DTIX",
    "STOP",
    "INIV",
    "SENS",
    "TFILE",
    "VERS",
    "BCS",
    "BCSR",
    "DEL",
    "END",
)


class Unread(NamedTuple):
    """An include file that was not read: its name as written in the deck, and the reason."""

    name: CardField
    reason: str


class Restart(NamedTuple):
    """The start time of a restart [time of the run], and the field that contains it."""

    at: float
    stop_field: CardField


def _read_include_card(
    card: Card,
) -> Iterator[tuple[CardField, Transform, tuple[Problem, ...]]]:
    """Yield, for each file on an ``*INCLUDE`` card, its name, its transform and the fields that could not be read.

    ``*INCLUDE`` has one name per line, and ``*INCLUDE_TRANSFORM`` one name followed by lines of numbers.
    """
    names = _read_file_names(card)
    if card.name == "INCLUDE":
        yield from ((name, card.transform, ()) for name, _ in names)
    elif first := next(names, None):
        name, rows = first
        transform, problems = _read_transform(card, rows)
        yield name, transform.inside(card.transform), problems


def _read_file_names(card: Card) -> Iterator[tuple[CardField, list[Row]]]:
    """Yield each file name on a card with the rows after it.

    A name that ends with blank and plus continues on the next line; parameters in it are replaced.
    """
    waiting = list(card.rows)
    while waiting:
        first = waiting.pop(0)
        if first.blank:
            continue
        text = first.text.rstrip()
        while text.endswith(_CONTINUED) and waiting:
            text = text.removesuffix(_CONTINUED).rstrip() + waiting.pop(0).text.strip()
        yield (
            first.field(0)._replace(text=card.scope.text(text.strip().strip('"'))),
            waiting,
        )


def _read_transform(
    card: Card, rows: list[Row]
) -> tuple[Transform, tuple[Problem, ...]]:
    """Read the numbers of ``*INCLUDE_TRANSFORM``; a missing row, a blank field or a factor of 0 means no change."""
    id_columns = [
        *((0, ID_OFFSETS[f"ID{letter}OFF"]) for letter in "NPMS"),
        (1, OTHER_OFFSET["IDROFF"]),
    ]
    offsets = [
        card.integer(rows[row], column) if row < len(rows) else None
        for row, column in id_columns
    ]
    if len(rows) > 2:
        factors = {
            column.name: card.real(rows[2], column, 1.0) for column in UNIT_FACTORS
        }
    else:
        factors = {}
    factor = factors.get("FCTTIM")
    node, part, material, set_, other_id = (
        value.value if value else 0 for value in offsets
    )
    time = (factor.value if factor else 0.0) or 1.0
    problems = tuple(
        (value.field, value.problem)
        for value in (*offsets, factor)
        if value and value.problem
    )
    scaled = any(value.value not in (0.0, 1.0) for value in factors.values())
    transform_id = (
        card.integer(rows[3], TRANSFORMATION["TRANID"]) if len(rows) > 3 else None
    )
    # An unreadable transform may move nodes.
    moved = transform_id is not None and (
        bool(transform_id.problem) or transform_id.value != 0
    )
    return Transform(
        node, part, material, set_, other_id, time, scaled, moved
    ), problems


def _get_folder(file: str) -> Path:
    """Return the folder of a file."""
    from pathlib import Path  # Imported here to keep start-up fast.

    return Path(file).parent


def _make_portable(name: str) -> str:
    """Return a file name with forward slashes as separators."""
    return name.replace("\\", "/")


@dataclass(eq=False, repr=False)
class Deck:
    """A deck as read: the relevant ``cards``, the ``disabled`` cards (*COMMENT), encrypted blocks and includes.

    ``problems`` contains unreadable numbers on include cards. ``ends`` contains the last block of each file without
    *END, and True if the file is the main file. ``restarts`` contains the restarts that continue the run.
    """

    path: str
    cards: list[Card] = field(default_factory=list)
    disabled: list[Card] = field(default_factory=list)
    encrypted: list[Block] = field(default_factory=list)
    included: list[Card] = field(default_factory=list)
    unread: list[Unread] = field(default_factory=list)
    problems: list[Problem] = field(default_factory=list)
    scope: Scope = field(default_factory=Scope)
    sources: list[SourceFile] = field(default_factory=list)
    ends: list[tuple[Block, bool]] = field(default_factory=list)
    # True if the main file is in long format at its end.
    long: bool = False
    # Restarts of the run, keyed by file name.
    restarts: dict[str, Restart] = field(default_factory=dict)

    @property
    def files(self) -> list[str]:
        """Return the names of all files that were read, with the main deck first."""
        return [source.name for source in self.sources]

    def named(self, *names: str) -> list[Card]:
        """Return the cards whose keyword is one of ``names``, or one of them followed by ``_`` and an option."""
        by_name = [self._by_name[name] for name in names if name in self._by_name]
        if len(by_name) < 2:
            return [*by_name[0]] if by_name else []
        chosen = {*chain(*by_name)}
        return [card for card in self.cards if card in chosen]

    @cached_property
    def _by_name(self) -> Mapping[str, Sequence[Card]]:
        """Return the cards by name and by each prefix of the name before a ``_``; rules use both as keys."""
        cards_by_name: defaultdict[str, list[Card]] = defaultdict(list)
        for card in self.cards:
            for name in _list_stems(card.name):
                cards_by_name[name].append(card)
        return cards_by_name

    def silences(self, rule: str, file: str, line: int) -> bool:
        """Return True if a comment before the card at ``line`` of ``file`` silences ``rule``."""
        cards = self._by_line[file]
        count = bisect_right(cards, line, key=lambda card: card.line)
        silenced = cards[count - 1].block.silenced if count else ()
        return rule.startswith(
            tuple(name for name in silenced if name.startswith("D2R"))
        )

    @property
    def silencing(self) -> list[Card]:
        """Return the cards preceded by a comment that silences rules."""
        return [
            card
            for card in self._all
            if card.block.source.silences and card.block.silenced
        ]

    @property
    def _all(self) -> list[Card]:
        """Return all cards to which a finding may refer."""
        return [*self.cards, *self.disabled, *self.included]

    @cached_property
    def _by_line(self) -> defaultdict[str, list[Card]]:
        """Return the cards of each file in line order, keyed by file name."""
        cards_by_file: defaultdict[str, list[Card]] = defaultdict(list)
        for card in self._all:
            cards_by_file[card.file].append(card)
        for cards in cards_by_file.values():
            cards.sort(key=lambda card: card.line)
        return cards_by_file


@lru_cache(1024)  # Results are cached, because decks use the same keywords repeatedly.
def _list_stems(name: str) -> tuple[str, ...]:
    """Return a name and each of its prefixes that end before a ``_``."""
    return tuple(
        name[:at] for at in range(len(name), 0, -1) if name[at : at + 1] in ("", "_")
    )


def read_deck(path: str, content: bytes | SourceFile | None = None) -> Deck:
    """Return the cards of a deck and all its includes.

    Parameters
    ----------
    path : str
        The main deck; messages show file names relative to it as given here.
    content : bytes or SourceFile, optional
        Content of the main deck if it is not a file, or the file if it is already open; its includes are searched for
        in the folder of ``path``.

    Returns
    -------
    Deck
        Cards with their places; their data lines are read from the files on request.

    Raises
    ------
    DeckError
        If the deck itself cannot be read or is not a deck, or there are too many includes.
    """
    deck = Deck(path)
    main = content if isinstance(content, SourceFile) else SourceFile(path, content)
    if next(main.blocks(), None) is None:
        if main.marks:
            problem = "only *END was found, no keyword before it"
            expected = "*KEYWORD and the cards"
        else:
            problem = main.describe_lack_of_keywords()
            expected = "an LS-DYNA deck (lines that begin with *) or a file of a Radioss run (/BEGIN, /RUN)"
        raise DeckError(
            f"{path}: {problem}; {expected} {'were' if main.marks else 'was'} expected; give the main deck of the run"
        )
    _Reader(deck).read(main, _Context(deck.scope))
    return deck


class _Context(NamedTuple):
    """Data that an included file inherits from the file that includes it."""

    scope: Scope
    width: int = STANDARD
    transform: Transform = Transform()
    chain: tuple[str, ...] = ()


class _Reader:
    """Reads the files of a deck into a `Deck`."""

    def __init__(self, deck: Deck) -> None:
        self.deck = deck
        # Folders named by *INCLUDE_PATH, in the order of the cards.
        self.folders: list[Path] = []
        # Files by path, so that a file that is included twice is read only once.
        self.sources: dict[str, SourceFile] = {}

    def read(self, source: SourceFile, context: _Context) -> None:
        """Read a file and its includes."""
        self.deck.sources.append(source)
        if len(self.deck.sources) > _MOST_FILES:
            problem = f"{source.name}: more than {_MOST_FILES} includes were read"
            raise DeckError(f"{problem}; do the files include each other?")
        width = context.width
        for block in source.blocks():
            if block.end is None:
                self.deck.ends.append((block, not context.chain))
            if block.encrypted:
                self.deck.encrypted.append(block)
                continue
            name, suffix = _parse_keyword(block.head)
            if (
                name == "KEYWORD"
                and "=" in block.head
                and (match := re.search(_LONG, block.head, re.IGNORECASE))
            ):
                width = LONG if match[1].upper() == "Y" else STANDARD
                if not context.chain:
                    self.deck.long = width == LONG
            card_width = width
            if "+" in suffix:
                card_width = LONG
            elif "-" in suffix:
                card_width = STANDARD
            self.take(
                Card(
                    name,
                    block,
                    context.scope.as_of_now(),
                    card_width,
                    context.transform,
                ),
                context,
                width,
            )

    def take(self, card: Card, context: _Context, width: int) -> None:
        """Store a card or, if it is an instruction to the reader, act on it."""
        if card.name.startswith("COMMENT"):
            if re.search(
                r"\*(DEFORMABLE_TO_RIGID|RIGID_DEFORMABLE)",
                card.block.head,
                re.IGNORECASE,
            ):
                self.deck.disabled.append(card)
        elif card.name.startswith("PARAMETER"):
            context.scope.define(card.name, card.rows)
        elif card.name in _PATHS:
            self.folders += [
                _get_folder(self.deck.path) / _make_portable(name.text)
                for name, _ in _read_file_names(card)
            ]
        elif card.name.startswith("INCLUDE"):
            self.deck.included.append(card)
            self.include(card, context, width)
        elif card.name.startswith(_KEPT) or SWITCHING.match(card.block.head):
            self.deck.cards.append(card)

    def include(self, card: Card, context: _Context, width: int) -> None:
        """Read the files on an include card, or record why they are not read."""
        if card.name not in _READ_INCLUDES:
            self.deck.unread.append(Unread(card.here, UNKNOWN_KIND))
            return
        for name, transform, problems in _read_include_card(card):
            self.deck.problems += problems
            path = self.find(name)
            chain = (*context.chain, os.path.realpath(card.file))
            if reason := explain_unread(path, chain):
                self.deck.unread.append(Unread(name, reason))
            elif path is not None:
                if path not in self.sources:
                    self.sources[path] = SourceFile(path)
                self.read(
                    self.sources[path],
                    _Context(Scope(context.scope), width, transform, chain),
                )

    def find(self, name: CardField) -> str | None:
        """Return the path of an include file as it appears in messages; None if there is no such file.

        Programs that read decks disagree whether the folder of the main deck, *INCLUDE_PATH or the folder of the
        including file comes first. All are tried in this order, and the first file found is used.
        """
        for folder in (
            _get_folder(self.deck.path),
            *self.folders,
            _get_folder(name.file),
        ):
            # The last variant decodes the bytes as the file system does, rather than as Latin-1.
            for spelling in (
                name.text,
                _make_portable(name.text),
                os.fsdecode(name.text.encode("latin-1", "replace")),
            ):
                path = str(folder / spelling)
                if spelling and os.path.isfile(path):  # noqa: PTH113  Path.is_file fails on names that are too long
                    return path
        return None


def explain_unread(path: str | None, chain: Sequence[str]) -> str:
    """Return the reason why an include file is not read; empty if it is read.

    ``chain`` contains the real paths of the files that include it.
    """
    if path is None:
        return "no such file"
    if os.path.realpath(path) in chain:
        return "the file includes itself"
    if len(chain) > _DEEPEST:
        return f"includes are nested deeper than {_DEEPEST} files"
    return "" if os.access(path, os.R_OK) else "no permission to read it"


def _parse_keyword(head: str) -> tuple[str, str]:
    """Return the keyword in upper case without its format suffixes, and these suffixes.

    Examples
    --------
    >>> _parse_keyword("*Node%")
    ('NODE', '%')
    >>> _parse_keyword("*DEFORMABLE_TO_RIGID + hint text")
    ('DEFORMABLE_TO_RIGID', '+')
    >>> _parse_keyword("*ELEMENT_SOLID (ten nodes format)")
    ('ELEMENT_SOLID', '')
    """
    words = head.removeprefix("*").split(maxsplit=2) if head[1:2].strip() else []
    if not words:
        return "", ""
    name = words[0].rstrip(_SUFFIXES)
    suffix = words[0][len(name) :]
    if len(words) > 1 and not words[1].strip(_SUFFIXES):
        suffix += words[1]
    return name.upper(), suffix


def find_cuts(deck: Deck) -> Iterator[tuple[Block, str]]:
    """Yield the last block of each file that seems to be truncated, with the evidence.

    An include need not have *END. A main file without *END is reported if it ends within a mesh, because a program that
    writes a mesh also writes *END. In a last line without a line end, digits of a number may be missing.
    """
    files = set()
    for block, main in deck.ends:
        sign = _find_sign_of_cut(block, main=main)
        if sign and block.source.name not in files:
            files.add(block.source.name)
            yield block, f"{sign}, so it may be truncated."


def describe_cure(block: Block) -> str:
    """Return the remedy for a truncated file that ends with this block."""
    if not block.source.ends_with_line():
        return "use the complete file, or end its last line"
    end_mark = "/END" if block.head.startswith("/") else "*END"
    return f"use the complete file, or add {end_mark}"


def has_mesh(block: Block) -> bool:
    """Return True if a block contains nodes or elements."""
    return re.match(_MESH, block.head, re.IGNORECASE) is not None


def _has_whole_end(block: Block) -> bool:
    """Return True if an unterminated last line is complete: a comment, or a keyword without values."""
    *above, last = block.source.text(block.start, block.end).split("\n")
    if last.startswith(("$", "#") if block.head.startswith("/") else "$"):
        return True
    first = block.head[1:].split("/")[0].strip().upper()
    return (
        block.head.startswith("/")
        and not above
        and not any(name.startswith(first) for name in _WITH_VALUES)
    )


def _find_sign_of_cut(block: Block, *, main: bool) -> str:
    """Return the evidence that a file is truncated; empty if there is none."""
    mesh = has_mesh(block)
    radioss = block.head.startswith("/")
    if not block.source.ends_with_line() and not _has_whole_end(block):
        return f"the file ends within a line of {'its mesh' if mesh else block.head.strip()}"
    if main and mesh:
        return f"the {'starter' if radioss else 'main'} deck ends within its mesh, without {'/' if radioss else '*'}END"
    return ""
