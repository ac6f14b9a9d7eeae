"""Name the command that follows an answer, with the options and files of its question, ready to be copied."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import COPY_AGAIN, list_names
from d2rpick.base.options import make_option_name
from d2rpick.base.tuples import NamedTuple
from d2rpick.choice.options import list_uses
from d2rpick.choice.pair.grades import DO_NOT_USE
from d2rpick.deck.beside import SOME_NODES, SOME_PARTS, find_deck_beside
from d2rpick.report.tables import make_positional, quote_shell_line

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.choice.pair.candidates import Pair
    from d2rpick.choice.pair.decision import Decision
    from d2rpick.choice.pair.situation import Situation
    from d2rpick.choice.question import Settings
    from d2rpick.deck.printed_card import PrintedCard
    from d2rpick.histories.history import History
    from d2rpick.report.formats import RepeatedQuestion

# Placeholders for the main deck in a command if the user has to name it, and for the folder of its copy.
_SOME_DECK: Final = "DECK"
# Largest number of main nodes of a deck that are named in a hint.
_MOST_NODES: Final = 8
_SOME_HISTORY: Final = "HISTORY"
# Placeholder for the files of a reference run in a command that compares it with a switched run.
_SOME_REFERENCE: Final = "REFERENCE"
_FOLDER: Final = "switched"
# Word for the parts that fly together, as in `d2rpick.flight.momentum`, which is slow to import.
_FLYING: Final = "flying"
# Statement of the last step, when the pairs of all flights have been compared.
_NO_PAIR: Final = "no pair of this run can be used"
# Options that can be the reason why no pair can be used, besides those that set a limit.
_OTHER_LIMITS: Final = (
    "--after",
    "--landing",
    "--margin",
    "--min-quality",
    "--min-rigid",
    "--tolerance",
)
# If a record has fewer states than this, their interval says nothing about the one that is needed.
_FEWEST: Final = 20
# Option that accepts no pair in a flight that only the energy shows.
_STRICT: Final = "--strict"
# Advice on a table whose run has no deck at hand.
_ADD_COLUMNS: Final = "without a deck, add columns mass, x_momentum, y_momentum and z_momentum to the table"
# Hint to replace the placeholder of the main deck.
_MAIN_DECK: Final = f"main deck of the run instead of {_SOME_DECK}"
# Reason why the card of several parts needs the main deck.
_NEEDS_DECK: Final = (
    f"{_MAIN_DECK}; without it, parts that share nodes become separate rigid bodies"
)


class NamedDeck(NamedTuple):
    """Main deck in the next command, and a hint to replace a placeholder; the hint is empty if the deck was found."""

    name: str
    hint: str


def name_deck_of_run(question: RepeatedQuestion, hint: str = _MAIN_DECK) -> NamedDeck:
    """Return the main deck next to the history or, if there is none or decks are excluded, a placeholder."""
    is_excluded = "--no-deck" in question.options
    deck = None if is_excluded else _find_deck(question.files)
    return NamedDeck(deck, "") if deck else NamedDeck(_SOME_DECK, f" ({hint})")


def _find_deck(files: Sequence[str]) -> str | None:
    """Return the only main deck in a run folder, or the deck next to a history that has its name; None if unknown."""
    if len(files) == 1 and os.path.isdir(files[0]):  # noqa: PTH112  pathlib would slow down start-up
        # Imported here to keep start-up fast.
        from d2rpick.deck import find_decks_of_run

        decks = find_decks_of_run(files[0])
        return decks[0] if len(decks) == 1 else None
    return find_deck_beside(files)


def write_command(
    question: RepeatedQuestion, name: str, *words: str, new_parts: Sequence[str] = ()
) -> str:
    """Return another command about the same run, with the given parts or, if there are any, the ``new_parts``."""
    parts = ("--part", ",".join(new_parts)) if new_parts else question.parts
    files = make_positional(question.files)
    return quote_shell_line(
        ("d2rpick", name, *words, *parts, *question.options, *files)
    )


def needs_deck(history: History, settings: Settings) -> bool:
    """Return True if it is unknown which of several parts share nodes, so that an LS-DYNA card may not merge them."""
    from d2rpick.deck.printing import SOLVERS, find_solver

    switches_parts = SOLVERS[find_solver(history.format)].switches == "part"
    return switches_parts and not settings.bodies and len(history.parts or ()) > 1


def name_step_to_deck(question: RepeatedQuestion, then: str = "") -> str:
    """Return a text with the command that writes a copy of the main deck with the cards of a plan.

    ``then`` says what to do after the run of this deck.
    """
    words: tuple[str, ...] = ()
    hint = ""
    if "--deck" not in question.options:
        deck = name_deck_of_run(question, _NEEDS_DECK)
        words, hint = ("--deck", deck.name), deck.hint
    words = (*question.times, *words, "--write-deck", _FOLDER)
    line = write_command(_allow_deck(question), "plan", *words)
    action = f"write a copy of the deck with the cards, and run it in the folder {_FOLDER} from t = 0{then}"
    return f"{action}. This writes the copy: {line}{hint}"


def _allow_deck(question: RepeatedQuestion) -> RepeatedQuestion:
    """Return the question without the option that forbids a deck."""
    options = tuple(word for word in question.options if word != "--no-deck")
    judging = tuple(word for word in question.judging if word != "--no-deck")
    return question._replace(options=options, judging=judging)


def name_step_to_card(
    history: History,
    settings: Settings,
    windows: Sequence[tuple[float, float]],
    question: RepeatedQuestion,
    command: str,
    *,
    flying: bool,
    action: str = "print the cards with",
) -> str:
    """Return the step that prints the card for windows by ``command`` (``suggest`` or ``plan``) or by ``card``.

    ``action`` says what to do with the command, which follows it. If the files show which parts are ``flying`` but no
    part or energy was chosen, the step is to choose the parts.
    """
    from d2rpick.deck.printing import SOLVERS, find_solver, names_solver

    is_radioss = SOLVERS[find_solver(history.format)].switches == "node"
    is_chosen = question.parts or "--energy" in question.options
    if flying and not is_chosen and not is_radioss:
        return name_step_to_parts(question, "verify" if command == "card" else command)
    # Only `card` accepts parts that the history does not contain.
    if command != "card" and (history.parts or is_radioss):
        words = (*question.times, "-f", "card")
    else:
        words = tuple(
            text
            for tr, td in windows
            for text in ("--tr", f"{tr:.6g}", "--td", f"{td:.6g}")
        )
        command = "card"
    hint = ""
    # The deck names the main nodes of the rigid bodies that contain the parts.
    if is_radioss and not (history.parts and settings.bodies is not None):
        more_words, hint = _name_bodies(history, question)
        words = (*words, *more_words)
        question = _allow_deck(question)
    elif not history.parts:
        words = (*words, "--part", SOME_PARTS)
        of_radioss = ""
        if not names_solver(history.format):
            of_radioss = f"; for a Radioss run, --solver radioss --node {SOME_NODES} instead of --part {SOME_PARTS}"
        hint = f" (ids of your parts instead of {SOME_PARTS}; add --merge ID if parts share nodes{of_radioss})"
    elif needs_deck(history, settings):
        deck = name_deck_of_run(question, _NEEDS_DECK)
        words = (*words, "--deck", deck.name)
        hint = deck.hint
        question = _allow_deck(question)
    words = (*words, *question.card)
    if command == "card":
        line = quote_shell_line(("d2rpick", "card", *words, *question.judging))
    else:
        line = write_command(question, command, *words)
    return f"{action} {line}{hint}"


def name_step_to_parts(question: RepeatedQuestion, command: str) -> str:
    """Return the step that repeats a ``command`` with the parts that fly instead of the whole model."""
    line = write_command(question, command, *question.times, new_parts=[_FLYING])
    return f"choose the parts to switch, for example those that fly, with {line}"


def _name_bodies(
    history: History, question: RepeatedQuestion
) -> tuple[tuple[str, ...], str]:
    """Return the options that name the rigid bodies on a card for Radioss, and a hint to replace a placeholder.

    The deck next to the history names the bodies of chosen parts. If no part is chosen, its only body is switched.
    """
    from d2rpick.deck.suiting import list_main_nodes

    is_excluded = "--no-deck" in question.options
    deck = None if is_excluded else find_deck_beside(history.source)
    if deck and question.parts and "--deck" not in question.options:
        return ("--deck", deck), ""
    nodes = list_main_nodes(deck) if deck else ()
    if len(nodes) == 1:
        return ("--node", str(nodes[0])), ""
    hint = f"main nodes of your rigid bodies instead of {SOME_NODES}"
    if nodes:
        hint += f"; the deck has {list_names([*map(str, nodes)], most=_MOST_NODES)}"
    return ("--node", SOME_NODES), f" ({hint})"


def name_step_with_pair(
    situation: Situation,
    pair: tuple[float, float],
    better: Pair | None,
    question: RepeatedQuestion,
    command: str,
) -> str:
    """Return the next step after a usable pair: judge the ``better`` pair or, if there is none, print the card."""
    if better is not None:
        return name_step_to_better_pair(better, question)
    return name_step_to_card(
        situation.history,
        situation.settings,
        [pair],
        question,
        command,
        flying=situation.flight.by_parts,
    )


def name_step_to_better_pair(better: Pair, question: RepeatedQuestion) -> str:
    """Return a text with the command that judges a better pair."""
    line = write_command(question, "suggest", "--td", f"{better.td:.6g}")
    return f"judge the better pair with {line}"


def _keep_td(times: Sequence[str]) -> Sequence[str]:
    """Return the option ``--td`` or ``--td-window`` and its values from a command line; empty if neither occurs."""
    for name, values in (("--td", 1), ("--td-window", 2)):
        if name in times:
            position = times.index(name)
            return times[position : position + 1 + values]
    return ()


def _name_step_to_better_record(
    history: History, decision: Decision, question: RepeatedQuestion
) -> str:
    """Return the step after a pair that the record cannot support: the deck of the run, or a change of the record."""
    if decision.needs_deck:
        if history.format in ("csv", "hdf5"):
            deck = name_deck_of_run(question, f"{_MAIN_DECK}; {_ADD_COLUMNS}")
        else:
            deck = name_deck_of_run(question)
        words = (*_keep_td(question.times), "--deck", deck.name)
        line = write_command(_allow_deck(question), "suggest", *words)
        return f"judge the run with its deck: {line}{deck.hint}"
    return (
        f"improve the record: {decision.cure}; until then, no pair from it can be used"
    )


def add_step_to_copy(
    history: History, steps: Sequence[tuple[str, str]]
) -> list[tuple[str, str]]:
    """Return the next steps; if the files end within a state, the first one is to copy them again.

    The line before it says that the verdict is that of the part that was read.
    """
    if history.complete:
        return [*steps]
    end = f"the record ends early, at {history.end:.6g}, within a state"
    rest = "; ".join(step for _, step in steps)
    return [
        ("note", f"{end}: only the part before was read and judged"),
        (
            "next",
            f"{COPY_AGAIN}{f'. For the part that was read: {rest}' if rest else ''}",
        ),
    ]


def ask_for_states_that_show_flight(states: int, start: float, end: float) -> str:
    """Return the advice to write more states if those of a record are too few to show a flight; otherwise empty."""
    # Imported here, because a card without a history needs no numpy.
    from d2rpick.choice.pair.few_states import ENOUGH_STATES

    if states >= ENOUGH_STATES:
        return ""
    if states < _FEWEST:
        count = "1 state shows" if states == 1 else f"{states} states show"
        return (
            f"continue the run, or write the states more often, because {count} no flight; if no flight is found even "
            "then, "
        )
    interval = (end - start) / ENOUGH_STATES
    return (
        f"continue the run if it has not reached a flight, or write the states every {interval:.2g} or more often, "
        f"because {states} states may miss a flight; if no flight is found even then, "
    )


def name_lack_of_pairs(question: RepeatedQuestion) -> str:
    """Return the statement that no pair of the run can be used, with the given options that may be the reason."""
    words = (*question.times, *question.options)
    options_with_limit = [
        f"--{make_option_name(name)}" for name, use in list_uses().items() if use.limit
    ]
    names = sorted({*_OTHER_LIMITS, *options_with_limit})
    limits = [
        f"{name} {words[words.index(name) + 1]}" for name in names if name in words
    ]
    # This value accepts every pair, so no other value allows more.
    limits = [limit for limit in limits if limit != "--min-quality poor"]
    remedies = []
    if limits:
        remedies.append("another value" if len(limits) == 1 else "other values")
    if _STRICT in words:
        limits.append(_STRICT)
        remedies.append(f"an answer without {_STRICT}")
    if not limits:
        return _NO_PAIR
    return (
        f"{_NO_PAIR} with {list_names(limits)} ({' or '.join(remedies)} may allow one)"
    )


def name_step_after_flight(
    situation: Situation, decision: Decision | None, question: RepeatedQuestion
) -> str:
    """Return the step after a comparison of all td of a flight, none of which has a usable pair.

    It leads to the other flights or, if there are none, out of the run; without any flight, to the lacking output.
    """
    # Imported here to keep start-up fast.
    from d2rpick.choice.td.flights import has_other_flights

    if situation.flight.start is None:
        return name_step_without_flight(situation.history, question)
    if has_other_flights(situation.history, situation.settings, situation.td):
        line = write_command(question, "plan")
        return (
            f"no pair of this flight can be used; compare the other flights with {line}"
        )
    return name_way_out_of_run(situation, decision, question)


def name_step_without_flight(history: History, question: RepeatedQuestion) -> str:
    """Return the step if no flight is found; the end of the load is asked for unless the momentum shows no flight."""
    # Imported here, because a card without a history needs no numpy.
    from d2rpick.flight.flight import (
        NEVER_FLIES,
        denies_every_flight,
        describe_hiding_digits,
    )
    from d2rpick.histories.samples import find_holes

    more = ask_for_states_that_show_flight(
        history.time.size, history.start, history.end
    )
    line = write_command(question, "info")
    if not history.energy.any():
        return f"choose the internal energy as `energy`; see the columns with {line}"
    look = f"see what the run has to write with {line}"
    if history.energy.min() == history.energy.max():
        return (
            f"choose parts that deform or another energy, because the energy is {history.energy[0]:.6g} in all states; "
            f"see what the files contain with {line}"
        )
    if holes := find_holes(history.time):
        first, last = holes[0]
        return f"add the files of the restart segment that is missing between {first:.6g} and {last:.6g}"
    if not denies_every_flight(history):
        return f"{more}give the end of the load as --after, or {look}"
    no_pair = f"{more}{name_lack_of_pairs(question)}: {NEVER_FLIES}"
    if hint := describe_hiding_digits(history):
        return f"{no_pair}; {hint}, or run it without switching"
    if any(momenta.parts for momenta in history.momenta):
        return f"{no_pair}; run it without switching"
    return f"{no_pair}; to find out whether single parts fly, {look}"


def name_way_out_of_run(
    situation: Situation, decision: Decision | None, question: RepeatedQuestion
) -> str:
    """Return the step after a comparison of all flights in which no pair can be used.

    It leads to other parts or to a change of the input, never to another comparison of the same pairs.
    """
    is_chosen = question.parts or "--energy" in question.options
    no_pair = name_lack_of_pairs(question)
    if situation.flight.by_parts and not is_chosen:
        line = write_command(question, "plan", new_parts=[_FLYING])
        return (
            f"{no_pair} with all parts; judge the parts that fly together with {line}"
        )
    cure = decision.cure_without_other_times if decision else ""
    if cure:
        return f"{no_pair}: {cure}{_name_way_to_switched_run(cure, question)}"
    if situation.history.parts:
        line = write_command(question._replace(parts=()), "parts")
        if advice := _ask_for_longer_run(situation):
            return (
                f"{no_pair} with these parts: {advice}, or find other parts with {line}"
            )
        return f"{no_pair} with these parts; find other parts with {line}"
    advice = ", or ".join(
        filter(
            None,
            (
                _ask_for_longer_run(situation),
                _ask_for_states_that_show_peaks(situation),
            ),
        )
    )
    first = f"{advice}; if this does not help, " if advice else ""
    return f"{no_pair}: {first}run it without switching, or make other parts rigid"


def _ask_for_longer_run(situation: Situation) -> str:
    """Return the advice to continue a run if its record ends in the flight; otherwise empty."""
    if situation.flight.start is None or situation.flight.end is not None:
        return ""
    return "continue the run, because its record ends in the flight"


def _ask_for_states_that_show_peaks(situation: Situation) -> str:
    """Return the advice to write more states if those of a record are too few to show its peaks; otherwise empty.

    The output interval is the one that the warning about few states names.
    """
    # Imported here, because a card without a history needs no numpy.
    from d2rpick.choice.pair.few_states import ENOUGH_STATES

    history, td, begin = situation.history, situation.td, situation.flight.start
    states = history.time.size
    if states >= ENOUGH_STATES:
        return ""
    duration = history.duration
    if begin is not None and begin < td:
        duration = td - begin
    interval = duration / ENOUGH_STATES
    more = f"write the states every {interval:.2g} or more often"
    return f"{more}, because {states} states may miss a peak"


def name_step_after_switched_run(question: RepeatedQuestion) -> str:
    """Return the step after a plan of a finished switched run in which no further window can be used."""
    switched = [text for name in question.files for text in ("--switched", name)]
    words = ("d2rpick", "verify", *switched, *question.parts, _SOME_REFERENCE)
    hint = f"the reference run instead of {_SOME_REFERENCE}"
    return (
        f"compare this run with its reference run: {quote_shell_line(words)} ({hint})"
    )


def _name_way_to_switched_run(cure: str, question: RepeatedQuestion) -> str:
    """Return the command that writes the deck of a switched run if a ``cure`` asks for one; otherwise ""."""
    # Imported here, because a card without a history needs no numpy.
    from d2rpick.choice.pair.quality import COMPARE

    if COMPARE not in cure or not question.parts:
        return ""
    deck = name_deck_of_run(question)
    given = () if "--deck" in question.options else ("--deck", deck.name)
    words = (*given, "--min-quality", "poor", "--write-deck", _FOLDER)
    options = _leave_out(question.options, "--min-quality")
    line = write_command(question._replace(options=options), "plan", *words)
    return f". This writes the deck of such a run: {line}{deck.hint if given else ''}"


def _leave_out(words: Sequence[str], name: str) -> tuple[str, ...]:
    """Return the words of a command without an option and its value."""
    if name not in words:
        return tuple(words)
    position = words.index(name)
    return (*words[:position], *words[position + 2 :])


def name_step_after_refusal(
    situation: Situation,
    better: Pair | None,
    question: RepeatedQuestion,
    otherwise: str,
    decision: Decision | None = None,
) -> str:
    """Return the step after an unusable pair: judge a better pair or other parts; if there are none, ``otherwise``.

    If the ``decision`` shows that every pair of the record is unusable, the next step is to improve the record.
    """
    if situation.keeps_nothing_of_flight and "--margin" in question.options:
        return name_step_to_derived_margin(question)
    if decision is not None and decision.better_parts:
        line = write_command(question, "plan", new_parts=decision.better_parts)
        return f"make other parts rigid; judge them with {line}"
    if decision is not None and decision.needs_better_record:
        return _name_step_to_better_record(situation.history, decision, question)
    if decision is not None and decision.is_outside_flight and better is None:
        line = write_command(question, "suggest")
        return f"choose both times in the flight with {line}"
    if better is not None:
        return name_step_to_better_pair(better, question)
    missing = situation.parts_to_add if question.parts else ()
    if missing:
        parts = (*(situation.history.parts or ()), *missing)
        ids = sorted(part.id for part in parts)
        line = write_command(question, "suggest", new_parts=[*map(str, ids)])
        return f"judge the parts that vibrate together with {line}"
    return otherwise


def name_step_to_derived_margin(question: RepeatedQuestion) -> str:
    """Return the step after a given margin that leaves nothing of a flight: a plan with the margin of the run."""
    options = _leave_out(question.options, "--margin")
    line = write_command(question._replace(options=options), "plan")
    return f"leave out --margin, so that it is derived from the run: {line}"


def name_step_after_card(
    card: PrintedCard,
    worst: Decision | None,
    question: RepeatedQuestion,
    deck: str | None,
    *,
    is_separate: bool,
    has_errors: bool,
) -> str:
    """Return the next step after a card: check the ``deck`` or, if the ``worst`` pair is unusable, choose other times.

    ``is_separate``: each part becomes a rigid body of its own, although they may share nodes.
    ``has_errors``: the check of the deck with the card finds errors, so that they have to be corrected first.
    """
    if worst is not None and worst.verdict == DO_NOT_USE:
        return f"choose other times with {write_command(question, 'suggest')}"
    if has_errors:
        return "correct the options of the card or the deck as the errors above say, and print the card again"
    if card.has_engine_files:
        action = "save the lines below each '# ---- NAME' as the file NAME next to the starter deck"
        name = "starter deck"
    else:
        action, name = "add these cards to the main deck", "main deck"
    main_deck = (
        NamedDeck(deck, "")
        if deck
        else name_deck_of_run(question, f"{name} instead of {_SOME_DECK}")
    )
    if worst is None:
        action = f"these times were not judged, because no history was given; {action}"
    files = make_positional([main_deck.name])
    line = quote_shell_line(("d2rpick", "check", *question.checking, *files))
    if is_separate and not deck and not main_deck.hint:
        again = f"print the card again with --deck {main_deck.name}"
        action = f"if these parts share nodes, {again}, which merges them; {action}"
    elif is_separate:
        action = f"if these parts share nodes, print the card again with --merge ID; {action}"
    return f"{action}, then check it with {line}{main_deck.hint}"


def name_step_after_extract(file: str) -> str:
    """Return the next step after an energy was extracted into a file."""
    line = quote_shell_line(("d2rpick", "suggest", *make_positional([file])))
    action = "choose times with this table, but print the cards from the run itself"
    reason = "because the table names neither its solver nor all its parts"
    return f"{action}, {reason}: {line}"


def name_step_after_weights(file: str) -> str:
    """Return the next step after weights were written into a file."""
    words = ("parts", "--deck", _SOME_DECK, "--weights", file, _SOME_HISTORY)
    line = quote_shell_line(("d2rpick", *words))
    hint = f"deck and history of your run instead of {_SOME_DECK} and {_SOME_HISTORY}"
    return f"use the weights, for example with {line} ({hint})"


def name_step_after_first(folder: str) -> str:
    """Return the next step after a deck that chooses its own switching times was written into a folder."""
    files = make_positional([folder])
    check = quote_shell_line(("d2rpick", "check", *files))
    follow = quote_shell_line(("d2rpick", "follow", *files))
    return f"check the deck with {check}, and run it; meanwhile, see when the parts fly or are rigid with {follow}"
