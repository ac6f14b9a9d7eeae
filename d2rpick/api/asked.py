"""Turn a request into a question: open the run, select the energy, and add the deck's settings and costs.

The commands for one run and the Python functions use this module; `d2rpick.choice.answers` computes the answer.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from d2rpick.api.deck_in_folder import find_deck_in_folder, name_deck
from d2rpick.api.request import OPTIONS, Request
from d2rpick.base.errors import (
    ArgumentError,
    Caution,
    FormatError,
    list_names,
    name_units,
)
from d2rpick.base.tuples import NamedTuple
from d2rpick.choice.question import Reference
from d2rpick.histories.names import Selection, has_recommended

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.api.arguments import Deck, Parts, Path
    from d2rpick.api.choosing import Choosing
    from d2rpick.api.runs import Run
    from d2rpick.choice.parts.cost import CostModel, Weights
    from d2rpick.choice.question import Settings
    from d2rpick.histories import run as histories
    from d2rpick.report.formats import RepeatedQuestion


class RunQuestion(NamedTuple):
    """A question: the opened run, the selected energy, and the settings by which the run is judged.

    ``cautions`` lists data that the deck does not define. ``selection`` contains the columns and parts, including those
    from the deck. ``on_card`` contains parts that occur only on the card, and ``merge`` is the part into which the card
    merges all parts.
    """

    run: Run
    request: Request
    reference: Reference
    selection: Selection
    settings: Settings
    model: CostModel | None = None
    on_card: tuple[str, ...] = ()
    cautions: tuple[Caution, ...] = ()
    # False if the deck belongs to another run.
    of_this_run: bool = True
    merge: int | None = None

    @property
    def deck(self) -> str | None:
        """The main deck of the run; None if there is no deck, or if the deck belongs to another model."""
        return self.request.deck if self.of_this_run else None

    @property
    def unused_deck(self) -> str | None:
        """The deck that the user named but that is not used because it belongs to another model; otherwise None."""
        if self.of_this_run or self.request.deck_in_folder:
            return None
        return self.request.deck

    @property
    def repeated(self) -> RepeatedQuestion:
        """Parts of the command line with which other commands ask about the same run."""
        if self.unused_deck:
            question = self.request.repeat(without=("deck", "weights", "step_ratio"))
            question = question._replace(
                options=("--no-deck", *question.options),
                judging=(*question.judging, "--no-deck"),
                unused_deck=self.unused_deck,
            )
        else:
            question = self.request.repeat()
        merging = () if self.merge is None else ("--merge", str(self.merge))
        return question._replace(card=merging)

    @property
    def options(self) -> tuple[str, ...]:
        """Options that follow the times on the command line that repeats the question."""
        # Imported here to keep start-up fast.
        from d2rpick.report.tables import make_positional

        return (*self.request.asking(), *make_positional(self.request.history))


def make_request(
    run: Run | None,
    parts: Parts | None,
    flying: Parts | None,
    deck: Deck | None,
    weights: Weights | Path | None,
    choosing: Choosing,
) -> Request:
    """Make a request from the arguments; raise TypeError for a wrong type or an unknown argument.

    Times in ``choosing`` may be strings with a unit, which are converted to the unit of the run.
    """
    # Imported here to keep start-up fast.
    from d2rpick.api import arguments
    from d2rpick.api.times import TimeArguments

    if run is not None:
        arguments.check_run("run", run)
    chosen = run.chosen if run else Selection()
    times = TimeArguments.of_run(run)
    request = Request(
        deck=None
        if deck is None or deck is False
        else arguments.check_path("deck", deck),
        no_deck=deck is False,
        run_folder=run.folder if run else None,
        weights=arguments.check_weights(weights),
        history=run.sources if run else (),
        input_format=run.input_format if run else "auto",
        time=chosen.time,
        energy=chosen.energy,
        part=arguments.list_part_names("parts", parts),
        flying=arguments.list_part_names("flying", flying),
        channel=tuple(f"{quantity}={name}" for quantity, name in chosen.channels),
        **arguments.read_choosing(times.convert_options(choosing, OPTIONS)),
    )
    return find_deck_in_folder(request)


def open_requested_run(request: Request, names: Sequence[str] = ()) -> Run:
    """Open the run that the request names, or other files with the same options."""
    from d2rpick.api.runs import Run, find_folder
    from d2rpick.histories import opening

    selection = request.selection(parts=False)
    names = names or request.history
    files = opening.open_run(names, selection, request.input_format)
    return Run(files, selection, request.input_format, find_folder(names))


def is_card_only(request: Request, run: histories.OpenedRun) -> bool:
    """Return True if ``--part`` applies only to the card, because the history is a table without parts."""
    return bool(request.energy) or not run.parts


def ask_run(
    run: Run, request: Request, *, card_alone: bool = False, merge: int | None = None
) -> RunQuestion:
    """Select the requested energy of a run, and add the data from the run's deck.

    Parameters
    ----------
    run : Run
    request : Request
    card_alone : bool
        True if only a card is requested; it may contain parts that the history lacks, and the energy is then that of
        the model.
    merge : int, optional
        Part into which the card merges all others, so that they become one rigid body.

    Raises
    ------
    D2RPickError
        If the run has no such parts or energy, or the deck or the weights cannot be read.
    ArgumentError
        If the recommended set is requested together with other parts, or if there is no deck.
    """
    settings = request.settings
    model = read_cost_model(request)
    files = run.files
    selection = request.selection(parts=False)._replace(parts=request.part)
    if request.part:
        _check_recommended(request, files)
    foreign = False
    if model is not None:
        from d2rpick.choice.parts.deck_of_run import (
            add_surroundings,
            check_model_of_deck,
        )

        foreign = check_model_of_deck(files, model.inventory) is not None
        files = add_surroundings(files, model.inventory)
        selection = complete_selection(files, selection, settings, model)
    parts: tuple[str, ...] = ()
    if card_alone and is_card_only(request, files):
        parts, selection = selection.parts, selection._replace(parts=())
    elif selection.parts:
        request.selection()  # An error is raised if the user names both an energy and parts.
    reference = Reference.of(files, selection)
    cautions: tuple[Caution, ...] = ()
    if model is not None:
        from d2rpick.choice.parts.deck_of_run import add_deck_to_settings

        settings, cautions = add_deck_to_settings(settings, reference, model)
        cautions = (*name_deck(request), *cautions)
    question = RunQuestion(
        run,
        request,
        reference,
        selection,
        settings,
        model,
        parts,
        cautions,
        of_this_run=not foreign,
    )
    if merge is None:
        return question
    return _merge_parts(question._replace(merge=merge), merge)


def read_cost_model(request: Request) -> CostModel | None:
    """Read the deck with its weights, or only the weights; None if neither is requested.

    Raises
    ------
    DeckError, ConfigurationError
        If the deck or the weights cannot be read.
    """
    if request.deck is None:
        return None
    from d2rpick.choice.parts.cost import CostModel, read_weights
    from d2rpick.deck import read_inventory

    weights = request.weights
    return CostModel(
        read_inventory(request.deck),
        read_weights(weights) if isinstance(weights, str) else weights,
    )


def complete_selection(
    run: histories.OpenedRun, selection: Selection, settings: Settings, model: CostModel
) -> Selection:
    """Add the recommended set, and the springs of the deck that have energies, to the selected parts.

    Raises
    ------
    FormatError
        If no set can be recommended.
    """
    from d2rpick.choice.parts.deck_of_run import check_model_of_deck
    from d2rpick.choice.parts.sets_of_parts import recommend_parts

    if foreign := check_model_of_deck(run, model.inventory):
        if has_recommended(selection.parts, run.parts):
            raise FormatError(
                f"{run.name}: no set of parts can be recommended: {foreign.message}, or the parts"
            )
        return selection
    springs = {part.id for part in run.springs} | model.inventory.springs
    parts = selection.parts
    if has_recommended(parts, run.parts):
        parts = tuple(map(str, recommend_parts(run, settings, model)))
    return selection._replace(parts=parts, springs=tuple(map(str, sorted(springs))))


def _check_recommended(request: Request, run: histories.OpenedRun) -> None:
    """Refuse the recommended set if other parts are named as well, or if there is no deck."""
    if has_recommended(request.part, run.parts):
        if len(request.part) > 1:
            raise ArgumentError(
                "`parts` recommended is a whole set; leave out the other `parts`"
            )
        if request.deck is None:
            raise ArgumentError(
                "`parts` recommended needs `deck`, the main deck of the run"
            )


def _merge_parts(question: RunQuestion, merge: int) -> RunQuestion:
    """Treat the parts as one rigid body, and add a caution if they are not connected."""
    from d2rpick.choice.parts.deck_of_run import merge_into_one_body

    parts = question.reference.history.parts
    if not parts:
        return question
    cautions = question.cautions
    bodies = question.settings.bodies or ()
    if len(bodies) > 1:
        apart = list_names([name_units(body.parts) for body in bodies], between="; ")
        message = f"--merge {merge} makes one rigid body of unconnected parts: {apart}"
        cautions = (
            *cautions,
            Caution("merged-apart", f"{message}; leave it out to keep them apart"),
        )
    body = merge_into_one_body({part.id for part in parts} | {merge}, bodies)
    return question._replace(
        settings=replace(question.settings, bodies=(body,)), cautions=cautions
    )
