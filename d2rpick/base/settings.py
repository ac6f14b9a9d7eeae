"""The file of settings nearest to a folder: ``d2rpick.toml``, or ``[tool.d2rpick]`` of pyproject.toml."""
# ruff: noqa: PTH100, PTH113, PTH118, PTH120, PTH123
# Every command looks for settings, and pathlib takes longer to import than that.

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import ConfigurationError

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable

_OWN, _SHARED = "d2rpick.toml", "pyproject.toml"
RULE_KEYS: Final = ("select", "ignore", "severity")  # of the deck check, which takes them from beside each deck


def nearest_settings(folder: str) -> tuple[Mapping[str, object], str]:
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
    place, above = "", os.path.abspath(folder)
    while place != above:
        place, above = above, os.path.dirname(above)
        for name in (_OWN, _SHARED):
            source = os.path.join(place, name)
            found = _table(source, shared=name == _SHARED) if os.path.isfile(source) else None
            if isinstance(found, Mapping):
                return found, source
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


def _table(path: str, *, shared: bool) -> object:
    """Read the settings of a file of TOML; None where one that is ``shared`` with other tools has none."""
    try:
        with open(path, encoding="utf-8") as file:
            text = file.read()
        solid = text.replace(" ", "")
        if shared and "tool.d2rpick" not in solid and "[tool]" not in solid:
            return None
        import tomllib

        table = tomllib.loads(text)
        repr(table)  # as a message may show it: Python refuses to write numbers of thousands of digits, or to read them
    except (ValueError, OSError, RecursionError) as error:
        raise ConfigurationError(f"{path}: {error}; valid TOML was expected") from None
    tools = table.get("tool")
    return table if not shared else tools.get("d2rpick") if isinstance(tools, Mapping) else None
