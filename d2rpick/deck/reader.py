"""Reads an LS-DYNA keyword deck with its includes: the cards that matter for switching, in reading order."""

from __future__ import annotations

import os
import re
from bisect import bisect_right
from collections import defaultdict
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import chain
from typing import TYPE_CHECKING, Final

from d2rpick.base.caching import cached_property
from d2rpick.base.errors import DeckError
from d2rpick.base.tuples import NamedTuple
from d2rpick.deck.card import (
    LONG,
    STANDARD,
    Card,
    Field,
    Problem,
    Row,
    Scope,
    Transform,
)
from d2rpick.deck.source import Block, SourceFile

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path


_CONTINUED = " +"
_FACTORS, _OF_TIME = 3, 1  # of mass, time and length
UNKNOWN_KIND = "this kind of include is not read"


class Unread(NamedTuple):
    """An include that was not read: its name as written, and why."""

    name: Field
    reason: str


class Restart(NamedTuple):
    """When a restart begins [time of the run], and where that is written."""

    at: float
    stop_field: Field


def _asked_by(card: Card) -> Iterator[tuple[Field, Transform, tuple[Problem, ...]]]:
    """Names of the files that an ``*INCLUDE`` card asks for, the transform of each, and what of that is unreadable.

    ``*INCLUDE`` has one name in a line, ``*INCLUDE_TRANSFORM`` one alone, and its numbers.
    """
    names = _names(card)
    if card.name == "INCLUDE":
        yield from ((name, card.transform, ()) for name, _ in names)
    elif first := next(names, None):
        name, rest = first
        own, problems = _transform(card, rest)
        yield name, own.inside(card.transform), problems


def _names(card: Card) -> Iterator[tuple[Field, list[Row]]]:
    """Every file name, joined over lines that end in blank-plus, its parameters resolved, and the rows below it."""
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


def _transform(card: Card, rows: list[Row]) -> tuple[Transform, tuple[Problem, ...]]:
    """Numbers of ``*INCLUDE_TRANSFORM``; a row left out, a blank and a factor 0 mean no change."""
    places = ((0, 0), (0, 2), (0, 3), (0, 4), (1, 0))
    offsets = [
        card.integer(rows[row], position) if row < len(rows) else None
        for row, position in places
    ]
    factors = (
        [card.real(rows[2], at, 1.0) for at in range(_FACTORS)] if len(rows) > 2 else []
    )
    factor = factors[_OF_TIME] if factors else None
    node, part, material, set_, rest = (
        value.value if value else 0 for value in offsets
    )
    time = (factor.value if factor else 0.0) or 1.0
    problems = tuple(
        (value.field, value.problem)
        for value in (*offsets, factor)
        if value and value.problem
    )
    scaled = any(one.value not in (0.0, 1.0) for one in factors)
    turn = card.integer(rows[3], 0) if len(rows) > 3 else None
    moved = turn is not None and (
        bool(turn.problem) or turn.value != 0
    )  # what cannot be read may move them
    return Transform(node, part, material, set_, rest, time, scaled, moved), problems


def _folder(file: str) -> Path:
    from pathlib import Path  # not above: a deck without includes does without it

    return Path(file).parent


def _portable(name: str) -> str:
    return name.replace("\\", "/")


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
_PATHS: Final = (
    "INCLUDE_PATH",
    "INCLUDE_PATH_RELATIVE",
)  # both relative to the folder of the main deck
_LONG: Final = r"\bLONG\s*=\s*([YSK])"  # compiled where it is needed
SWITCHING: Final = re.compile(
    r"\*\s*(DEFORMABLE|RIGID.DEFORMABLE)", re.IGNORECASE
)  # keywords meant to switch
_SUFFIXES: Final = "+-%"
_DEEPEST = 60  # includes in includes
_MOST_FILES = 10_000


@dataclass(eq=False, repr=False)
class Deck:
    """A deck as read: ``cards`` that matter, ``disabled`` ones (*COMMENT), encrypted blocks, includes.

    ``problems`` are numbers of includes that could not be read; ``ends`` the last block of each file that has no *END,
    and whether that file is the main one.  ``restarts`` are those that go on with its run.
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
    long: bool = False  # whether the main file ends in long format
    restarts: dict[str, Restart] = field(default_factory=dict)  # by file

    @property
    def files(self) -> list[str]:
        """Names of all files that were read, the deck itself first."""
        return [source.name for source in self.sources]

    def named(self, *names: str) -> list[Card]:
        """Cards of a deck that was read whose keyword is one of ``names``, or one with an option behind ``_``."""
        found = [self._by_name[name] for name in names if name in self._by_name]
        if len(found) < 2:
            return [*found[0]] if found else []
        chosen = {*chain(*found)}
        return [card for card in self.cards if card in chosen]

    @cached_property
    def _by_name(self) -> Mapping[str, Sequence[Card]]:
        """Cards by their names, and by what stands there before an ``_``: every rule asks for some."""
        found: defaultdict[str, list[Card]] = defaultdict(list)
        for card in self.cards:
            for name in _stems(card.name):
                found[name].append(card)
        return found

    def silences(self, rule: str, file: str, line: int) -> bool:
        """Whether a comment before the card that holds ``line`` of ``file`` silences ``rule``."""
        cards = self._by_line[file]
        before = bisect_right(cards, line, key=lambda card: card.line)
        named = cards[before - 1].block.silenced if before else ()
        return rule.startswith(tuple(name for name in named if name.startswith("D2R")))

    @property
    def silencing(self) -> list[Card]:
        """Cards before which a comment silences rules."""
        return [
            card
            for card in self._all
            if card.block.source.silences and card.block.silenced
        ]

    @property
    def _all(self) -> list[Card]:
        return [*self.cards, *self.disabled, *self.included]

    @cached_property
    def _by_line(self) -> defaultdict[str, list[Card]]:
        found: defaultdict[str, list[Card]] = defaultdict(list)
        for card in self._all:
            found[card.file].append(card)
        for cards in found.values():
            cards.sort(key=lambda card: card.line)
        return found


@lru_cache(1024)  # decks use the same keywords
def _stems(name: str) -> tuple[str, ...]:
    """Give a name, and what stands there before an ``_``."""
    return tuple(
        name[:at] for at in range(len(name), 0, -1) if name[at : at + 1] in ("", "_")
    )


def read_deck(path: str, content: bytes | SourceFile | None = None) -> Deck:
    """Find the cards of a deck and of all its includes.

    Parameters
    ----------
    path : str
        The main deck; messages show file names relative to it as it is given here.
    content : bytes or SourceFile, optional
        What the main deck holds, where it does not lie in a file, or the file where it is open already; its includes
        are looked for beside ``path``.

    Returns
    -------
    Deck
        Cards with their places; their data lines are read from the files when they are asked for.

    Raises
    ------
    DeckError
        If the deck itself cannot be read or is none, or includes multiply without end.
    """
    deck = Deck(path)
    main = content if isinstance(content, SourceFile) else SourceFile(path, content)
    if next(main.blocks(), None) is None:
        if main.marks:
            found, wanted = (
                "only *END was found, no keyword before it",
                "*KEYWORD and the cards",
            )
        else:
            found = "no keyword was found"
            wanted = "an LS-DYNA deck (lines that begin with *) or a file of a Radioss run (/BEGIN, /RUN)"
        raise DeckError(
            f"{path}: {found}; {wanted} {'were' if main.marks else 'was'} expected"
        )
    _Reader(deck).read(main, _Context(deck.scope))
    return deck


class _Context(NamedTuple):
    """What a file inherits from the one that includes it."""

    scope: Scope
    width: int = STANDARD
    transform: Transform = Transform()
    chain: tuple[str, ...] = ()


class _Reader:
    def __init__(self, deck: Deck) -> None:
        self.deck = deck
        self.folders: list[Path] = []  # those of *INCLUDE_PATH, in order
        self.sources: dict[
            str, SourceFile
        ] = {}  # by path: a file that is included twice is the same each time

    def read(self, source: SourceFile, context: _Context) -> None:
        self.deck.sources.append(source)
        if len(self.deck.sources) > _MOST_FILES:
            what = f"{source.name}: more than {_MOST_FILES} includes were read"
            raise DeckError(f"{what}; do the files include each other?")
        width = context.width
        for block in source.blocks():
            if block.end is None:
                self.deck.ends.append((block, not context.chain))
            if block.encrypted:
                self.deck.encrypted.append(block)
                continue
            name, suffix = _keyword(block.head)
            if (
                name == "KEYWORD"
                and "=" in block.head
                and (found := re.search(_LONG, block.head, re.IGNORECASE))
            ):
                width = LONG if found[1].upper() == "Y" else STANDARD
                if not context.chain:
                    self.deck.long = width == LONG
            own = LONG if "+" in suffix else STANDARD if "-" in suffix else width
            self.take(
                Card(name, block, context.scope.as_of_now(), own, context.transform),
                context,
                width,
            )

    def take(self, card: Card, context: _Context, width: int) -> None:
        """Keep a card, or do what it asks the reader to do."""
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
                _folder(self.deck.path) / _portable(name.text)
                for name, _ in _names(card)
            ]
        elif card.name.startswith("INCLUDE"):
            self.deck.included.append(card)
            self.include(card, context, width)
        elif card.name.startswith(_KEPT) or SWITCHING.match(card.block.head):
            self.deck.cards.append(card)

    def include(self, card: Card, context: _Context, width: int) -> None:
        if card.name not in _READ_INCLUDES:
            self.deck.unread.append(Unread(card.here, UNKNOWN_KIND))
            return
        for name, transform, problems in _asked_by(card):
            self.deck.problems += problems
            path = self.find(name)
            chain = (*context.chain, os.path.realpath(card.file))
            if reason := why_unread(path, chain):
                self.deck.unread.append(Unread(name, reason))
            elif path is not None:
                if path not in self.sources:
                    self.sources[path] = SourceFile(path)
                self.read(
                    self.sources[path],
                    _Context(Scope(context.scope), width, transform, chain),
                )

    def find(self, name: Field) -> str | None:
        """Path of an include as messages should show it, or None.

        Readers of decks differ in whether the folder of the main deck, *INCLUDE_PATH or the folder of the including
        file comes first; all are tried, the first that has the file counts.
        """
        for folder in (_folder(self.deck.path), *self.folders, _folder(name.file)):
            # the last has the bytes taken as the file system takes them, not as Latin-1
            for spelling in (
                name.text,
                _portable(name.text),
                os.fsdecode(name.text.encode("latin-1", "replace")),
            ):
                path = str(folder / spelling)
                if spelling and os.path.isfile(path):  # noqa: PTH113 - Path.is_file raises on names too long
                    return path
        return None


def why_unread(path: str | None, chain: Sequence[str]) -> str:
    """Say why an include is not read, empty where it is; ``chain`` are the files that include it, by real paths."""
    if path is None:
        return "no such file"
    if os.path.realpath(path) in chain:
        return "the file includes itself"
    if len(chain) > _DEEPEST:
        return f"includes are nested deeper than {_DEEPEST} files"
    return "" if os.access(path, os.R_OK) else "no permission to read it"


def _keyword(head: str) -> tuple[str, str]:
    """Name of a keyword in upper case, and its format suffixes.

    Examples
    --------
    >>> _keyword("*Node%")
    ('NODE', '%')
    >>> _keyword("*DEFORMABLE_TO_RIGID + hint text")
    ('DEFORMABLE_TO_RIGID', '+')
    >>> _keyword("*ELEMENT_SOLID (ten nodes format)")
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


_MESH: Final = (
    r"\*(ELEMENT_|NODE\b)|"
    r"/(NODE|SHELL|SH3N|BRICK|TETRA4|TETRA10|PENTA6|QUAD|TRIA|BEAM|TRUSS|SPRING|BRIC20|SHEL16|SPHCEL|XELEM)(/|\s*\Z)"
)


def cuts(deck: Deck) -> Iterator[tuple[Block, str]]:
    """Give the last block of each file that seems to be cut, and what speaks for it.

    An include may do without *END, and the main file too unless it ends within a mesh: a mesh is written by a program,
    which ends what it writes.  A last line without line end may lack digits of a number.
    """
    seen = set()
    for block, main in deck.ends:
        told = _sign_of_cut(block, main=main)
        if told and block.source.name not in seen:
            seen.add(block.source.name)
            yield block, f"{told}; is it cut?"


def cure(block: Block) -> str:
    """What to do about a file that ends with this block, of which `cuts` speaks."""
    return f"take the whole file, or {'add that line' if block.source.ends_with_line() else 'end its last line'}"


def holds_mesh(block: Block) -> bool:
    """Whether a block holds nodes or elements."""
    return re.match(_MESH, block.head, re.IGNORECASE) is not None


# Keywords of Radioss that values follow, in engine files: one of them without any is cut.
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


def _is_whole(block: Block) -> bool:
    """Whether nothing that matters can be missing from a last line without line end: a comment, or no values follow."""
    *above, last = block.source.text(block.start, block.end).split("\n")
    if last.startswith(("$", "#") if block.head.startswith("/") else "$"):
        return True
    first = block.head[1:].split("/")[0].strip().upper()
    return (
        block.head.startswith("/")
        and not above
        and not any(name.startswith(first) for name in _WITH_VALUES)
    )


def _sign_of_cut(block: Block, *, main: bool) -> str:
    mesh, radioss = holds_mesh(block), block.head.startswith("/")
    if not block.source.ends_with_line() and not _is_whole(block):
        return f"the file ends within a line of {'its mesh' if mesh else block.head.strip()}"
    if main and mesh:
        return f"the {'starter' if radioss else 'main'} deck ends within its mesh, without {'/' if radioss else '*'}END"
    return ""
