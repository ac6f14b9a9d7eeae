"""Write a ready-to-run deck with switching cards into another folder.

For a driven Radioss run, engine files are written one engine run at a time.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.base.errors import DeckError, name_units
from d2rpick.base.files import write_as_a_whole
from d2rpick.deck.engine_files import (
    EngineFile,
    write_bodies_off,
    write_engine_lines,
    write_numbers,
)
from d2rpick.deck.ls_dyna_parts import read_parts
from d2rpick.deck.radioss_bodies import find_replaced_bodies
from d2rpick.deck.radioss_columns import BEGIN, RIGID_BODY
from d2rpick.deck.radioss_deck import (
    RadiossLeg,
    Starter,
    find_bodies_kept_off,
    get_lines_below_title,
    get_number,
    make_card,
    read_blocks,
    read_legs,
    read_numbers,
    split_keyword,
)
from d2rpick.deck.radioss_files import find_root, list_run_files
from d2rpick.deck.radioss_run import (
    RadiossRun,
    find_parts_off,
    find_time_units,
    read_run,
)
from d2rpick.deck.radioss_sensors import STOPS_SINCE
from d2rpick.deck.reader import Deck, describe_cure, find_cuts, read_deck
from d2rpick.deck.source import Block, SourceFile
from d2rpick.deck.switching import find_windows, read_switching

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

    from d2rpick.deck.printed_card import PrintedCard

# Engine keywords that a later engine run must not repeat, because e.g. /INIV would set the velocities again.
_ONCE = {
    "INIV",
    "END",
}

# Engine keywords that are not repeated, because an engine run writes its restart file only when it ends.
_NOT_REPEATED: Final = {"RFILE"}
_IN_A_SECOND: Final = {"s": 1.0, "ms": 1e3, "us": 1e6}


def write_deck(
    main: str, card: PrintedCard, folder: str, *, overwrite: bool = False
) -> list[str]:
    """Write a deck with printed cards into a folder.

    For LS-DYNA, the files are the main file, which is unchanged except for one ``*INCLUDE`` of the cards before
    ``*END``, the cards, and the files that the deck includes from its own folder and subfolders. For Radioss, they are
    the starter deck and its includes, and a file for each engine run, with the other keywords of the original engine
    file.

    Parameters
    ----------
    main : str
        The main deck, or a file of the Radioss reference run.
    card : PrintedCard
        Result of `d2rpick.deck.printing.print_cards` for its solver.
    folder : str
        A folder other than that of the deck; it is created if necessary.
    overwrite : bool
        Replace existing files.

    Returns
    -------
    list of str
        Paths of the written files, beginning with the main deck.

    Raises
    ------
    DeckError
        If the deck already switches one of these parts, uses the id of a switch set, includes a file that would not be
        found from ``folder``, or has a main file that seems to be truncated; if a file already exists; or if the card
        is for a different solver.
    """
    files = dict(
        _write_radioss(main, card)
        if list_run_files(main)
        else _write_ls_dyna(main, card)
    )
    target = Path(folder)
    try:
        target.mkdir(parents=True, exist_ok=True)
        if target.samefile(Path(main).parent):
            raise DeckError(
                f"{folder}: this is the folder of the deck; choose another folder"
            )
        for name in files:
            if (target / name).exists() and not overwrite:
                raise DeckError(
                    f"{target / name}: the file exists; choose another folder or `overwrite`"
                )
            if not Path(os.path.realpath(target / name)).is_relative_to(
                os.path.realpath(target)
            ):
                raise DeckError(
                    f"{target / name}: lies outside {folder}, because of a link or its name; choose another folder"
                )
        for name, content in files.items():
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            write_as_a_whole(target / name, content)
    except OSError as error:
        if os.path.isfile(folder):  # noqa: PTH113  pathlib would slow down start-up
            reason = "this is a file, but a folder was expected"
        else:
            reason = f"cannot be written ({error.strerror})"
        raise DeckError(
            f"{error.filename or folder}: {reason}; choose another folder"
        ) from None
    return [str(target / name) for name in files]


def write_trial_deck(main: str, card: PrintedCard, folder: str) -> str:
    """Write a deck with printed cards below an empty folder, in order to check it; return the path of its main deck.

    Unlike `write_deck`, this also copies the files that the deck includes by relative paths from outside its folder.
    The folders of all copies are related as those of the originals, so the solver would find them.

    Raises
    ------
    DeckError
        As for `write_deck`, except for these files.
    """
    writing = _write_radioss if list_run_files(main) else _write_ls_dyna
    files = dict(writing(main, card, is_trial=True))
    home = os.path.abspath(Path(main).parent)  # noqa: PTH100  resolve() would follow links out of the folder
    places = [os.path.normpath(f"{home}/{name}") for name in files]
    root = os.path.commonpath([home, *map(os.path.dirname, places)])
    targets = [Path(folder, os.path.relpath(place, root)) for place in places]
    for target, content in zip(targets, files.values(), strict=True):
        target.parent.mkdir(parents=True, exist_ok=True)
        write_as_a_whole(target, content)
    return str(targets[0])


def _write_ls_dyna(
    main: str, card: PrintedCard, *, is_trial: bool = False
) -> Iterator[tuple[str, bytes]]:
    """Yield name and content of each file of an LS-DYNA deck that contains the cards; see `copy_files` for a trial."""
    deck = read_deck(main)
    source = SourceFile("the card", card.text.encode())
    if (
        len(card.files) != 1
        or not source.marks
        or not read_switching(printed := read_deck("the card", source))
    ):
        raise DeckError(
            f"{main}: an LS-DYNA deck, but the cards are for another solver"
        )
    # The added lines would hide the truncation of the file, and could complete a truncated number.
    for block, sign in find_cuts(deck):
        if block.source is deck.sources[0]:
            raise DeckError(
                f"{deck.path}: {sign} The added cards would hide this: {describe_cure(block)}"
            )
    _refuse_switched(deck, printed)
    ((name, text),) = card.files.items()
    if deck.long:
        text = _keep_standard_format(text)
    yield (
        Path(main).name,
        insert_cards(deck.sources[0], f"*INCLUDE\n{name}\n", deck.sources[0].blocks()),
    )
    yield name, text.encode()
    taken = {name, Path(main).name}
    yield from copy_files(deck.sources[1:], main, taken, is_trial=is_trial)


def _keep_standard_format(cards: str) -> str:
    """Give each keyword the suffix ``-``: its fields are then 10 characters wide, also in a deck in long format."""
    return "".join(
        f"{line.rstrip()}-\n" if line.startswith("*") else line
        for line in cards.splitlines(keepends=True)
    )


def _refuse_switched(deck: Deck, printed: Deck) -> None:
    """Raise DeckError if the deck already switches a part on the printed cards, or uses one of their set ids."""
    sets = read_switching(deck)
    printed_sets = read_switching(printed)
    parts = {
        line.part.value for switch_set in printed_sets for line in switch_set.switched
    }
    for event in find_windows(sets, read_parts(deck)).events:
        if event.unit.is_set or event.unit.id in parts:
            card = event.by.card
            switched_unit = f"{event.unit.kind} {event.unit.id}"
            raise DeckError(
                f"{card.at}: the deck switches {switched_unit} already; remove this card first"
            )
    ids = {
        switch_set.header.swset.value
        for switch_set in printed_sets
        if switch_set.header
    }
    for switch_set in sets:
        if switch_set.header and switch_set.header.swset.value in ids:
            card = switch_set.card
            problem = f"{card.at}: the deck has switch set {switch_set.header.swset.value} of the added cards already"
            raise DeckError(f"{problem}; print them with other ids")


def insert_cards(main: SourceFile, text: str, file_blocks: Iterable[Block]) -> bytes:
    """Insert cards into the bytes of a main file, before ``*END`` or at the end; ``file_blocks`` are its blocks."""
    content = main.read(0)
    newline = b"\r\n" if b"\r\n" in content else b"\n"
    *_, last = file_blocks
    at = len(content) if last.end is None else content.rfind(b"\n", 0, last.end) + 1
    return content[:at] + text.encode().replace(b"\n", newline) + content[at:]


def copy_files(
    files: Sequence[SourceFile], main: str, taken: set[str], *, is_trial: bool = False
) -> Iterator[tuple[str, bytes]]:
    """Yield the name and content of the files in and below the deck folder; other files need an absolute path.

    In a trial (``is_trial``), files outside of the folder that have a relative path are copied too.
    """
    base = os.path.abspath(Path(main).parent)  # noqa: PTH100  resolve() would follow links out of the folder
    for file, source in {source.name: source for source in files}.items():
        relative = os.path.relpath(os.path.abspath(file), base)  # noqa: PTH100  resolve() would follow links out of the folder
        is_absolute = os.path.normpath(file) == file and Path(file).is_absolute()
        is_inside = not relative.startswith(os.pardir)
        if is_inside or (is_trial and not is_absolute):
            if relative in taken:
                raise DeckError(
                    f"{file}: the deck includes a file with the name of the card file, {relative!r}; rename it"
                )
            yield relative, source.read(0)
        elif not is_absolute:
            raise DeckError(
                f"{file}: the deck includes it by a relative path from outside its folder; write an absolute path, or "
                "copy it into the folder"
            )


def _write_radioss(
    main: str, card: PrintedCard, *, is_trial: bool = False
) -> Iterator[tuple[str, bytes]]:
    """Yield the name and content of each file of a Radioss run with cards; see `copy_files` for a trial."""
    run = read_run(main)
    printed = _read_printed_legs(main, card)
    starter_deck = _require_starter(main, run)
    leg = run.legs[0]
    _refuse_unlike(run.legs)
    main_source = starter_deck.sources[0]
    starter = main_source.name
    # The engine looks for a restart file whose name begins with the run name in the engine file.
    root = find_root(starter) or leg.name
    _refuse_other_run(leg, root, printed)
    _refuse_sensors(starter_deck, card)
    left_out = {
        body.id: body.node.value for body in find_replaced_bodies(run, card.starter)
    }
    main_text = insert_cards(main_source, card.starter, read_blocks(main_source))
    main_name = f"{root}_0000.rad"
    yield main_name, _edit_file(starter, main_text, card.sensors, left_out)
    names = {main_name}
    replaced_nodes = {*left_out.values(), *card.sensors}
    for text, printed_leg in zip(card.files.values(), printed, strict=True):
        name = f"{root}_{printed_leg.number:04d}.rad"
        names.add(name)
        lines = _keep_bodies_off(run.legs, printed_leg, replaced_nodes)
        engine_text = text + "".join(f"{line}\n" for line in lines)
        repeated_blocks = _read_repeated_blocks(leg, printed_leg)
        yield name, engine_text.encode() + repeated_blocks
    includes = starter_deck.sources[1:]
    for name, content in copy_files(includes, starter, names, is_trial=is_trial):
        yield name, _edit_file(name, content, card.sensors, left_out)


def _require_starter(main: str, run: RadiossRun) -> Starter:
    """Return the starter deck of a run; raise DeckError if the run has no starter deck or no engine file."""
    if run.starter is None or not run.legs:
        if run.starter is None:
            missing, name = "starter deck", "NAME_0000.rad"
        else:
            missing, name = "engine file", "NAME_0001.rad"
        raise DeckError(
            f"{main}: the run has no {missing}, expected a starter deck and an engine file; put the {missing} of the "
            f"run, {name}, into the folder of the other file"
        )
    return run.starter


def _read_printed_legs(main: str, card: PrintedCard) -> list[RadiossLeg]:
    """Read the engine runs in the printed cards; raise DeckError for cards of another solver."""
    printed = [
        leg
        for text in card.files.values()
        for leg in read_legs(SourceFile("the card", text.encode()))
    ]
    if not printed:
        raise DeckError(f"{main}: a Radioss run, but the cards are for another solver")
    return printed


def _keep_bodies_off(
    legs: Sequence[RadiossLeg], printed_leg: RadiossLeg, replaced_nodes: Collection[int]
) -> Iterator[str]:
    """Return lines that keep bodies inactive in a printed engine run; otherwise, they would be rigid from time 0 on.

    Bodies that the engine run switches, and bodies whose main nodes are in ``replaced_nodes``, are omitted.
    """
    switched_nodes = {node.value for _, _, ids in printed_leg.switched for node in ids}
    switched_nodes.update(replaced_nodes)
    off_nodes = [
        node for node in find_bodies_kept_off(legs) if node not in switched_nodes
    ]
    if printed_leg.cap is None:
        # An engine run without a time-step limit ends with an /RBODY/OFF card, to which these lines are appended.
        return write_numbers(off_nodes)
    return write_bodies_off(off_nodes)


def _read_repeated_blocks(leg: RadiossLeg, printed_leg: RadiossLeg) -> bytes:
    """Return the blocks of an engine file that must be repeated in the printed engine file ``printed_leg``."""
    return b"".join(
        read_block(block)
        for block in read_blocks(leg.run.block.source)
        if is_repeated(split_keyword(block), printed_leg)
    )


def _edit_file(
    name: str, content: bytes, sensors: Mapping[int, int], left_out: Collection[int]
) -> bytes:
    """Add sensors to a file of the starter deck, and remove the rigid bodies with the ids ``left_out``."""
    return _add_sensors(
        SourceFile(name, _remove_bodies(SourceFile(name, content), left_out)), sensors
    )


def _remove_bodies(source: SourceFile, bodies: Collection[int]) -> bytes:
    """Remove the rigid bodies with these ids from a file of the starter deck."""
    content = source.read(0)
    for block in reversed([*read_blocks(source)]):
        if (
            bodies
            and split_keyword(block)[:1] == ("RBODY",)
            and get_number(make_card(block)) in bodies
        ):
            content = content[: block.start] + content[block.end :]
    return content


def _add_sensors(source: SourceFile, sensors: Mapping[int, int]) -> bytes:
    """Return a file of the starter deck with bodies switched by ``sensors``, which are keyed by main node.

    The version in /BEGIN of the file is raised to one in which time sensors can end.

    Raises
    ------
    DeckError
        If a body already has a sensor.
    """
    content = source.read(0)
    edits = dict[int, tuple[int, bytes]]()
    for block in read_blocks(source) if sensors else ():
        if split_keyword(block)[:1] in {("BEGIN",), ("RBODY",)}:
            edits.update(_edit_lines(block, sensors))
    for at in sorted(edits, reverse=True):
        end, text = edits[at]
        content = content[:at] + text + content[end:]
    return content


def _edit_lines(
    block: Block, sensors: Mapping[int, int]
) -> Iterator[tuple[int, tuple[int, bytes]]]:
    """Yield each changed line as the offsets of its start and end, and its new bytes."""
    card = make_card(block)
    for row in get_lines_below_title(card)[:1]:
        lines = block.source.read(block.start, block.end).split(b"\n")
        at = block.start + sum(len(line) + 1 for line in lines[: row.distance])
        text = lines[row.distance].rstrip(b"\r").decode("latin-1")
        node, sensor = (
            card.integer(row, RIGID_BODY[name]).value for name in ("node_ID", "sens_ID")
        )
        if card.words[0] == "BEGIN":
            version = card.integer(row, BEGIN["Invers"]).value
            new = BEGIN["Invers"].put(text, max(version, STOPS_SINCE))
        elif node in sensors:
            if sensor:
                problem = f"sensor {sensor} switches this /RBODY already"
                raise DeckError(
                    f"{row.field(0).at}: {problem}; remove the sensor first"
                )
            new = RIGID_BODY["sens_ID"].put(text, sensors[node])
        else:
            return
        yield at, (at + len(lines[row.distance].rstrip(b"\r")), new.encode("latin-1"))


def _refuse_sensors(starter: Starter, card: PrintedCard) -> None:
    """Raise DeckError if the deck has a sensor with an id on the card, or lacks a body for a sensor."""
    added = Starter(
        blocks=[*read_blocks(SourceFile("the card", card.starter.encode()))]
    )
    for number in sorted(added.sensors.keys() & starter.sensors.keys()):
        raise DeckError(
            f"{starter.sensors[number].at}: the deck has sensor {number} of the cards already; rename it"
        )
    mains = {body.node.value for body in (*starter.bodies, *added.bodies)}
    if unknown := sorted(card.sensors.keys() - mains):
        raise DeckError(
            f"{name_units(unknown, 'main node')}: no /RBODY of the deck has it; give main nodes of rigid bodies"
        )


def _refuse_unlike(legs: Sequence[RadiossLeg]) -> None:
    """Raise DeckError if a later engine run has keywords that the first one lacks: no single run covers both."""
    first = {read_block(block) for block in read_blocks(legs[0].run.block.source)}
    for leg in legs[1:]:
        for block in read_blocks(leg.run.block.source):
            words = split_keyword(block)
            if (
                words[:1] != ("RUN",)
                and words[:1] != ("END",)
                and read_block(block) not in first
            ):
                problem = f"{leg.run.block.source.name}: /{'/'.join(words)} is not in the first engine file"
                raise DeckError(
                    f"{problem}, which every written engine file repeats; give all engine files the same keywords"
                )


def _refuse_other_run(
    leg: RadiossLeg, root: str, printed: Sequence[RadiossLeg]
) -> None:
    """Raise DeckError if the cards belong to another run, or if the run already switches their bodies."""
    if printed[0].name not in (leg.name, root):
        raise DeckError(
            f"the cards are for run {printed[0].name!r}, but this is run {leg.name!r}; print them with this name"
        )
    nodes: set[int] = set()
    for printed_leg in printed:
        for _, _, ids in printed_leg.switched:
            nodes.update(node.value for node in ids)
    for card, rigid, ids in leg.switched:
        if rigid and (common_nodes := nodes & {node.value for node in ids}):
            problem = (
                f"{card.at}: the run switches main node {min(common_nodes)} already"
            )
            raise DeckError(f"{problem}; remove it from this /RBODY/ON first")


def is_repeated(words: tuple[str, ...], leg: RadiossLeg | EngineFile) -> bool:
    """Return True if a printed engine run repeats a keyword from the engine file of the run."""
    if (
        not words
        or words[0] == "RUN"
        or words[:2] in {("RBODY", "ON"), ("RBODY", "OFF")}
    ):
        return False
    if words[0] == "DTIX":
        return leg.cap is None
    return leg.number == 1 or words[0] not in _ONCE


def read_block(block: Block) -> bytes:
    """Return the lines of a block, each with a line ending."""
    content = block.source.read(block.start, block.end)
    return content if content.endswith(b"\n") else content + b"\n"


# The functions below write the engine runs of a driven run, whose times are chosen while it is being computed.


class DrivenDeck(NamedTuple):
    """A run to be driven: its name, its end, its switched parts, copied files, and the keywords of each engine run.

    ``nodes`` contains the main nodes of the rigid bodies of ``parts``, and ``others`` those of bodies that stay
    inactive. ``interval`` is the output interval of the time history [time]. ``second`` is the length of a second in
    the time unit of the run [time]; None if the deck names no unit.
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
        """Write one engine file of the run; the bodies are rigid if a time-step limit ``cap`` is given.

        ``frozen`` is True if the bodies are already rigid and must not be activated again, because OpenRadioss would
        add their energy twice.
        """
        file = EngineFile(number, until, cap)
        lines = write_engine_lines(
            file, self.name, () if frozen else self.nodes, self.others
        )
        repeated_texts = [
            text for words, text in self.further if is_repeated(words, file)
        ]
        added_lines = ["/MON/ON"] * (
            not any(words[0] == "MON" for words, _ in self.further)
        )
        return "".join(
            f"{line}\n" for line in (*lines, *added_lines)
        ).encode() + b"".join(repeated_texts)


def read_driven_deck(path: str, parts: Collection[int]) -> DrivenDeck:
    """Read a run whose switching times are to be chosen while it is being computed.

    Parameters
    ----------
    path : str
        The starter deck or an engine file of the run; of several engine files, the first defines the output and the
        last the end.
    parts : collection of int
        Parts to be switched; the default is the parts of the rigid bodies that the first engine file deactivates.

    Raises
    ------
    DeckError
        If the files are not a Radioss run with a starter deck and an engine file that defines the interval of the time
        history, or if the parts cannot become rigid bodies.
    """
    # Imported here to keep start-up fast.
    from d2rpick.deck.radioss_bodies import find_bodies

    run = read_run(path)
    starter = _require_starter(path, run)
    leg = run.legs[0]
    chosen = tuple(sorted(parts)) or find_parts_off(run)
    if not chosen:
        raise DeckError(
            f"{path}: the engine file deactivates no rigid body; give the parts to switch with --part"
        )
    bodies = find_bodies(path, chosen)
    off_nodes = tuple(
        node for node in find_bodies_kept_off([leg]) if node not in bodies.nodes
    )
    source = starter.sources[0]
    main = f"{leg.name}_0000.rad"
    content = insert_cards(source, bodies.cards, read_blocks(source))
    files = {
        main: content,
        **dict(copy_files(starter.sources[1:], source.name, {main})),
    }
    further = tuple(
        (words, read_block(block))
        for block in read_blocks(leg.run.block.source)
        if (words := split_keyword(block)) and words[0] not in _NOT_REPEATED
    )
    return DrivenDeck(
        leg.name,
        _read_end(run.legs[-1]),
        chosen,
        bodies.nodes,
        off_nodes,
        _read_interval(leg),
        _find_second(run),
        files,
        further,
        bodies.notes,
    )


def _read_end(leg: RadiossLeg) -> float:
    """Return the end of the run [time]."""
    if leg.stop.problem or not leg.stop.value > 0:
        raise DeckError(
            f"{leg.run.at}: the end of the run is {leg.stop.value:g}, expected a time above 0"
        )
    return leg.stop.value


def _read_interval(leg: RadiossLeg) -> float:
    """Return the output interval of the time history [time], which must be short enough to show contacts."""
    for block in read_blocks(leg.run.block.source):
        card = make_card(block)
        if (
            card.words[0] == "TFILE"
            and (values := [*read_numbers(card)])
            and values[0].value > 0
        ):
            return values[0].value
    raise DeckError(
        f"{leg.run.at}: no /TFILE in the engine file; add one that writes some 100 states per flight"
    )


def _find_second(run: RadiossRun) -> float | None:
    """Return the length of a second in the time unit of the deck [time]; None if the deck does not give its unit."""
    return _IN_A_SECOND.get(find_time_units(run)[-1])
