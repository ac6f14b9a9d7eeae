"""A deck with switching cards in it: a copy in another folder, ready to be run.

Or its engine files are written leg by leg, as the driver of a Radioss run decides.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.base.errors import DeckError, name_units
from d2rpick.base.files import write_whole
from d2rpick.deck.engine_files import EngineFile, engine_lines, listed, off
from d2rpick.deck.ls_dyna_parts import read_parts
from d2rpick.deck.radioss_bodies import replaced
from d2rpick.deck.radioss_deck import (
    Leg,
    Starter,
    below_title,
    blocks,
    card_of,
    kept_off,
    keyword,
    number_of,
    numbers,
    read_legs,
)
from d2rpick.deck.radioss_files import root_of, run_files
from d2rpick.deck.radioss_run import Run, parts_off, read_run
from d2rpick.deck.radioss_sensors import STOPS_SINCE
from d2rpick.deck.reader import Deck, cure, cuts, read_deck
from d2rpick.deck.source import Block, SourceFile
from d2rpick.deck.switching import find_windows, read_switching

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

    from d2rpick.deck.printed_card import PrintedCard

_ONCE = {
    "INIV",
    "END",
}  # engine keywords that a later leg must not repeat: velocities are set at its start again


def write_deck(
    main: str, card: PrintedCard, folder: str, *, overwrite: bool = False
) -> list[str]:
    """Write a deck with printed cards into a folder.

    LS-DYNA: the main file, byte for byte but for one ``*INCLUDE`` of the cards before ``*END``, the cards, and the
    files that the deck includes from its own folder and below.  Radioss: the starter deck and its includes, and the
    engine files of the legs, each with the further keywords of the run's only engine file.

    Parameters
    ----------
    main : str
        The main deck, or a file of the Radioss run without switching.
    card : PrintedCard
        What `d2rpick.deck.printing.cards` gave for its solver.
    folder : str
        Another folder than that of the deck; made where it does not exist.
    overwrite : bool
        Replace files that exist.

    Returns
    -------
    list of str
        The files written, the main deck first.

    Raises
    ------
    DeckError
        If the deck switches one of these parts already, uses the id of a switch set, includes what would not be found
        from ``folder``, or has a main file that seems to be cut; if a file exists; if the card is one for another
        solver.
    """
    files = dict(_radioss(main, card) if run_files(main) else _ls_dyna(main, card))
    place = Path(folder)
    try:
        place.mkdir(parents=True, exist_ok=True)
        if place.samefile(Path(main).parent):
            raise DeckError(
                f"{folder}: this is the folder of the deck; choose another one"
            )
        for name in files:
            if (place / name).exists() and not overwrite:
                raise DeckError(
                    f"{place / name}: the file exists; choose another folder or `overwrite`"
                )
            if not Path(os.path.realpath(place / name)).is_relative_to(
                os.path.realpath(place)
            ):
                raise DeckError(
                    f"{place / name}: leads out of {folder}, by a link or its name; choose another folder"
                )
        for name, content in files.items():
            (place / name).parent.mkdir(parents=True, exist_ok=True)
            write_whole(place / name, content)
    except OSError as error:
        raise DeckError(
            f"{error.filename or folder}: cannot be written ({error.strerror})"
        ) from None
    return [str(place / name) for name in files]


def _ls_dyna(main: str, card: PrintedCard) -> Iterator[tuple[str, bytes]]:
    deck, source = read_deck(main), SourceFile("the card", card.text.encode())
    if (
        len(card.files) != 1
        or not source.marks
        or not read_switching(printed := read_deck("the card", source))
    ):
        raise DeckError(
            f"{main}: an LS-DYNA deck, but the cards are for another solver"
        )
    for block, told in cuts(
        deck
    ):  # what is added would hide it, and end a number that is cut
        if block.source is deck.sources[0]:
            raise DeckError(
                f"{deck.path}: {told} The cards behind it would hide that: {cure(block)}"
            )
    _refuse_switched(deck, printed)
    ((name, text),) = card.files.items()
    if deck.long:
        text = text.replace(
            "_AUTOMATIC\n", "_AUTOMATIC-\n"
        )  # the minus keeps its fields 10 columns wide
    yield (
        Path(main).name,
        with_cards(deck.sources[0], f"*INCLUDE\n{name}\n", deck.sources[0].blocks()),
    )
    yield name, text.encode()
    yield from copies(deck.sources[1:], main, {name, Path(main).name})


def _refuse_switched(deck: Deck, printed: Deck) -> None:
    """Raise DeckError where the deck switches a part of the printed cards, or has one of their switch sets."""
    sets, mine = read_switching(deck), read_switching(printed)
    parts = {line.part.value for one in mine for line in one.switched}
    for event in find_windows(sets, read_parts(deck)).events:
        if event.unit.is_set or event.unit.id in parts:
            place = event.by.card
            what = f"{event.unit.kind} {event.unit.id}"
            raise DeckError(
                f"{place.at}: the deck switches {what} already; remove this card first"
            )
    ids = {one.header.swset.value for one in mine if one.header}
    for one in sets:
        if one.header and one.header.swset.value in ids:
            place = one.card
            found = f"{place.at}: switch set {one.header.swset.value} is one of the cards to be added"
            raise DeckError(f"{found}; print them with other ids")


def with_cards(main: SourceFile, text: str, found: Iterable[Block]) -> bytes:
    """Insert cards into the bytes of a main file, whose blocks were found: before its end mark, else at its end."""
    content = main.read(0)
    newline = b"\r\n" if b"\r\n" in content else b"\n"
    *_, last = found
    at = len(content) if last.end is None else content.rfind(b"\n", 0, last.end) + 1
    return content[:at] + text.encode().replace(b"\n", newline) + content[at:]


def copies(
    files: Sequence[SourceFile], main: str, taken: set[str]
) -> Iterator[tuple[str, bytes]]:
    """Files below the folder of the deck, by their relative names; others must be named by an absolute path."""
    base = os.path.abspath(Path(main).parent)  # noqa: PTH100 - resolve() would follow links to elsewhere
    for file, source in {source.name: source for source in files}.items():
        relative = os.path.relpath(os.path.abspath(file), base)  # noqa: PTH100
        if not relative.startswith(os.pardir):
            if relative in taken:
                raise DeckError(
                    f"{file}: the deck includes a file with the name of the cards, {relative!r}; rename it"
                )
            yield relative, source.read(0)
        elif os.path.normpath(file) != file or not Path(file).is_absolute():
            raise DeckError(
                f"{file}: included from outside the folder of the deck by a relative path; copy it there"
            )


def _radioss(main: str, card: PrintedCard) -> Iterator[tuple[str, bytes]]:
    run = read_run(main)
    printed = [
        leg
        for text in card.files.values()
        for leg in read_legs(SourceFile("the card", text.encode()))
    ]
    if not printed:
        raise DeckError(f"{main}: a Radioss run, but the cards are for another solver")
    if run.starter is None or not run.legs:
        found = "starter deck" if run.starter is None else "engine file"
        raise DeckError(
            f"{main}: the run has no {found}; its starter deck and an engine file were expected"
        )
    leg = run.legs[0]
    _refuse_unlike(run.legs)
    starter = run.starter.sources[0].name
    root = (
        root_of(starter) or leg.name
    )  # the engine looks for a restart that begins like its own file
    _refuse_other_run(leg, root, printed)
    _refuse_sensors(run.starter, card)
    left_out = {body.id: body.node.value for body in replaced(run, card.starter)}
    main_text = with_cards(
        run.starter.sources[0], card.starter, blocks(run.starter.sources[0])
    )
    main_name = f"{root}_0000.rad"
    yield main_name, _edited(starter, main_text, card.sensors, left_out)
    further = list(blocks(leg.run.block.source))
    names = [f"{root}_{mine.number:04d}.rad" for mine in printed]
    for name, text, mine in zip(names, card.files.values(), printed, strict=True):
        kept = (text_of(block) for block in further if repeated(keyword(block), mine))
        named = {
            node.value for _, _, ids in mine.switched for node in ids
        } | card.sensors.keys()
        named.update(left_out.values())
        others = [
            node for node in kept_off(run.legs) if node not in named
        ]  # else they would be rigid from time 0
        lines = (
            listed(others) if mine.cap is None else off(others)
        )  # its text ends with the bodies that it puts off
        yield (
            name,
            (text + "".join(f"{line}\n" for line in lines)).encode() + b"".join(kept),
        )
    for name, content in copies(run.starter.sources[1:], starter, {main_name, *names}):
        yield name, _edited(name, content, card.sensors, left_out)


def _edited(
    name: str, content: bytes, sensors: Mapping[int, int], left_out: Collection[int]
) -> bytes:
    """Give a file of the starter deck with sensors, and without rigid bodies that are ``left_out``, by their ids."""
    return _with_sensors(
        SourceFile(name, _without(SourceFile(name, content), left_out)), sensors
    )


def _without(source: SourceFile, bodies: Collection[int]) -> bytes:
    """Give a file of the starter deck without some rigid bodies, by their ids."""
    content = source.read(0)
    for block in reversed([*blocks(source)]):
        if (
            bodies
            and keyword(block)[:1] == ("RBODY",)
            and number_of(card_of(block)) in bodies
        ):
            content = content[: block.start] + content[block.end :]
    return content


def _with_sensors(source: SourceFile, sensors: Mapping[int, int]) -> bytes:
    """Let bodies be switched by sensors, in a file of the starter deck: ``sensors`` by main node.

    The version of its /BEGIN becomes one that knows when a sensor stops.  DeckError where a body has a sensor already.
    """
    content, edits = source.read(0), dict[int, tuple[int, bytes]]()
    for block in blocks(source) if sensors else ():
        if keyword(block)[:1] in {("BEGIN",), ("RBODY",)}:
            edits.update(_edit(block, sensors))
    for at in sorted(edits, reverse=True):
        end, text = edits[at]
        content = content[:at] + text + content[end:]
    return content


def _edit(
    block: Block, sensors: Mapping[int, int]
) -> Iterator[tuple[int, tuple[int, bytes]]]:
    """Give the bytes of the line that changes: where it begins, where it ends, and its text."""
    card = card_of(block)
    for row in below_title(card)[:1]:
        lines = block.source.read(block.start, block.end).split(b"\n")
        at = block.start + sum(len(line) + 1 for line in lines[: row.distance])
        text = lines[row.distance].rstrip(b"\r").decode("latin-1").ljust(20)
        first, second = (card.integer(row, place).value for place in (0, 1))
        if card.words[0] == "BEGIN":
            new = f"{max(first, STOPS_SINCE):10d}{text[10:]}"
        elif first in sensors:
            if second:
                raise DeckError(
                    f"{row.field(1).at}: sensor {second} switches this /RBODY already; remove it first"
                )
            new = f"{text[:10]}{sensors[first]:10d}{text[20:]}"
        else:
            return
        yield at, (at + len(lines[row.distance].rstrip(b"\r")), new.encode("latin-1"))


def _refuse_sensors(starter: Starter, card: PrintedCard) -> None:
    """Raise DeckError where sensors of a card have the ids of others, or there is no body for them."""
    added = Starter(blocks=[*blocks(SourceFile("the card", card.starter.encode()))])
    for number in sorted(added.sensors.keys() & starter.sensors.keys()):
        raise DeckError(
            f"{starter.sensors[number].at}: the deck has sensor {number} of the cards already; rename it"
        )
    mains = {body.node.value for body in (*starter.bodies, *added.bodies)}
    if unknown := sorted(card.sensors.keys() - mains):
        raise DeckError(
            f"{name_units(unknown, 'main node')}: no /RBODY of the deck has it; name main nodes of bodies"
        )


def _refuse_unlike(legs: Sequence[Leg]) -> None:
    """Raise DeckError if a further leg has keywords that the first one has not, so that no leg can stand for both."""
    first = {text_of(block) for block in blocks(legs[0].run.block.source)}
    for leg in legs[1:]:
        for block in blocks(leg.run.block.source):
            words = keyword(block)
            if (
                words[:1] != ("RUN",)
                and words[:1] != ("END",)
                and text_of(block) not in first
            ):
                found = f"{leg.run.block.source.name}: /{'/'.join(words)} is not in the first engine file"
                raise DeckError(
                    f"{found}; legs between switches repeat that one: write its keywords alike, or one leg"
                )


def _refuse_other_run(leg: Leg, root: str, printed: Sequence[Leg]) -> None:
    if printed[0].name not in (leg.name, root):
        raise DeckError(
            f"the cards are for run {printed[0].name!r}, the run is {leg.name!r}; print it with that name"
        )
    nodes = {
        node.value for one in printed for _, _, ids in one.switched for node in ids
    }
    for card, rigid, ids in leg.switched:
        if rigid and (known := nodes & {node.value for node in ids}):
            found = f"{card.at}: the run switches main node {min(known)} already"
            raise DeckError(f"{found}; remove it from this /RBODY/ON first")


def repeated(words: tuple[str, ...], leg: Leg | EngineFile) -> bool:
    """Whether a leg repeats a keyword of the run's engine file."""
    if (
        not words
        or words[0] == "RUN"
        or words[:2] in {("RBODY", "ON"), ("RBODY", "OFF")}
    ):
        return False
    if words[0] == "DTIX":
        return leg.cap is None
    return leg.number == 1 or words[0] not in _ONCE


def text_of(block: Block) -> bytes:
    """Give the lines of a block, each with its end."""
    content = block.source.read(block.start, block.end)
    return content if content.endswith(b"\n") else content + b"\n"


# Legs that are decided while the run is computed.

_NOT_REPEATED: Final = {"RFILE"}  # a leg writes the restart at its end alone
_IN_A_SECOND: Final = {"s": 1.0, "ms": 1e3, "mus": 1e6, "us": 1e6}


class DrivenDeck(NamedTuple):
    """A run to be driven: its name and end, whom it switches, what is copied, and the keywords of each leg.

    ``nodes`` are the main nodes of the rigid bodies of ``parts``, ``others`` those of bodies that stay off.
    ``interval`` is that of the time history, ``second`` the length of a second, None where no unit is named [time].
    """

    name: str
    end: float
    parts: tuple[int, ...]
    nodes: tuple[int, ...]
    others: tuple[int, ...]
    interval: float
    second: float | None
    files: Mapping[str, bytes]
    further: tuple[tuple[tuple[str, ...], bytes], ...]
    notes: tuple[str, ...]

    def leg(
        self, number: int, until: float, cap: float | None, *, frozen: bool = False
    ) -> bytes:
        """Write the engine file of a leg, rigid where a step ``cap`` is given.

        ``frozen``: the parts are rigid there already; OpenRadioss counts the energy of what is switched on twice once
        more.
        """
        file = EngineFile(number, until, cap)
        lines = engine_lines(file, self.name, () if frozen else self.nodes, self.others)
        kept = [text for words, text in self.further if repeated(words, file)]
        more = ["/MON/ON"] * (not any(words[0] == "MON" for words, _ in self.further))
        return "".join(f"{line}\n" for line in (*lines, *more)).encode() + b"".join(
            kept
        )


def driven_deck(path: str, parts: Collection[int]) -> DrivenDeck:
    """Read a run that is to be driven.

    Parameters
    ----------
    path : str
        Its starter deck or an engine file; of several engine files the first says what to write, the last when to end.
    parts : collection of int
        Parts to be switched; without any, those of the bodies that the engine file puts off.

    Raises
    ------
    DeckError
        If it is no Radioss run with a starter deck and an engine file that says how often the time history is
        written, or the parts cannot become rigid bodies.
    """
    from d2rpick.deck.radioss_bodies import bodies_for  # not above: loads numpy

    run = read_run(path)
    if run.starter is None or not run.legs:
        found = "starter deck" if run.starter is None else "engine file"
        raise DeckError(
            f"{path}: the run has no {found}; its starter deck and an engine file were expected"
        )
    leg = run.legs[0]
    chosen = tuple(sorted(parts)) or parts_off(run)
    if not chosen:
        raise DeckError(
            f"{path}: the engine file puts no rigid body off; name the parts to be switched with --part"
        )
    bodies = bodies_for(path, chosen)
    others = tuple(node for node in kept_off([leg]) if node not in bodies.nodes)
    source = run.starter.sources[0]
    main = f"{leg.name}_0000.rad"
    content = with_cards(source, bodies.cards, blocks(source))
    files = {
        main: content,
        **dict(copies(run.starter.sources[1:], source.name, {main})),
    }
    further = tuple(
        (words, text_of(block))
        for block in blocks(leg.run.block.source)
        if (words := keyword(block)) and words[0] not in _NOT_REPEATED
    )
    return DrivenDeck(
        leg.name, _end(run.legs[-1]), chosen, bodies.nodes, others, _interval(leg), _second(run), files, further,
        bodies.notes,
    )  # fmt: skip


def _end(leg: Leg) -> float:
    if leg.stop.problem or not leg.stop.value > 0:
        raise DeckError(
            f"{leg.run.at}: the end of the run is {leg.stop.value:g}, a time above 0 was expected"
        )
    return leg.stop.value


def _interval(leg: Leg) -> float:
    """Interval of the time history, which shows whether anything touches [time]."""
    for block in blocks(leg.run.block.source):
        card = card_of(block)
        if (
            card.words[0] == "TFILE"
            and (values := [*numbers(card)])
            and values[0].value > 0
        ):
            return values[0].value
    raise DeckError(
        f"{leg.run.at}: no /TFILE in the engine file; add one, some hundred states for a flight"
    )


def _second(run: Run) -> float | None:
    """Length of a second in the units in which the deck is computed [time]; None where it names none."""
    assert run.starter
    rows = next((card.rows for card in run.starter.named("BEGIN")), ())
    return (
        _IN_A_SECOND.get(rows[3].text[40:60].strip().lower()) if len(rows) > 3 else None
    )
