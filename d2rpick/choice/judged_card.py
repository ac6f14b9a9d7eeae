"""Print D2R cards with times that were judged by means of an energy history."""

from __future__ import annotations

from functools import partial
from itertools import chain
from typing import TYPE_CHECKING

from d2rpick.choice.answers import verify_run
from d2rpick.choice.pair.grades import DO_NOT_USE
from d2rpick.choice.pair.together import ASSUMED_PARTS
from d2rpick.deck.printing import DEFAULT, SOLVERS, find_solver, print_cards
from d2rpick.histories.formats import READERS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from d2rpick.base.spans import Times
    from d2rpick.choice.answers import PairVerdict
    from d2rpick.choice.pair.situation import Situation
    from d2rpick.choice.question import Reference, Settings
    from d2rpick.deck.printed_card import PrintedCard, Printing
    from d2rpick.histories.history import History


def complete_printing(printing: Printing, history: History) -> Printing:
    """Fill in missing options of a card, such as the solver and the parts, from a history.

    The history defines the solver, the chosen parts, the end of the run, and the times at which a contact force acts.
    """
    solver = printing.solver or find_solver(history.format)
    ids = printing.part or tuple(part.id for part in history.parts or ())
    end = history.end if printing.end is None else printing.end
    printing = printing._replace(solver=solver, part=ids, end=end)
    if "contact" in SOLVERS[solver].takes:
        printing = _add_pushes(printing, history, SOLVERS[solver].title)
    return printing


def list_switched(printing: Printing) -> tuple[int, ...]:
    """Return the parts or main nodes that a card switches; empty if none are given."""
    switched: tuple[int, ...] = getattr(
        printing, SOLVERS[printing.solver or DEFAULT].switches
    )
    return switched


def add_deck_bodies(printing: Printing, settings: Settings) -> Printing:
    """Add the rigid bodies defined in a deck as merged parts, and keep its inactive bodies inactive."""
    bodies = tuple(body.parts for body in settings.bodies or ())
    replaced = (*printing.node, *printing.replaced)
    inactive = tuple(node for node in settings.kept_off if node not in replaced)
    return printing._replace(bodies=bodies, off=inactive)


def _add_pushes(printing: Printing, history: History, solver: str) -> Printing:
    """Add the times at which the named contact or rigid wall exerts a force, and the closing speed of the parts.

    The times follow from the contact force or, if it is not written, from the part momenta; the speed follows only from
    momenta.
    """
    # Imported here to keep start-up fast.
    from d2rpick.flight.contact_times import (
        find_contact_times,
        find_force_times,
    )
    from d2rpick.histories.contact_forces import find_force

    momenta = next((momenta for momenta in history.momenta if momenta.parts), None)
    by_momenta = find_contact_times(momenta) if momenta else None
    contact = "interface" if solver == "Radioss" else "contact"
    if printing.contact is None:
        push = ("rigid wall", printing.wall)
    else:
        push = (contact, printing.contact)
    kind, number = push
    force = find_force(history.evidence.forces, kind, number or 0)
    times = (find_force_times(force) if force else None) or by_momenta
    speed = by_momenta.speed if by_momenta else None
    return printing._replace(pushed=times.spans, speed=speed) if times else printing


def print_pair(
    reference: Reference, situation: Situation, tr: float, printing: Printing
) -> PrintedCard | None:
    """Print the card for ``tr`` and the td of a situation, with a verdict on both; None if no parts are switched."""
    history = situation.history
    judge = partial(
        verify_run, reference, settings=situation.settings, earlier=situation
    )
    printing = add_deck_bodies(printing, situation.settings)
    card = print_judged_card(
        [(tr, situation.td)], history, judge, complete_printing(printing, history)
    )
    return card[0] if card else None


def print_judged_card(
    windows: Sequence[Times],
    history: History,
    judge: Callable[[float, float], PairVerdict],
    printing: Printing,
    done: Sequence[Times] = (),
) -> tuple[PrintedCard, tuple[PairVerdict, ...]] | None:
    """Print the card for windows with the verdicts that ``judge`` returns for the printed values of tr and td.

    The history completes ``printing``. The windows ``done``, in which the run is already switched, are printed, too,
    but this run cannot show whether they are good. The result is None if the parts or, for some solvers, the main nodes
    are not given.
    """
    if not list_switched(printing):
        return None
    all_windows = sorted((*done, *windows))
    plain = print_cards(all_windows, printing)
    printed = plain.windows
    if "contact" in SOLVERS[printing.solver or DEFAULT].takes:
        printed = _narrow_windows(printed, history)
    verdicts = tuple(
        judge(*times)
        for requested, times in zip(all_windows, printed, strict=True)
        if requested not in done
    )
    remarks = tuple(_list_card_remarks(done, history, verdicts))
    return print_cards(all_windows, printing, remarks), verdicts


def _narrow_windows(windows: Sequence[Times], history: History) -> tuple[Times, ...]:
    """Return the windows to judge. Windows that depend on a force are narrowed to the output states within them."""
    from d2rpick.flight.contact_times import (
        narrow_to_states,
    )  # Imported here to keep start-up fast.

    narrowed = (narrow_to_states(history.time, *window) for window in windows)
    return tuple((tr, td) for tr, td in narrowed if td is not None)


def _list_card_remarks(
    done: Sequence[Times], history: History, verdicts: Sequence[PairVerdict]
) -> Iterator[str]:
    """Yield comments for a card: windows without a verdict, the verdicts, and the parts to which the energy belongs."""
    if done:
        windows = ", ".join(f"{tr:.6g} to {td:.6g}" for tr, td in done)
        yield f"{', '.join(history.source)} was rigid from {windows}: these windows are done and not judged again."
    for verdict in verdicts:
        if len(verdicts) > 1:
            which = f" {verdict.candidate.tr:.6g} to {verdict.situation.td:.6g}"
        else:
            which = ""
        yield from _describe_verdict(verdict, which)
    if _names_no_part(history) and READERS[history.energy_format].solver:
        yield "The internal energy is that of the whole model, not of the switched parts alone."
    elif _names_no_part(history):
        yield f"The table does not name the parts of the internal energy: it must be {ASSUMED_PARTS}."
    cautions = chain.from_iterable(verdict.cautions for verdict in verdicts)
    yield from dict.fromkeys(
        f"{caution.code}: {caution.message}." for caution in cautions
    )


def _names_no_part(history: History) -> bool:
    """Return True if the energy is named like that of a whole model, and no file names its parts."""
    is_of_model = history.channel.replace(" ", "_") == "internal_energy"
    return history.parts is None and is_of_model


def _describe_verdict(verdict: PairVerdict, which: str) -> Iterator[str]:
    """Yield comments with the verdict on a pair."""
    candidate = verdict.candidate
    history = verdict.situation.history
    decision = verdict.decision
    word = decision.verdict
    verdict_text = word.upper() if word == DO_NOT_USE else word
    judged = f"Verdict according to {', '.join(history.source)} ({history.channel})"
    yield f"{judged}:{which} {verdict_text}. {_format_as_sentence(decision.reason)}"
    if decision.cure:
        yield f"To improve: {decision.cure}."
    yield f"Expect: {decision.expected}. At worst: {decision.worst_case}."
    # If the parts are at rest, no energy level has to be matched.
    if verdict.situation.at_rest:
        return
    measures = [
        f"{name} {value:.3f}"
        for name, value in (
            ("frozen-deformation error", candidate.lock_in_error),
            ("level error", candidate.level_error),
            ("kinetic fraction", verdict.situation.kinetic_share),
            ("residual", candidate.residual),
        )
        if value is not None
    ]
    if measures:
        yield f"{', '.join(measures).capitalize()}."


def _format_as_sentence(text: str) -> str:
    """Return a reason as a sentence, with a capital letter, unless it begins with a symbol, and a full stop."""
    if text.startswith(("tr ", "td ")):
        return f"{text}."
    return f"{text[:1].upper()}{text[1:]}."
