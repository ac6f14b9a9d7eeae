"""Weights of a site: a TOML file that is written by ``calibrate`` and read with ``weights``."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any, Final

from d2rpick.choice.cost import Weights
from d2rpick.errors import ConfigurationError
from d2rpick.histories.source import Source

_NUMBERS: Final = ("element_share", "rigid_node")
_KEYS: Final = (*_NUMBERS, "per_element", "source")


def read_weights(path: str) -> Weights:
    """Read weights; what the file does not say of the share and of rigid nodes is as measured.

    Raises
    ------
    ConfigurationError
        If the file cannot be read, has unknown keys, or a number that makes no sense.
    """
    try:
        content = Path(path).read_bytes()
        found = tomllib.loads(content.decode("utf-8"))
    except (OSError, UnicodeDecodeError, ValueError, RecursionError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ConfigurationError(f"{path}: cannot be read ({reason}), a TOML file of weights was expected") from None
    if unknown := [key for key in found if key not in _KEYS]:
        raise ConfigurationError(f"{path}: {unknown[0]!r} is not a key; expected {', '.join(_KEYS)}")
    per_element = found.get("per_element")
    if not isinstance(per_element, dict) or not per_element:
        raise ConfigurationError(f"{path}: no table [per_element], the cost of each formulation was expected there")
    given: dict[str, Any] = {key: _number(path, key, found[key]) for key in _NUMBERS if key in found}
    weights = {name: _number(path, name, value) for name, value in per_element.items()}
    try:
        return Weights(weights, source=str(found.get("source", path)), file=Source(path, content), **given)
    except ConfigurationError as error:
        raise ConfigurationError(f"{path}: {error}") from None


def written(weights: Weights) -> str:
    """Write weights as TOML.

    Examples
    --------
    >>> print(written(Weights({"BT": 0.3}, source="a run")))
    source = "a run"
    element_share = 0.91
    rigid_node = 0.04
    <BLANKLINE>
    [per_element]
    "BT" = 0.3
    """
    rows = [f"{_quoted(name)} = {value:.6g}" for name, value in weights.per_element.items()]
    head = [f"source = {_quoted(weights.source)}", *(f"{name} = {getattr(weights, name):.6g}" for name in _NUMBERS)]
    return "\n".join([*head, "", "[per_element]", *rows])


def _quoted(text: str) -> str:
    import json

    return json.dumps(text, ensure_ascii=False)  # TOML has no pairs of surrogates


def _number(path: str, name: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ConfigurationError(f"{path}: {name} is {value!r}, a number was expected")
    try:
        return float(value)
    except OverflowError:  # an integer of hundreds of digits
        return float("inf")
