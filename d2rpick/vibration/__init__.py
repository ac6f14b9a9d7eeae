"""Identify the vibration: find the models that describe it, with the best model first.

Every measure of a pair (tr, td) needs the deformations at both times and their relative direction (`measures`).  The
energy does not show the sign of a deformation, so a model must.  `span` and `find_models` look for one in this order,
and `model.model_at` decides which one can be relied on at a td:

1. oscillator (`identify`, `fitting`, `modes`, `span`): E = E_pl + (q_0 + q)^2 with q = exp(-alpha t/2) (a cos omega t
   + b sin omega t), the published floating oscillator (`oscillator`), fitted by least squares in the longest window
   around td in which it describes the record.  Systematic structure in the rest refuses it.
2. modal (`lines`, `refined_lines`, `midpoint`, `modal`, `modal_span`, `locked_lines`, `close_modes`): any number of
   modes.  The energy halfway
   between tr and td gives the product of both deformations, X = V(m) - H(m)/2 + C(m, tau)/2, and with it
   R^2 = 1 + [V(tr) - 2 X]/U(td); H and C follow from the lines of the energy.  Doubts refuse a record or widen
   the band of R.
3. swings (`swings`): the energy comes down to its floor in each swing; each minimum is a zero of the deformation,
   whatever the law of the spring.
4. energy: no sign is known; times at which the energy has the level of td remain (`moments`).

The modal model describes nearly every record.  The others stay because each is better somewhere (figures:
docs/explanation/basis.md): the oscillator states R of one mode ten times as accurately, and can be given; counted
swings know the direction for springs that stiffen and for friction, where lines are refused or wide.  Energies of
several parts are added, since only their sum is the energy of a whole structure.

Lines of the kinetic energy (`flight.vibrating`) confirm those of the internal energy, or replace them where plastic
flow or a damper's work hides these.

A further model is a class in a module of its own, its name in `SignedModel` and `MODELS`, and its finder in
`find_models`.  It has the methods of a `Deformation`, ``time`` (n,), ``signed`` (True if it covers enough of the
energy), what is known at a td, and words: what a choice rests on (``told``), what the kinetic share is (``kinetic``),
and why a tr has no measures (``undescribed``).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, Protocol, cast

from d2rpick.base.memory import remember

if TYPE_CHECKING:
    from typing import TypeAlias

    from d2rpick.histories.history import History, Samples
    from d2rpick.vibration.modal import ModalVibration
    from d2rpick.vibration.span import Span
    from d2rpick.vibration.swings import Swings

# Names of the models, with the best model first.
MODELS: Final = ("oscillator", "modal", "swings", "energy")


class VibratingTogether(Protocol):
    """The chosen parts and all parts that vibrate together with them in a flight."""

    @property
    def complete(self) -> bool:
        """Return True if the energy includes all parts that vibrate together."""

    @property
    def kinetic(self) -> tuple[Samples, Samples] | None:
        """Return times [time] and kinetic vibration energies [energy] in the flight, shape (n,); None if unknown."""


if TYPE_CHECKING:
    SignedModel: TypeAlias = ModalVibration | Swings


def find_models(
    history: History, flight: Span, settled: Span, *, together: VibratingTogether
) -> dict[str, SignedModel]:
    """Search a ``flight`` for models of the energy, best model first, until a model gives the sign of the deformation.

    Swings are counted in the flight from when the energy has ``settled``, which may be before it.
    """
    from d2rpick.histories.samples import get_ends

    models: dict[str, SignedModel] = {}
    ends = get_ends(history.between(*flight)[0])
    modal = _find_modal(history, *ends, together=together) if ends else None
    if modal is not None:
        models["modal"] = modal
        # If the modes are very uncertain, the model that counts half cycles of the energy may be more accurate.
        if modal.signed and not modal.is_vague:
            return _rely_on_vague(models)
    ends = get_ends(history.between(*settled)[0])
    swings = _find_swings(history, *ends) if ends else None
    if swings is not None:
        models["swings"] = swings
    return _rely_on_vague(models)


@remember
def _find_modal(
    history: History, first: float, last: float, *, together: VibratingTogether
) -> ModalVibration | None:
    """Identify the modes of the structure from the spectral lines of its internal and (if known) kinetic energy."""
    if not together.complete:
        return None
    from d2rpick.vibration.modal import confirm_by_kinetic_energy, identify_modal
    from d2rpick.vibration.modal_span import identify_window
    from d2rpick.vibration.span import Span

    internal = identify_window(history, Span(first, last))
    kinetic = together.kinetic
    return confirm_by_kinetic_energy(
        internal, identify_modal(*kinetic, kinetic=True) if kinetic else None
    )


@remember
def _find_swings(history: History, first: float, last: float) -> Swings | None:
    """Count the half cycles of an energy that returns to a common minimum in each half cycle."""
    from d2rpick.vibration.swings import count_swings

    return count_swings(*history.between(first, last))


def _rely_on_vague(found: dict[str, SignedModel]) -> dict[str, SignedModel]:
    """Use uncertain modes, with a wide error band, only if no other model gives the sign of the deformation."""
    modal = cast("ModalVibration | None", found.get("modal"))
    if modal is None:
        return found
    swings = found.get("swings")
    if swings and swings.signed:
        return {basis: model for basis, model in found.items() if basis != "modal"}
    return found if modal.signed else found | {"modal": modal.as_last_resort()}
