"""Identify the vibration: find the models that describe it, best first.

Every measure of a pair (tr, td) needs the deformations at both times and how they lie to each other (`measures`).  The
energy does not show the sign of a deformation, so a model must.  `find_models` looks for them in this order, and
`model.model_at` decides which one can be relied on at a td:

1. parts (`part_signs`, `waves`): the deformation of each part with its sign, from the zeros of its own energy,
   confirmed by a few damped waves; E = q^2 for each part.
2. oscillator (`identify`, `fitting`, `modes`, `span`): E = E_pl + (q_0 + q)^2 with q = exp(-alpha t/2) (a cos omega t
   + b sin omega t), the published floating oscillator (`oscillator`), fitted by least squares in the longest window
   around td in which it describes the record.  Systematic structure in the rest refuses it.
3. modal (`lines`, `midpoint`, `modal`, `modal_span`, `locked_lines`): any number of modes.  The energy halfway
   between tr and td gives the product of both deformations, X = V(m) - H(m)/2 + C(m, tau)/2, and with it
   R^2 = 1 + [V(tr) - 2 X]/U(td); H and C follow from the lines of the energy.  Doubts refuse a record or widen
   the band of R.
4. swings (`swings`): the energy comes down to its floor in each swing; each minimum is a zero of the deformation,
   whatever the law of the spring.
5. energy: no sign is known; times at which the energy has the level of td remain (`moments`).

Lines of the kinetic energy (`flight.vibrating`) confirm those of the internal energy, or replace them where plastic
flow or a damper's work hides these.

A further model is a class in a module of its own, its name in `SignedModel`, its finder, and its line in `MODELS`.  It
has the methods of a `Deformation`, ``time`` (n,), ``signed`` (True if it covers enough of the energy), what is known at
a td, and words: what a choice rests on (``told``), what the kinetic share is (``kinetic``), and why a tr has no
measures (``undescribed``).
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


class VibratingTogether(Protocol):
    """The chosen parts and all parts that vibrate with them in a flight."""

    @property
    def complete(self) -> bool:
        """Return True if the energy is that of all parts that vibrate together."""

    @property
    def kinetic(self) -> tuple[Samples, Samples] | None:
        """Return times and kinetic energies of the vibration in the flight, without the fall (n,); None if unknown."""


if TYPE_CHECKING:
    SignedModel: TypeAlias = SignedParts | ModalVibration | Swings
    Finder: TypeAlias = Callable[
        [History, Span, VibratingTogether, Memory], SignedModel | None
    ]


def _find_parts(
    history: History, within: Span, _: VibratingTogether, __: Memory
) -> SignedModel | None:
    """Determine the signs of single parts if their energies are written."""
    time = history.between(*within)[0]
    if history.part_energies is None or time.size < 3:
        return None
    from d2rpick.histories.samples import find_window
    from d2rpick.vibration.part_signs import SignedParts

    return SignedParts(
        time,
        history.part_energies[find_window(history.time, *within)],
        history.part_names,
    )


def _find_modal(
    history: History, within: Span, together: VibratingTogether, memory: Memory
) -> SignedModel | None:
    """Identify the modes of the structure from the lines of its energy, and of its kinetic energy if written."""
    if not together.complete:
        return None
    from d2rpick.vibration.modal import confirm_by_kinetic_energy, identify_modal
    from d2rpick.vibration.modal_span import identify_window

    internal = identify_window(history, within, memory)
    kinetic = together.kinetic
    return confirm_by_kinetic_energy(
        internal, identify_modal(*kinetic, kinetic=True) if kinetic else None
    )


def _find_swings(
    history: History, within: Span, _: VibratingTogether, __: Memory
) -> SignedModel | None:
    """Count the oscillations of the energy, provided that they return to a common minimum."""
    from d2rpick.vibration.swings import count_swings

    return count_swings(*history.between(*within))


# Models by name, with the function that finds each.
# The function is None for models that are found for each td in another way.
MODELS: Final[dict[str, Finder | None]] = {
    "parts": _find_parts,
    "oscillator": None,
    "modal": _find_modal,
    "swings": _find_swings,
    "energy": None,
}


def find_models(
    history: History,
    around: Span,
    flight: Span | None,
    settled: Span | None,
    doubtful: Callable[[], bool],
    memory: Memory,
    together: VibratingTogether,
) -> dict[str, SignedModel]:
    """Find models, best first, until one gives the sign; after the oscillator only if it is ``doubtful``.

    The window ``around`` td is used, for models after the oscillator the ``flight`` if one is known, and for swings
    also the time before it, from when the energy has ``settled``.
    """
    from d2rpick.histories.samples import get_ends

    models: dict[str, SignedModel] = {}
    span = around
    for basis, find in MODELS.items():
        if basis == "oscillator":
            if flight is None or not doubtful():
                break
            span = flight
        if basis == "swings" and settled is not None:
            span = settled
        if find is None:
            continue
        model = memory.once(
            (basis, *get_ends(history.between(*span)[0])),
            partial(find, history, span, together, memory),
        )
        if model is not None:
            models[basis] = model
            if model.signed and not _is_vague(model):
                break
    return _rely_on_vague(models)


def _is_vague(model: SignedModel) -> bool:
    """Return True if the modes are so uncertain that counted oscillations, if there are any, are better."""
    from d2rpick.vibration.modal import ModalVibration

    return isinstance(model, ModalVibration) and model.is_vague


def _rely_on_vague(found: dict[str, SignedModel]) -> dict[str, SignedModel]:
    """Use vague or doubtful modes, with a wide band, only if no other model gives the sign."""
    modal = cast("ModalVibration | None", found.get("modal"))
    if modal is None:
        return found
    swings = found.get("swings")
    if swings and swings.signed:
        return {basis: model for basis, model in found.items() if basis != "modal"}
    return found if modal.signed else found | {"modal": modal.as_last_resort()}
