"""Reads an LS-DYNA keyword deck with its includes: the cards that matter for switching, in reading order."""

from __future__ import annotations

import os
import re
from bisect import bisect_right
from collections import defaultdict
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final

from d2rpick.deck.card import Card, Transform
from d2rpick.deck.includes import UNKNOWN_KIND, Folders, Unread, asked_by
from d2rpick.deck.parameters import Scope
from d2rpick.deck.rows import LONG, STANDARD, Problem
from d2rpick.deck.source import Block, SourceFile
from d2rpick.errors import DeckError

_KEPT: Final = (
    *("DEFORMABLE_TO_RIGID", "RIGID_DEFORMABLE", "CONTROL_TERMINATION", "DATABASE_GLSTAT", "DATABASE_MATSUM"),
    *("PART", "SET_PART", "MAT_", "ELEMENT_", "SECTION_", "NODE", "CONTACT_", "RIGIDWALL_"),
    *("SET_NODE", "CONSTRAINED_", "DATABASE_HISTORY_NODE", "BOUNDARY_SPC", "BOUNDARY_PRESCRIBED_MOTION"),
    *("LOAD_BODY", "LOAD_GRAVITY", "DEFINE_CURVE"),
)
_READ_INCLUDES: Final = ("INCLUDE", "INCLUDE_TRANSFORM")
_PATHS: Final = ("INCLUDE_PATH", "INCLUDE_PATH_RELATIVE")
_LONG = re.compile(r"\bLONG\s*=\s*([YSK])", re.IGNORECASE)
SWITCHING: Final = re.compile(r"\*\s*(DEFORMABLE|RIGID.DEFORMABLE)", re.IGNORECASE)  # keywords meant to switch
_SUFFIXES: Final = "+-%"
_DEEPEST = 60  # includes in includes
_MOST_FILES = 10_000


@dataclass(eq=False)
class Deck:
    """A deck as read: ``cards`` that matter, ``disabled`` ones (*COMMENT), encrypted blocks, includes.

    ``problems`` are numbers of includes that could not be read; ``ends`` the last block of each file that has no *END,
    and whether that file is the main one.
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

    @property
    def files(self) -> list[str]:
        """Names of all files that were read, the deck itself first."""
        return [source.name for source in self.sources]

    def named(self, *names: str) -> list[Card]:
        """Cards whose keyword is one of ``names``, or one of them with an option behind ``_``."""
        prefixes = tuple(f"{name}_" for name in names)
        return [card for card in self.cards if card.name in names or card.name.startswith(prefixes)]

    def silences(self, rule: str, file: str, line: int) -> bool:
        """Whether a comment before the card that holds ``line`` of ``file`` silences ``rule``."""
        cards = self._by_line[file]
        before = bisect_right(cards, line, key=lambda card: card.line)
        named = cards[before - 1].block.silenced if before else ()
        return rule.startswith(tuple(name for name in named if name.startswith("D2R")))

    @property
    def silencing(self) -> list[Card]:
        """Cards before which a comment silences rules."""
        return [card for card in self._all if card.block.silenced]

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


def read_deck(path: str, content: bytes | None = None) -> Deck:
    """Find the cards of a deck and of all its includes.

    Parameters
    ----------
    path : str
        The main deck; messages show file names relative to it as it is given here.
    content : bytes, optional
        What the main deck holds, where it does not lie in a file; its includes are looked for beside ``path``.

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
    main = SourceFile(path, content)
    if next(main.blocks(), None) is None:
        if main.marks:
            found, wanted = "only *END was found, no keyword before it", "*KEYWORD and the cards"
        else:
            found = "no keyword was found"
            wanted = "an LS-DYNA deck (lines that begin with *) or a file of a Radioss run (/BEGIN, /RUN)"
        raise DeckError(f"{path}: {found}; {wanted} {'were' if main.marks else 'was'} expected")
    _Reader(deck).read(main, _Context(deck.scope))
    return deck


@dataclass(frozen=True)
class _Context:
    """What a file inherits from the one that includes it."""

    scope: Scope
    width: int = STANDARD
    transform: Transform = field(default_factory=Transform)
    chain: tuple[str, ...] = ()


class _Reader:
    def __init__(self, deck: Deck) -> None:
        self.deck = deck
        self.folders = Folders(deck.path)
        self.sources: dict[str, SourceFile] = {}  # by path: a file that is included twice is the same each time

    def read(self, source: SourceFile, context: _Context) -> None:
        self.deck.sources.append(source)
        if len(self.deck.sources) > _MOST_FILES:
            raise DeckError(
                f"{source.name}: more than {_MOST_FILES} includes were read; do the files include each other?"
            )
        width = context.width
        for block in source.blocks():
            if block.end is None:
                self.deck.ends.append((block, not context.chain))
            if block.encrypted:
                self.deck.encrypted.append(block)
                continue
            name, suffix = _keyword(block.head)
            if name == "KEYWORD" and (found := _LONG.search(block.head)):
                width = LONG if found[1].upper() == "Y" else STANDARD
                if not context.chain:
                    self.deck.long = width == LONG
            own = LONG if "+" in suffix else STANDARD if "-" in suffix else width
            self.take(Card(name, block, context.scope.as_of_now(), own, context.transform), context, width)

    def take(self, card: Card, context: _Context, width: int) -> None:
        """Keep a card, or do what it asks the reader to do."""
        if card.name.startswith("COMMENT"):
            if re.search(r"\*(DEFORMABLE_TO_RIGID|RIGID_DEFORMABLE)", card.block.head, re.IGNORECASE):
                self.deck.disabled.append(card)
        elif card.name.startswith("PARAMETER"):
            context.scope.define(card.name, card.rows)
        elif card.name in _PATHS:
            self.folders.add(card)
        elif card.name.startswith("INCLUDE"):
            self.deck.included.append(card)
            self.include(card, context, width)
        elif card.name.startswith(_KEPT) or SWITCHING.match(card.block.head):
            self.deck.cards.append(card)

    def include(self, card: Card, context: _Context, width: int) -> None:
        if card.name not in _READ_INCLUDES:
            self.deck.unread.append(Unread(card.here, UNKNOWN_KIND))
            return
        for asked in asked_by(card):
            self.deck.problems += asked.problems
            path = self.folders.find(asked.name)
            real = os.path.realpath(path) if path else ""
            if path is None:
                reason = "no such file"
            elif real in context.chain or real == os.path.realpath(card.file):
                reason = "the file includes itself"
            elif len(context.chain) >= _DEEPEST:
                reason = f"includes are nested deeper than {_DEEPEST} files"
            elif not os.access(path, os.R_OK):
                reason = "no permission to read it"
            else:
                chain = (*context.chain, os.path.realpath(card.file))
                if path not in self.sources:
                    self.sources[path] = SourceFile(path)
                self.read(self.sources[path], _Context(Scope(context.scope), width, asked.transform, chain))
                continue
            self.deck.unread.append(Unread(asked.name, reason))


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
