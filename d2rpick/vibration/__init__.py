"""What vibrates, and how?  The models, best first, and how those that tell a sign are looked for beside an oscillator.

A further one is a class in a module of its own, and here its name in `SignedModel`, what finds it in a record, and its
line in `MODELS`.  It has what `SignedParts` and `Swings` have alike: the methods of a `Deformation`, ``time`` (n,),
whether enough of the energy is ``signed``, what is known at a td, and words: what a choice rests on (``told``), that
the kinetic share "is what ..." (``kinetic``), and why a tr has no measures (``undescribed``).
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Final, Protocol, cast

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import TypeAlias

    from d2rpick.histories.history import History, Memory, Samples
    from d2rpick.vibration.modal import ModalVibration
    from d2rpick.vibration.part_signs import SignedParts
    from d2rpick.vibration.span import Span
    from d2rpick.vibration.swings import Swings


class Together(Protocol):
    """What vibrates together in a flight."""

    @property
    def complete(self) -> bool:
        """Whether the energy is that of all that vibrates together."""

    @property
    def kinetic(self) -> tuple[Samples, Samples] | None:
        """Its kinetic energy at times in the flight, without that of its fall, both (n,); None if not written."""


if TYPE_CHECKING:
    SignedModel: TypeAlias = SignedParts | ModalVibration | Swings
    Finder: TypeAlias = Callable[[History, Span, Together], SignedModel | None]


def _parts(history: History, within: Span, _: Together) -> SignedModel | None:
    """Read the signs of single parts, where their energies are written."""
    time = history.between(*within)[0]
    if history.part_energies is None or time.size < 3:
        return None
    from d2rpick.histories.samples import window
    from d2rpick.vibration.part_signs import SignedParts

    return SignedParts(
        time, history.part_energies[window(history.time, *within)], history.part_names
    )


def _modal(history: History, within: Span, together: Together) -> SignedModel | None:
    """Identify the modes of the structure from the lines of its energy, and of its kinetic energy if that is known."""
    if not together.complete:
        return None
    from d2rpick.vibration.modal import confirm, identify_modal

    internal, kinetic = identify_modal(*history.between(*within)), together.kinetic
    return confirm(
        internal, identify_modal(*kinetic, kinetic=True) if kinetic else None
    )


def _swings(history: History, within: Span, _: Together) -> SignedModel | None:
    """Count the swings of the energy, where they come down to a floor."""
    from d2rpick.vibration.swings import count_swings

    return count_swings(*history.between(*within))


# By what a choice is said to rest on; an oscillator, and the energy alone, are known of each td in another way.
MODELS: Final[dict[str, Finder | None]] = {
    "parts": _parts,
    "oscillator": None,
    "modal": _modal,
    "swings": _swings,
    "energy": None,
}


def find_models(
    history: History,
    around: Span,
    flight: Span | None,
    settled: Span | None,
    doubtful: Callable[[], bool],
    memory: Memory,
    together: Together,
) -> dict[str, SignedModel]:
    """Look for models, best first, until one tells the sign; those behind the oscillator where that is ``doubtful``.

    They are looked for ``around`` td, those behind the oscillator in the ``flight``, if one is known, and swings also
    before it, from when the energy has ``settled``.
    """
    found: dict[str, SignedModel] = {}
    within = around
    for basis, find in MODELS.items():
        if basis == "oscillator":
            if flight is None or not doubtful():
                break
            within = flight
        if basis == "swings" and settled is not None:
            within = settled
        if find and (
            model := memory.once(
                (basis, *within), partial(find, history, within, together)
            )
        ):
            found[basis] = model
            if model.signed and not _is_vague(model):
                break
    return _of_vague(found)


def _is_vague(model: SignedModel) -> bool:
    """Return whether modes leave so much open that counted swings, if there are any, say more."""
    from d2rpick.vibration.modal import ModalVibration

    return isinstance(model, ModalVibration) and model.is_vague


def _of_vague(found: dict[str, SignedModel]) -> dict[str, SignedModel]:
    """Rely on modes that are vague, or with a wide band on doubtful ones, if no other model tells the sign."""
    modal = cast("ModalVibration | None", found.get("modal"))
    if modal is None:
        return found
    swings = found.get("swings")
    if swings and swings.signed:
        return {basis: model for basis, model in found.items() if basis != "modal"}
    return found if modal.signed else found | {"modal": modal.as_last_resort()}
