"""A Radioss run whose legs are decided while it is computed: its copy, and the engine file of each leg."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.base.errors import DeckError
from d2rpick.deck.printing import EngineFile, engine_lines
from d2rpick.deck.radioss_bodies import bodies_for
from d2rpick.deck.radioss_deck import Leg, blocks, card_of, kept_off, keyword, numbers
from d2rpick.deck.radioss_run import Run, parts_off, read_run
from d2rpick.deck.writing import copies, repeated, text_of, with_cards

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping


_NOT_REPEATED: Final = {"RFILE"}  # restarts are written as the driver needs them
# Restarts of a leg that are kept, and cycles between them.  One costs as much as some five cycles; of two, one is whole
# whenever the solver is ended.
RESTARTS: Final = 2, 1000
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
        self, number: int, until: float, restart: str, cap: float | None, restarts: tuple[int, int] = RESTARTS
    ) -> bytes:
        """Write the engine file of a leg: from a restart of the leg before, rigid where a step ``cap`` is given.

        ``restarts``: how many of its own are kept, and how many cycles lie between them.
        """
        file = EngineFile(number, until, cap)
        head, *lines = engine_lines(file, self.name, self.nodes, self.others)
        head += f"/{restart}" * bool(restart)
        kept = [text for words, text in self.further if repeated(words, file)]
        more = ["/MON/ON"] * (not any(words[0] == "MON" for words, _ in self.further))
        own = [head, *lines, *more, f"/RFILE/{restarts[0]}", str(restarts[1])]
        return "".join(f"{line}\n" for line in own).encode() + b"".join(kept)


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
    run = read_run(path)
    if run.starter is None or not run.legs:
        found = "starter deck" if run.starter is None else "engine file"
        raise DeckError(f"{path}: the run has no {found}; its starter deck and an engine file were expected")
    leg = run.legs[0]
    chosen = tuple(sorted(parts)) or parts_off(run)
    if not chosen:
        raise DeckError(f"{path}: the engine file puts no rigid body off; name the parts to be switched with --part")
    bodies = bodies_for(path, chosen)
    others = tuple(node for node in kept_off([leg]) if node not in bodies.nodes)
    source = run.starter.sources[0]
    main = f"{leg.name}_0000.rad"
    content = with_cards(source, bodies.cards, blocks(source))
    files = {main: content, **dict(copies(run.starter.sources[1:], source.name, {main}))}
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
        raise DeckError(f"{leg.run.at}: the end of the run is {leg.stop.value:g}, a time above 0 was expected")
    return leg.stop.value


def _interval(leg: Leg) -> float:
    """Interval of the time history, which shows whether anything touches [time]."""
    for block in blocks(leg.run.block.source):
        card = card_of(block)
        if card.words[0] == "TFILE" and (values := [*numbers(card)]) and values[0].value > 0:
            return values[0].value
    raise DeckError(f"{leg.run.at}: no /TFILE in the engine file; add one, some hundred states for a flight")


def _second(run: Run) -> float | None:
    """Length of a second in the units in which the deck is computed [time]; None where it names none."""
    assert run.starter
    rows = next((card.rows for card in run.starter.named("BEGIN")), ())
    return _IN_A_SECOND.get(rows[3].text[40:60].strip().lower()) if len(rows) > 3 else None
