"""Model the cost of a time step, and the fraction of the cost that is saved while selected parts are rigid.

A time step costs C = E / s. E is the sum of weight x number over the formulations of the computed elements, plus that
over their integration points through the thickness. s is the fraction of the cost of a time step that is due to
elements; the rest is due to assembly, contact and output. While parts are one rigid body, their elements cost nothing
and each of its n nodes costs r, so the saved fraction is

    c = (E_rigid - r n) / C.

If the parts are rigid for a fraction f of the run, the run time is 1 - f (1 - (1 - c)/m) times that without switching;
m is the time step while the parts are rigid divided by that before (`d2rpick.vibration.measures.run_time_share`).
"""

from __future__ import annotations

from collections import Counter
from dataclasses import field
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from d2rpick.base.caching import cached_property
from d2rpick.base.data_classes import dataclass
from d2rpick.base.errors import ConfigurationError, choose_verb, name_units
from d2rpick.histories.source import Source

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping

    from d2rpick.deck.model import Formulation, Inventory
    from d2rpick.deck.source import SourceFile

# Cost of an element per cycle [us]; each integration point of a shell after the first adds the cost "point".
# The element costs were fitted to OpenRadioss runs of a car with 1516 elements (docs/reference/cost-model.md).
# The costs of beams and springs are less accurate than the costs of other elements.
POINT: Final = "point"
MEASURED: Final[Mapping[str, float]] = {
    "QBAT": 0.58, "QEPH": 0.36, "BT": 0.21, "beam": 0.30, "solid": 1.3, "spring": 0.3, POINT: 0.11,
}  # fmt: skip
# Fraction of the cost of a deformable step that is due to elements, including assembly, contact and output [-].
ELEMENT_SHARE: Final = 0.91
# Cost per rigid-body node and cycle [us], fitted to the same runs as the element costs.
RIGID_NODE: Final = 0.04
_SOURCE: Final = "OpenRadioss 2026-08, one thread"
# Upper limit of a cost, which keeps sums over all elements finite. Real costs are far smaller in any unit.
_LARGEST: Final = 1e100

# Keys with a numerical value in the TOML file of weights that ``d2rpick calibrate`` writes.
_NUMBERS: Final = ("element_share", "rigid_node")
_KEYS: Final = (*_NUMBERS, "per_element", "source")


@dataclass(frozen=True)
class Weights:
    """Cost per element and cycle by formulation or class, cost per rigid-body node, and element fraction of a step.

    Only the ratios of costs matter; all costs have the unit of ``per_element``. ``file`` is the file from which the
    weights were read; None if there is no such file.
    """

    per_element: Mapping[str, float] = field(default_factory=lambda: MEASURED)
    element_share: float = ELEMENT_SHARE
    rigid_node: float = RIGID_NODE
    source: str = _SOURCE
    file: Source | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        """Raise ConfigurationError if a number is outside its range."""
        for name, value in self.per_element.items():
            _check_weight(f"the weight of {name!r}", value)
        if not any(self.per_element.values()):
            raise ConfigurationError(
                "no weight is above 0; give the cost of at least one formulation"
            )
        if not 0 < self.element_share <= 1:
            raise ConfigurationError(
                f"element_share is {self.element_share:g}, but a number above 0 and up to 1 was expected"
            )
        _check_weight("rigid_node", self.rigid_node)

    @cached_property
    def _scale_of_built_in(self) -> float:
        """Median ratio of these weights to the built-in weights of the same classes [-]; 0 if they share no class."""
        from statistics import median  # Imported here to keep start-up fast.

        common = [name for name in self.per_element if name in MEASURED]
        ratios = [self.per_element[name] / MEASURED[name] for name in common]
        return median(ratios) if ratios else 0.0

    def find_weight(self, formulation: Formulation) -> float | None:
        """Return the cost of an element; None if neither its formulation nor its cost class has a weight."""
        weight = self.per_element.get(formulation.name)
        if weight is None and formulation.cost is not None:
            weight = self.per_element.get(formulation.cost)
        return weight

    def scale_built_in_weight(self, formulation: Formulation) -> float | None:
        """Return the built-in cost of an element, scaled to these weights; None if one of them is unknown."""
        built_in = MEASURED.get(formulation.cost or "")
        if built_in is None or not self._scale_of_built_in:
            return None
        return built_in * self._scale_of_built_in


def _check_weight(name: str, value: float) -> None:
    """Raise ConfigurationError if a cost is negative or too large."""
    if not 0 <= value <= _LARGEST:
        raise ConfigurationError(
            f"{name} is {value:g}, but a number of at least 0 and at most {_LARGEST:g} was expected"
        )


def compute_saved_share(
    weights: Weights, total: float, rigid: float, nodes: int
) -> float:
    """Return the fraction of a step's cost that is saved while elements of total cost ``rigid`` are rigid [-].

    Parameters
    ----------
    weights : Weights
    total, rigid : float
        Costs of all elements, and of the rigid elements [unit of the weights].
    nodes : int
        Number of nodes of the rigid bodies.

    Examples
    --------
    >>> compute_saved_share(Weights({"BT": 1.0}, element_share=0.9, rigid_node=0.0), 100.0, 50.0, 60)
    0.45
    """
    if total:
        return max(
            0.0, (rigid - weights.rigid_node * nodes) * weights.element_share / total
        )
    return 0.0


class Amount(NamedTuple):
    """Cost of a set of elements in the unit of the weights, and those of their formulations that have no weight."""

    cost: float
    unknown: tuple[str, ...] = ()


class Share(NamedTuple):
    """Fraction of a step's cost that is saved while the parts are rigid [-]; None, with a reason, if it is unknown."""

    value: float | None
    reason: str | None = None


class ByDeck(NamedTuple):
    """Sources of the values from a deck: its files, and the weights (None if the user gave the cost fraction)."""

    files: tuple[SourceFile, ...]
    weights: Weights | None


class CostModel:
    """Cost model for the elements of a deck. Elements that are rigid from the start cost nothing."""

    def __init__(self, inventory: Inventory, weights: Weights | None = None) -> None:
        self.inventory = inventory
        self.weights = weights or Weights()
        self._rigid = inventory.rigid_parts

    def of_part(self, part: int) -> Amount:
        """Return the cost of the elements of a part."""
        return self._of(part, self.inventory.counts.get(part, Counter()))

    @cached_property
    def total(self) -> Amount:
        """Cost of all elements of the deck."""
        return _sum_amounts(self.of_part(part) for part in self.inventory.counts)

    def share_of(self, part: int) -> Share:
        """Return the cost of a part's elements as a fraction of the cost of all elements [-]."""
        cost_of_part = self.of_part(part)
        total = self.total
        return self._share(
            cost_of_part, cost_of_part.cost / total.cost if total.cost else 0.0
        )

    def saved(self, parts: Collection[int]) -> Share:
        """Return the step-cost fraction saved while ``parts`` are rigid [-]; unknown if the deck lacks a part."""
        absent = sorted(set(parts) - self.inventory.parts.keys())
        if absent:
            return Share(
                None, f"{name_units(absent)} {choose_verb(absent)} not in the deck"
            )
        elements = self.inventory.elements_within(parts)
        rigid = _sum_amounts(
            self._of(part, counts) for part, counts in elements.items()
        )
        total = self.total
        nodes = self.inventory.rigid_nodes(set(parts) - self._rigid)
        return self._share(
            rigid, compute_saved_share(self.weights, total.cost, rigid.cost, nodes)
        )

    @property
    def assumed(self) -> tuple[str, ...]:
        """Formulations in the deck that have no weight and are assumed to cost as much as similar formulations."""
        names: dict[str, None] = {}
        for part, counts in self.inventory.counts.items():
            if part in self._rigid:
                continue
            for kind in counts:
                formulation = self.inventory.formulation(part, kind)
                if formulation.cost is None or formulation.measured:
                    continue
                weights = self.weights.per_element
                if formulation.name not in weights and formulation.cost in weights:
                    names[formulation.name] = None
        return tuple(names)

    @property
    def built_in(self) -> tuple[str, ...]:
        """Formulations in the deck that the given weights lack, so that built-in weights are scaled for them."""
        formulations = [
            self.inventory.formulation(part, kind)
            for part, counts in self.inventory.counts.items()
            if part not in self._rigid
            for kind in counts
        ]
        names = {
            formulation.name: None
            for formulation in formulations
            if self.weights.find_weight(formulation) is None
            and self.weights.scale_built_in_weight(formulation) is not None
        }
        return tuple(names)

    def _of(self, part: int, counts: Mapping[str, int]) -> Amount:
        """Return the cost of elements of a part that are given as counts by class."""
        if part in self._rigid:
            return Amount(0.0)
        cost = 0.0
        unknown = list[str]()
        for kind, count in counts.items():
            formulation = self.inventory.formulation(part, kind)
            weight = self.weights.find_weight(formulation)
            if weight is None:
                weight = self.weights.scale_built_in_weight(formulation)
            if weight is None:
                unknown.append(formulation.name)
            else:
                points = self.inventory.further_points(part, kind)
                cost += (
                    weight + points * self.weights.per_element.get(POINT, 0.0)
                ) * count
        return Amount(cost, tuple(unknown))

    def _share(self, amount: Amount, value: float) -> Share:
        """Return the cost fraction ``value`` if all elements have weights; otherwise None, with the reason."""
        if not self.inventory.counts:
            return Share(None, "the deck has no elements")
        if not self.inventory.complete:
            if not self.inventory.notes:
                return Share(None)
            return Share(None, f"not all elements are known: {self.inventory.notes[0]}")
        unknown = sorted({*amount.unknown, *self.total.unknown})
        if unknown:
            names = ", ".join(unknown)
            if self.weights.file:
                lack = f"{self.weights.file.name} has no weight for {names}"
                return Share(None, f"{lack}; add one under [per_element]")
            return Share(
                None, f"no weight is known for {names}; give one with `weights`"
            )
        return Share(value)


def _sum_amounts(amounts: Iterable[Amount]) -> Amount:
    """Return the total cost, and the formulations that the sum omits because they have no weight."""
    cost = 0.0
    unknown = list[str]()
    for amount in amounts:
        cost += amount.cost
        unknown += amount.unknown
    return Amount(cost, tuple(dict.fromkeys(unknown)))


def read_weights(path: str) -> Weights:
    """Read weights from a TOML file. Defaults replace a missing element fraction or node cost.

    Raises
    ------
    ConfigurationError
        If the file cannot be read, has unknown keys, or has a number outside of its range.
    """
    import tomllib
    from pathlib import Path

    try:
        content = Path(path).read_bytes()
        values = tomllib.loads(content.decode("utf-8"))
    except (OSError, UnicodeDecodeError, ValueError, RecursionError) as error:
        is_binary = isinstance(error, UnicodeDecodeError)
        reason = getattr(error, "strerror", None) or error
        reason = "binary data" if is_binary else reason
        raise ConfigurationError(
            f"{path}: cannot be read ({reason}), but a TOML file of weights was expected; d2rpick calibrate writes one"
        ) from None
    unknown = [key for key in values if key not in _KEYS]
    if unknown:
        raise ConfigurationError(
            f"{path}: {unknown[0]!r} is not a key; expected {', '.join(_KEYS)}"
        )
    per_element = values.get("per_element")
    if not isinstance(per_element, dict) or not per_element:
        raise ConfigurationError(
            f"{path}: no table [per_element], but the cost of each formulation was expected there"
        )
    numbers: dict[str, Any] = {
        key: _parse_weight(path, key, values[key]) for key in _NUMBERS if key in values
    }
    weights = {
        name: _parse_weight(path, name, value) for name, value in per_element.items()
    }
    try:
        return Weights(
            weights,
            source=str(values.get("source", path)),
            file=Source(path, content),
            **numbers,
        )
    except ConfigurationError as error:
        raise ConfigurationError(f"{path}: {error}") from None


def format_weights_as_toml(weights: Weights) -> str:
    """Write weights as TOML.

    Examples
    --------
    >>> print(format_weights_as_toml(Weights({"BT": 0.3}, source="a run")))
    source = "a run"
    element_share = 0.91
    rigid_node = 0.04
    <BLANKLINE>
    [per_element]
    "BT" = 0.3
    """
    rows = [
        f"{_quote_for_toml(name)} = {value:.6g}"
        for name, value in weights.per_element.items()
    ]
    head = [
        f"source = {_quote_for_toml(weights.source)}",
        *(f"{name} = {getattr(weights, name):.6g}" for name in _NUMBERS),
    ]
    return "\n".join([*head, "", "[per_element]", *rows])


def _quote_for_toml(text: str) -> str:
    """Quote a string for use in a TOML file."""
    import json

    # JSON escapes would contain surrogate pairs, which TOML does not allow.
    return json.dumps(text, ensure_ascii=False)


def _parse_weight(path: str, name: str, value: object) -> float:
    """Return a value of a TOML file as a number, or raise ConfigurationError."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ConfigurationError(
            f"{path}: {name} is {value!r}, but a number was expected"
        )
    try:
        return float(value)
    # The integer has hundreds of digits and is too large for a float.
    except OverflowError:
        return float("inf")
