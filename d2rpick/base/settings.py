"""The file of settings nearest to a folder: ``d2rpick.toml``, or ``[tool.d2rpick]`` of pyproject.toml."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import ConfigurationError

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable
    from pathlib import Path

_OWN, _SHARED = "d2rpick.toml", "pyproject.toml"
RULE_KEYS: Final = ("select", "ignore", "severity")  # of the deck check, which takes them from beside each deck


def nearest_settings(folder: Path) -> tuple[Mapping[str, object], str]:
    """Find the settings for a folder there or above; in a folder, d2rpick.toml counts before pyproject.toml.

    Returns
    -------
    table : Mapping
        The settings; empty where there are none.
    source : str
        Their file, or nothing.

    Raises
    ------
    ConfigurationError
        If the file is no TOML, or holds no table of settings.
    """
    for place in (folder.absolute(), *folder.absolute().parents):
        own, shared = place / _OWN, place / _SHARED
        found: object = None
        if own.is_file():
            found, source = _load(own), own
        elif shared.is_file():
            tools = _load(shared).get("tool")
            found, source = tools.get("d2rpick") if isinstance(tools, Mapping) else None, shared
        if isinstance(found, Mapping):
            return found, str(source)
        if found is not None:
            raise ConfigurationError(f"{source}: the configuration is {found!r}, a table was expected")
    return {}, ""


def refuse_unknown(names: Iterable[str], known: Collection[str], source: str) -> None:
    """Raise ConfigurationError for the first key that is not ``known``; the nearest one is named."""
    for name in names:
        if name not in known:
            import difflib  # mostly nothing is unknown

            near = difflib.get_close_matches(name, known, n=1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise ConfigurationError(f"{source}: unknown key {name!r}, one of {', '.join(known)} was expected{hint}")


def _load(path: Path) -> dict[str, object]:
    """Read TOML; a pyproject.toml that nowhere names d2rpick is not looked into."""
    try:
        text = path.read_text(encoding="utf-8")
        if path.name == _SHARED and "d2rpick" not in text:
            return {}
        import tomllib

        table = tomllib.loads(text)
        repr(table)  # as a message may show it: Python refuses to write numbers of thousands of digits, or to read them
    except (ValueError, OSError, RecursionError) as error:
        raise ConfigurationError(f"{path}: {error}; valid TOML was expected") from None
    return table
