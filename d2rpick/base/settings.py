"""Read the settings closest to a folder, from ``d2rpick.toml`` or from ``[tool.d2rpick]`` in pyproject.toml.

The search ends at the root of a repository or at the user's home, and uses only files that the user owns.
"""
# ruff: noqa: PTH100, PTH110, PTH111, PTH113, PTH116, PTH118, PTH120, PTH121, PTH123
# Every command searches for settings, and importing pathlib would take longer than this search.

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import ConfigurationError, list_names
from d2rpick.base.tuples import NamedTuple

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator

_OWN, _SHARED = "d2rpick.toml", "pyproject.toml"
_OF_REPOSITORIES: Final = (".git", ".hg")  # Folders that mark the root of a repository.
# Name of the settings file of the deck check, which is sought in the folder of each deck and the folders above.
RULE_KEYS: Final = ("select", "ignore", "severity")
# Quotes and spaces that may surround the parts of a dotted key.
_UNIMPORTANT: Final = dict.fromkeys(map(ord, " \t\"'"))
_MOST_KEYS_NAMED: Final = 8
_LONGEST_VALUE: Final = 60  # Largest number of characters quoted


class NearestSettings(NamedTuple):
    """The settings that apply in a folder.

    ``table`` is empty if there are none.  ``source`` names their file, or is empty.  ``notes`` name nearer files that
    are not used because another user owns them.
    """

    table: Mapping[str, object]
    source: str
    notes: tuple[str, ...]


def find_nearest_settings(folder: str) -> NearestSettings:
    """Find the settings in a folder or the folders above it; in each folder, d2rpick.toml precedes pyproject.toml.

    Raises
    ------
    ConfigurationError
        If the file is not TOML, or contains no table of settings.
    """
    notes: list[str] = []
    for directory in _list_searched_folders(os.path.abspath(folder)):
        for name in (_OWN, _SHARED):
            source = os.path.join(directory, name)
            if not os.path.isfile(source):
                continue
            if not _is_owned_by_user(source):
                if name == _OWN or _has_settings(source):
                    notes.append(
                        f"{source}: not used, since another user owns it; copy it to use its settings"
                    )
                continue
            table = _read_table(source, shared=name == _SHARED)
            if isinstance(table, Mapping):
                return NearestSettings(table, source, tuple(notes))
            if table is not None:
                raise ConfigurationError(
                    f"{source}: the configuration is {format_toml_value(table)}, but a table was expected"
                )
    return NearestSettings({}, "", tuple(notes))


def _list_searched_folders(folder: str) -> Iterator[str]:
    """Yield a folder and the folders above it, up to the repository root or the user's home folder.

    Outside both, the search ends below the first folder that another user owns, and below the root of the system.
    """
    home = os.path.expanduser("~")
    while True:
        yield folder
        above = os.path.dirname(folder)
        is_top = os.path.dirname(above) == above or not _is_owned_by_user(above)
        is_home = (
            os.path.exists(home)
            and os.path.exists(folder)
            and os.path.samefile(folder, home)
        )
        marks = (os.path.join(folder, name) for name in _OF_REPOSITORIES)
        if is_top or is_home or any(map(os.path.exists, marks)):
            return
        folder = above


def _is_owned_by_user(path: str) -> bool:
    """Return True if the user owns a file or folder and any link to it; on Windows, always return True."""
    if not hasattr(os, "geteuid"):
        return True
    user = os.geteuid()
    try:
        return os.stat(path).st_uid == user == os.lstat(path).st_uid
    except OSError:
        return False


def format_toml_value(value: object) -> str:
    """Format a value from a TOML file for a message; a long value is cut.

    Examples
    --------
    >>> from datetime import date
    >>> [format_toml_value(value) for value in (True, date(1979, 5, 27), "x")]
    ['true', '1979-05-27', "'x'"]
    >>> format_toml_value("x" * 99)[-5:]
    'x ...'
    """
    if isinstance(value, bool):
        text = str(value).lower()
    elif hasattr(value, "isoformat"):
        text = str(value.isoformat())
    else:
        text = repr(value)
    return text if len(text) <= _LONGEST_VALUE else f"{text[:_LONGEST_VALUE]} ..."


def locate_setting(path: str, key: str, table: str = "") -> str:
    """Return ``path:line`` of the line that sets ``key`` in ``table``, or only the path if no line does.

    A ``table`` named "" is the top of the settings, in which a key may be the head of a table.
    """
    try:
        with open(path, encoding="utf-8-sig") as file:
            lines = file.read().splitlines()
    except (OSError, ValueError):
        return path
    current_table = ""
    for number, line in enumerate(lines, start=1):
        text = line.translate(_UNIMPORTANT).partition("#")[0]
        if text.startswith("["):
            head = text.strip("[]")
            current_table = head.removeprefix("tool.d2rpick").removeprefix(".")
            is_wanted = not table and current_table == key
        else:
            is_wanted = current_table == table and text.startswith(f"{key}=")
        if is_wanted:
            return f"{path}:{number}"
    return path


def refuse_unknown_settings(
    names: Iterable[str], known: Collection[str], source: str, table: str = ""
) -> None:
    """Raise ConfigurationError for the first name that is not ``known``, with its line and the most similar key."""
    for name in names:
        if name not in known:
            import difflib  # Imported here to keep start-up fast.

            near = difflib.get_close_matches(name, known, n=1)
            hint = f" (did you mean {near[0]!r}?)" if near else ""
            names_of_keys = list_names(tuple(known), most=_MOST_KEYS_NAMED)
            place = locate_setting(source, name, table)
            named_table = f" {table}:" if table else ""
            unknown = f"unknown key {format_toml_value(name)}{hint}"
            raise ConfigurationError(
                f"{place}:{named_table} {unknown}, but one of {names_of_keys} was expected; "
                "--show-settings lists those of a command"
            )


def _has_settings(path: str) -> bool:
    """Return True if an unused pyproject.toml has settings for d2rpick; False if it has none or cannot be read."""
    try:
        return _read_table(path, shared=True) is not None
    except ConfigurationError:
        return False


def _may_have_settings(text: str) -> bool:
    """Return False if a pyproject.toml cannot define ``tool.d2rpick``; this test avoids the import of a parser."""
    solid = text.translate(_UNIMPORTANT)
    return any(start in solid for start in ("tool.d2rpick", "[tool]", "tool={"))


def _explain_toml_error(path: str, error: Exception) -> str:
    """Return the message for a file that is not valid TOML, with the line and the remedy if they are known."""
    place = re.search(r" \(at line (\d+), column (\d+)\)$", str(error))
    if place is None:
        return f"{path}: {error}; valid TOML was expected"
    with open(path, encoding="utf-8-sig") as file:
        line = file.read().split("\n")[int(place[1]) - 1].strip()
    cure = ""
    if re.search(r"=\s*\d+,\d+\s*(#|$)", line):
        cure = "; write the number with a decimal point"
    reason = f"{format_toml_value(line)} was found, but valid TOML was expected"
    return (
        f"{path}:{place[1]}:{place[2]}: {reason} ({str(error)[: place.start()]}){cure}"
    )


def _read_table(path: str, *, shared: bool) -> object:
    """Return the settings in a TOML file; None if a file ``shared`` with other tools contains no settings."""
    try:
        # The encoding is utf-8-sig, because editors on Windows may begin a text with a byte order mark.
        with open(path, encoding="utf-8-sig") as file:
            text = file.read()
        if shared and not _may_have_settings(text):
            return None
        import tomllib

        table = tomllib.loads(text)
        # A message may contain an integer with thousands of digits, which Python refuses to print.
        repr(table)
    except (ValueError, OSError, RecursionError) as error:
        raise ConfigurationError(_explain_toml_error(path, error)) from None
    if not shared:
        return table
    tools = table.get("tool")
    return tools.get("d2rpick") if isinstance(tools, Mapping) else None
