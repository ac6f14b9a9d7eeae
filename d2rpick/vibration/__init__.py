"""Identify the vibration: find the models that describe it, with the best model first.

Every measure of a pair (tr, td) needs the deformations at both times and their relative direction (`measures`).  The
energy does not show the sign of a deformation, so a model must.  `span` and `find_models` look for one in this order,
and `model.model_at` decides which one can be relied on at a td:

1. oscillator (`identify`, `fitting`, `modes`, `span`): E = E_pl + (q_0 + q)^2 with q = exp(-alpha t/2) (a cos omega t
   + b sin omega t), the published floating oscillator (`oscillator`), fitted by least squares in the longest window
   around td in which it describes the record. It is refused if its misfit is not noise.
2. modal (`lines`, `refined_lines`, `midpoint`, `modal`, `modal_span`, `locked_lines`, `close_modes`): any number of
   modes. The energy halfway between tr and td gives the product of both deformations, X = V(m) - H(m)/2 + C(m, tau)/2,
   and thereby R^2 = 1 + [V(tr) - 2 X]/U(td); H and C follow from the lines of the energy.  Doubts refuse a record or
   widen the band of R.
3. swings (`swings`): the energy returns to its lower envelope in each half cycle; each minimum is a zero of the
   deformation, whatever the law of the spring.
4. energy: no sign is known; the candidates are the times at which the energy equals that at td (`moments`).

The modal model describes nearly every record. The others are kept because each is better for some records (figures:
docs/explanation/basis.md): the oscillator states R of a single mode ten times as accurately, and the user can give one;
counted half cycles show the direction for stiffening springs and for friction, for which the lines are refused or have
a wide band. The energies of several parts are added, since only their sum is the energy of a whole structure.

The lines of the kinetic energy (`flight.vibrating`) confirm those of the internal energy. They replace them if plastic
flow or the work of a damper hides the lines of the internal energy.

To add a model, write a class in a module of its own, add its name to `SignedModel` and `MODELS`, and call its finder in
`find_models`. The class has the methods of a `Deformation`, ``time`` (n,), ``signed`` (True if the model covers enough
of the energy), and three texts: what a choice is based on (``told``), how the kinetic share was obtained (``kinetic``),
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

    Half cycles are counted from the time at which the energy has ``settled`` [time], which may precede the flight.
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
    if internal is not None and internal.signed and internal.is_vague:
        # The load may end within the first output interval of the flight, and its rest is then read as many modes.
        times, _ = history.between(first, last)
        without_first_state = identify_window(history, Span(float(times[1]), last))
        if without_first_state is not None and (
            without_first_state.signed and not without_first_state.is_vague
        ):
            internal = without_first_state
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
