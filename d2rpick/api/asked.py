"""What is asked about a run, with what its deck adds: the same for every answer, and as on the command line."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.api import arguments
from d2rpick.api.repeat import asking

if TYPE_CHECKING:
    from typing import Any

    from d2rpick.api.arguments import Choosing, Parts
    from d2rpick.api.runs import Run
    from d2rpick.choice.cost import CostModel, Weights
    from d2rpick.choice.of_run import Reference
    from d2rpick.choice.settings import Settings
    from d2rpick.choice.warnings import Caution
    from d2rpick.histories.names import Selection

# Stands for a file that there is not: typed as it is, the command line is refused instead of taking other weights.
_IN_MEMORY: Final = "<weights in memory>"


class Asked(NamedTuple):
    """Which energy of a run is meant and how it is judged; ``cautions`` are what the deck left unknown.

    ``options`` follow the times in the command line that asks the same.
    """

    reference: Reference
    selection: Selection
    settings: Settings
    cautions: tuple[Caution, ...]
    options: tuple[str, ...]


def asked_of(
    run: Run,
    parts: Parts | None,
    flying: Parts | None,
    deck: arguments.Path | None,
    weights: Weights | arguments.Path | None,
    choosing: Choosing,
) -> Asked:
    """Check the arguments, then read the deck and the energy that is meant.

    Raises
    ------
    D2RPickError
        If the run has no such parts or energy, or the deck or the weights cannot be read.
    TypeError, ValueError
        If an argument is not of its kind.
    """
    from d2rpick.choice.of_run import Reference
    from d2rpick.flight.flying_parts import asks_for_recommended

    settings = arguments.settings(choosing, with_deck=deck is not None)
    chosen = selection_for(run, parts, flying)
    if asks_for_recommended(chosen.parts, run.files):
        if len(chosen.parts) > 1:
            raise ValueError("parts names the recommended set and others; it stands for a whole set")
        if deck is None:
            raise ValueError("parts is 'recommended', which needs deck, the main deck of the run")
    model, options = model_of(deck, weights)
    options = (*options, *asking(run, chosen, choosing))
    if model is None:
        return Asked(Reference.of(run.files, chosen), chosen, settings, (), options)
    from d2rpick.choice.by_deck import selected, with_deck
    from d2rpick.choice.deck_of_run import in_deck

    files = in_deck(run.files, model.inventory)
    selection = selected(files, chosen, settings, model)
    reference = Reference.of(files, selection)
    settings, unknown = with_deck(settings, reference, model)
    return Asked(reference, selection, settings, unknown, options)


def selection_for(run: Run, parts: Parts | None, flying: Parts | None) -> Any:
    """Add the parts to the columns that were named when the run was read."""
    check_run(run)
    names = arguments.part_names("parts", parts)
    if names and run.chosen.energy:
        raise ValueError("parts and the energy that was named when the run was read exclude each other")
    return run.chosen._replace(parts=names, flying=arguments.part_names("flying", flying))


def check_run(run: Run, name: str = "run") -> None:
    """Raise TypeError for what is not a run that was read."""
    if not hasattr(run, "files"):
        raise TypeError(f"{name} is {run!r}, what read() or from_frame() gives was expected")


def model_of(
    deck: arguments.Path | None, weights: Weights | arguments.Path | None
) -> tuple[CostModel | None, tuple[str, ...]]:
    """Read a deck with its weights, None without one; and give the options that name them."""
    if deck is None:
        if weights is not None:
            raise ValueError("weights needs a deck, whose elements are weighted")
        return None, ()
    from d2rpick.choice.by_deck import read_model
    from d2rpick.choice.cost import Weights

    main = _one_path("deck", deck)
    if weights is None:
        return read_model(main), ("--deck", main)
    if isinstance(weights, Weights):
        return read_model(main, weights), ("--deck", main, "--weights", _IN_MEMORY)
    file = _one_path("weights", weights)
    return read_model(main, file), ("--deck", main, "--weights", file)


def _one_path(name: str, value: arguments.Path) -> str:
    found = arguments.paths(name, value)
    if len(found) > 1:
        raise ValueError(f"{name} names {len(found)} files, one was expected")
    return found[0]
