"""Configuration of the deck check: ``d2rpick.toml`` or ``[tool.d2rpick]`` of pyproject.toml, the nearest wins."""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import ConfigurationError

if TYPE_CHECKING:
    from pathlib import Path

_OWN, _SHARED = "d2rpick.toml", "pyproject.toml"
_SEVERITIES: Final = ("error", "warning", "info")
_KEYS: Final = ("select", "ignore", "severity")


@dataclass(frozen=True)
class Configuration:
    """Which rules count, by id or its beginning (``D2R1``), and what weight single rules have.

    ``ignore`` is stronger than ``select``; an empty ``select`` means all.  ``source`` names their file.

    Examples
    --------
    >>> configuration = Configuration(select=("D2R1",), ignore=("D2R104",))
    >>> [configuration.selects(rule) for rule in ("D2R001", "D2R101", "D2R104")]
    [False, True, False]
    """

    select: tuple[str, ...] = ()
    ignore: tuple[str, ...] = ()
    severity: Mapping[str, str] = field(default_factory=dict)
    source: str = ""

    def selects(self, rule: str) -> bool:
        """Whether a rule counts."""
        chosen = not self.select or rule.startswith(self.select)
        return chosen and not (self.ignore and rule.startswith(self.ignore))

    def verify(self, known: Collection[str]) -> None:
        """Raise ConfigurationError for a rule that does not exist; near misses are named."""
        where = f"{self.source}: " if self.source else ""
        for name in (*self.select, *self.ignore, *self.severity):
            exact = name in self.severity and name not in (*self.select, *self.ignore)
            if name in known or (not exact and name and any(rule.startswith(name) for rule in known)):
                continue
            raise ConfigurationError(f"{where}no rule {name!r}, {expected_instead(name, known)}")


def expected_instead(name: str, known: Collection[str]) -> str:
    """What would have been a rule; the nearest one is named."""
    near = difflib.get_close_matches(name.upper(), known, n=1)
    return "an id like D2R101 or its beginning was expected" + (f"; did you mean {near[0]}?" if near else "")


def find_configuration(folder: Path) -> Configuration:
    """Look for a configuration in ``folder`` and above; in a folder, d2rpick.toml counts before pyproject.toml."""
    for place in (folder.absolute(), *folder.absolute().parents):
        own, shared = place / _OWN, place / _SHARED
        if own.is_file():
            return read_configuration(_load(own), str(own))
        if shared.is_file():
            tools = _load(shared).get("tool")
            if isinstance(tools, Mapping) and "d2rpick" in tools:
                return read_configuration(tools["d2rpick"], str(shared))
    return Configuration()


def read_configuration(table: object, source: str = "") -> Configuration:
    """Configuration from a table as TOML gives it; ConfigurationError names what is wrong with it."""
    if not isinstance(table, Mapping):
        raise ConfigurationError(f"{source}: the configuration is {table!r}, a table was expected")
    for key in table:
        if key not in _KEYS:
            near = difflib.get_close_matches(key, _KEYS, n=1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise ConfigurationError(f"{source}: unknown key {key!r}, one of {', '.join(_KEYS)} was expected{hint}")
    severity = table.get("severity", {})
    if not isinstance(severity, Mapping):
        raise ConfigurationError(
            f"{source}: severity is {severity!r}, a table like {{D2R104 = 'warning'}} was expected"
        )
    for rule, value in severity.items():
        if value not in _SEVERITIES:
            raise ConfigurationError(
                f"{source}: severity of {rule} is {value!r}, one of {', '.join(_SEVERITIES)} expected"
            )
    return Configuration(_names(table, "select", source), _names(table, "ignore", source), dict(severity), source)


def _names(table: Mapping[str, object], key: str, source: str) -> tuple[str, ...]:
    value = table.get(key, [])
    if not isinstance(value, list) or not all(isinstance(name, str) for name in value):
        raise ConfigurationError(f"{source}: {key} is {value!r}, a list of rule ids was expected")
    return tuple(value)


def _load(path: Path) -> dict[str, object]:
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
        repr(table)  # as a message may show it: Python refuses to write numbers of thousands of digits, or to read them
    except (ValueError, OSError, RecursionError) as error:
        raise ConfigurationError(f"{path}: {error}; valid TOML was expected") from None
    return table
