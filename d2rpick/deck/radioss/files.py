"""The files of one Radioss run: which belong together, and what they hold."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Final

from d2rpick.deck.includes import Unread
from d2rpick.deck.radioss.blocks import blocks, card_of, keyword
from d2rpick.deck.radioss.engine import Leg, read_legs
from d2rpick.deck.radioss.starter import KEPT, Starter
from d2rpick.deck.reader import Deck
from d2rpick.deck.source import SourceFile
from d2rpick.errors import DeckError

if TYPE_CHECKING:
    from d2rpick.deck.card import Card

_HEAD = 256 * 1024
_KEYWORD: Final = re.compile(rb"^[*/]", re.MULTILINE)
_STARTER: Final = re.compile(rb"^/BEGIN", re.MULTILINE | re.IGNORECASE)
_ENGINE: Final = re.compile(rb"^/RUN/", re.MULTILINE | re.IGNORECASE)
_NUMBERED: Final = re.compile(r"(.+)_(\d{4})\.rad", re.IGNORECASE | re.DOTALL)
_NAME: Final = re.compile(rb"^/BEGIN[^\n]*\n(?:[#$][^\n]*\n)*([^\n]*)|^/RUN/([^/\n]+)", re.MULTILINE | re.IGNORECASE)
_DEEPEST = 60  # includes in includes


@dataclass(eq=False)
class Run:
    """The starter deck, where it was found, and the legs in the order of their numbers; ``deck`` has the files."""

    deck: Deck
    starter: Starter | None = None
    legs: list[Leg] = field(default_factory=list)
    included: dict[str, SourceFile] = field(default_factory=dict)  # by path: one that is included twice is read once


def recognises(head: bytes) -> bool:
    """Whether a file that begins like this is a starter deck or an engine file."""
    first = _KEYWORD.search(head)
    return first is not None and first[0] == b"/" and bool(_STARTER.search(head) or _ENGINE.search(head))


def run_files(path: str) -> list[str]:
    """Files of the run that ``path`` belongs to; none where it is not a file of a Radioss run.

    The starter deck ``NAME_0000.rad`` and the engine files ``NAME_0001.rad`` and so on in its folder belong
    together; a file of another name goes by the name of the run that it holds.
    """
    try:
        if not os.path.isfile(path):  # noqa: PTH113  start-up
            return []  # a pipe gives its bytes once
        with open(path, "rb", buffering=0) as stream:  # noqa: PTH123
            head = stream.read(_HEAD)
        if not recognises(head):
            return []
        folder = Path(path).parent
        beside = sorted(os.listdir(folder))  # noqa: PTH208  nothing is asked of each file: there may be many runs
    except (OSError, ValueError):
        return []  # said by who reads it
    name = _run_name(path, head)
    alike = (one for one in beside if one.startswith(name) and (match := _NUMBERED.fullmatch(one)) and match[1] == name)
    files = [str(folder / one) for one in alike if (folder / one).is_file()]
    return files if any(Path(path).samefile(one) for one in files) else [path, *files]


def _run_name(path: str, head: bytes) -> str:
    """Name of a run by that of its file, else by what stands in it."""
    numbered = _NUMBERED.fullmatch(Path(path).name)
    if numbered:
        return numbered[1]
    found = _NAME.search(head)
    return (found[1] or found[2] or b"").decode("latin-1").strip() if found else ""


def read_run(path: str, content: bytes | None = None) -> Run:
    """Read a run: of its files, or from ``content``.

    Raises
    ------
    DeckError
        If a file cannot be read, or holds neither a starter deck nor an engine file.
    """
    run = Run(Deck(path))
    files = run_files(path) if content is None else []
    for name in files or [path]:
        source = SourceFile(name, content)
        head = source.read(0, _HEAD)
        if not recognises(head):
            raise DeckError(f"{name}: no /BEGIN or /RUN was found, a file of a Radioss run was expected")
        run.deck.sources.append(source)
        if _ENGINE.search(head):
            run.legs += read_legs(source)
        if _STARTER.search(head):
            run.starter = run.starter or Starter()
            _read_starter(source, run, ())
        else:
            run.deck.ends += [(block, False) for block in blocks(source) if block.end is None]
    run.legs.sort(key=lambda leg: leg.number)
    run.deck.cards += [leg.run for leg in run.legs]
    run.deck.cards += [card for leg in run.legs for card, _, _ in leg.switched]
    return run


def _read_starter(source: SourceFile, run: Run, chain: tuple[str, ...]) -> None:
    if run.starter is None:
        return
    run.starter.sources.append(source)
    for block in blocks(source):
        words = keyword(block)
        if block.end is None:
            run.deck.ends.append((block, not chain))
        if not words:
            _include(card_of(block), source, run, chain)
        elif words[0] in KEPT:
            card = card_of(block)
            run.starter.take(card, words)
            if words[0] == "RBODY":
                run.deck.cards.append(card)


def _include(card: Card, source: SourceFile, run: Run, chain: tuple[str, ...]) -> None:
    asked = card.block.head.split(maxsplit=1)[1:]
    name = asked[0].strip() if asked else ""
    path = next(
        (
            str(folder / name)
            for folder in (Path(source.name).parent, Path(run.deck.path).parent)
            if os.path.isfile(folder / name)  # noqa: PTH113 - Path.is_file raises on names too long
        ),
        None,
    )
    real = os.path.realpath(path) if path else ""
    if path is None:
        run.deck.unread.append(Unread(card.here._replace(text=name), "no such file"))
    elif real in chain or real == os.path.realpath(source.name) or len(chain) >= _DEEPEST:
        run.deck.unread.append(Unread(card.here._replace(text=name), "the file includes itself"))
    elif not os.access(path, os.R_OK):
        run.deck.unread.append(Unread(card.here._replace(text=name), "no permission to read it"))
    else:
        if path not in run.included:
            run.included[path] = SourceFile(path)
        run.deck.sources.append(run.included[path])
        _read_starter(run.included[path], run, (*chain, os.path.realpath(source.name)))
