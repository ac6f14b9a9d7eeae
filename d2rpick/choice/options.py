"""Declare the choice options, each with its type, default, help, range and commands.

The options of the command line, the keyword arguments of Python and the settings of a choice all follow from the fields
of `ChoiceOptions`.  This module imports no numerics, since each command needs the table when it starts.
"""

from __future__ import annotations

from dataclasses import fields
from functools import cache
from typing import TYPE_CHECKING, Any, Final

from d2rpick.base.data_classes import dataclass
from d2rpick.base.options import (
    AT_LEAST_ONE,
    FRACTION,
    NOT_NEGATIVE,
    TIME,
    make_option,
)
from d2rpick.base.tuples import NamedTuple
from d2rpick.choice.pair.grades import GRADES

if TYPE_CHECKING:
    from collections.abc import Iterator


# Names used in messages for quantities whose names differ from their keys.
_QUANTITIES: Final = {"kinetic_share": "kinetic fraction"}
# Help for ``min_quality``, to which each command appends its default.
MIN_QUALITY: Final = "Exit with 1 if the grade is lower than this (poor: do not use, fair: use with care, good: use)."


class Limit(NamedTuple):
    """A limit that a recommended pair must meet. An unknown value does not meet it.

    ``quantity`` is a column of judged candidates, or an attribute of the situation at td.  If ``is_lower`` is True, the
    value must not be below the limit, otherwise not above it.  If ``is_of_vibration`` is True, a flight in which
    nothing vibrates meets the limit.
    """

    quantity: str
    is_lower: bool = False
    is_of_vibration: bool = False

    def is_kept_by(self, values: Any, limit: float) -> Any:
        """Return True for each of the ``values`` that meets the limit; an unknown value (NaN) does not meet it.

        Examples
        --------
        >>> Limit("residual").is_kept_by(0.3, 0.2), Limit("rigid_time", is_lower=True).is_kept_by(0.3, 0.2)
        (False, True)
        """
        return values >= limit if self.is_lower else values <= limit

    def explain(self, value: float | None, limit: float) -> str:
        """Return the message that a value exceeds the limit or is unknown.

        Examples
        --------
        >>> Limit("residual").explain(0.31416, 0.2)
        'residual 0.314 above the limit 0.2'
        >>> Limit("rigid_time", is_lower=True).explain(0.012, 0.02)
        'rigid time 0.012 below the limit 0.02'
        """
        # Imported here to keep start-up fast.
        from d2rpick.histories.digits import format_beyond_limit

        name = _QUANTITIES.get(self.quantity, self.quantity.replace("_", " "))
        if value is None:
            bound = "at least" if self.is_lower else "at most"
            return f"{name} unknown, {bound} {limit:g} was asked for"
        side = "below" if self.is_lower else "above"
        return f"{name} {format_beyond_limit(value, limit)} {side} the limit {limit:g}"


class Use(NamedTuple):
    """The use of an option for choosing times: the commands and functions that have it, and the limit that it sets.

    ``limit`` is the `Limit` that the value of the option sets; None if the option is not a limit. If ``of_cards`` is
    True, ``card`` and ``check --history`` also have the option, and if ``of_sets`` is True, ``parts`` and ``study``
    also have it. If ``is_advanced`` is True, the last section of the help lists the option.
    """

    limit: Limit | None = None
    of_cards: bool = False
    of_sets: bool = True
    is_advanced: bool = False


def _describe_use(**use: Any) -> dict[str, Use]:
    """Return metadata of a dataclass field that describe how an option is used."""
    return {"use": Use(**use)}


@dataclass(frozen=True, init=False, eq=False, repr=False, kw_only=True)
class ChoiceOptions:
    """The options that define how a pair is chosen and judged; times have the unit of the history.

    An option that limits recommendations has a ``limit``. Suggest, verify, explore, plan, study, check and card
    then refuse each pair that exceeds the limit, state this, and exclude such pairs from the windows.
    """

    after: float | None = make_option(
        "End of the load.  [default: found from the record]",
        TIME,
        "T",
        metadata=_describe_use(of_cards=True),
    )
    landing: float | None = make_option(
        "Time of the next contact after the flight; td is at least one margin earlier.  "
        "[default: found from the record]",
        TIME,
        "T",
        metadata=_describe_use(of_cards=True),
    )
    margin: float | None = make_option(
        "Time kept free after the load and before the next contact.  [default: after the load, none; before the "
        "contact, from the flight and the vibration, or none with `td` but without `landing`]",
        NOT_NEGATIVE,
        "T",
        metadata=_describe_use(of_cards=True),
    )
    tolerance: float = make_option(
        "Largest allowed frozen-deformation error or, with the basis energy, largest allowed level error. Not used "
        "with the basis modal.",
        FRACTION,
        "L",
        default=0.2,
        metadata=_describe_use(of_cards=True),
    )
    max_kinetic_share: float | None = make_option(
        "Reject a td at which a larger fraction of the vibration energy is kinetic.",
        NOT_NEGATIVE,
        "K",
        metadata=_describe_use(
            limit=Limit("kinetic_share", is_of_vibration=True), of_cards=True
        ),
    )
    max_residual: float | None = make_option(
        "Reject a pair with a larger residual.",
        NOT_NEGATIVE,
        "R",
        metadata=_describe_use(
            limit=Limit("residual", is_of_vibration=True), of_cards=True
        ),
    )
    fit_window: tuple[float, float] | None = make_option(
        "Time range to which the oscillator is fitted.",
        TIME,
        "LO HI",
        pair=True,
        instead_of=("stiffness", "no_verify"),
        metadata=_describe_use(is_advanced=True),
    )
    strict: bool = make_option(
        "Recommend no pair if the end of the load is known from the energy alone.",
        "flag",
        default=False,
        metadata=_describe_use(),
    )
    keep_vibration: bool = make_option(
        "Grade the vibration by its residual alone, even if the next contact has far more energy than the error.",
        "flag",
        default=False,
        metadata=_describe_use(),
    )
    min_quality: str | None = make_option(
        f"{MIN_QUALITY}  [default: fair]",
        GRADES,
        metadata=_describe_use(of_cards=True, of_sets=False),
    )
    cost_share: float | None = make_option(
        "Fraction of the CPU time per time step that is saved while the parts are rigid; used to predict the saving.",
        FRACTION,
        "C",
        metadata=_describe_use(of_sets=False, is_advanced=True),
    )
    # Rigid elements do not limit the time step, so the step cannot be smaller than that of the deformable run.
    step_ratio: float | None = make_option(
        "Time step while the parts are rigid, divided by the time step before; at least 1.  [default: 1]",
        AT_LEAST_ONE,
        "N",
        metadata=_describe_use(of_sets=False, is_advanced=True),
    )

    @property
    def limits(self) -> Iterator[tuple[Limit, float]]:
        """Yield each limit of a recommendation that the user has set, with its value."""
        for name, use in list_uses().items():
            value = getattr(self, name)
            if use.limit is not None and value is not None:
                yield use.limit, value


@cache
def list_uses() -> dict[str, Use]:
    """Return how each choice option is used, keyed by option name."""
    return {entry.name: entry.metadata["use"] for entry in fields(ChoiceOptions)}
