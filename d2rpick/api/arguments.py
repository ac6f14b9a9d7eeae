"""Check the arguments of Python functions before a file is opened, and read windows from a file.

A wrong argument raises a TypeError or ValueError that names it.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterable, Mapping, Set
from typing import TYPE_CHECKING, Any, Final, NoReturn

from d2rpick.api.request import OPTIONS, Request
from d2rpick.base.errors import DeckError
from d2rpick.base.options import TIME, Option
from d2rpick.base.ranges import Number

if TYPE_CHECKING:
    from typing import Literal

    from d2rpick.api.choosing import Choosing
    from d2rpick.vibration.oscillator import Oscillator

    Path = str | os.PathLike[str]
    # False means that no deck is used, even if there is one in the folder of the run.
    Deck = Path | Literal[False]
    Parts = str | int | Iterable[str | int]
    # A number in the unit of the run, or a string with a unit, e.g. 64ms.
    Time = float | str

# Largest number of characters of an invalid value that are shown in a message.
_LONGEST_SHOWN: Final = 60
# Smallest number above 1 that is read as a percentage, and the number that is the whole.
_LEAST_PERCENT: Final = 2
_WHOLE: Final = 100


def check_number(name: str, value: object, limits: Number = TIME) -> float:
    """Return a finite number within its limits; raise TypeError or ValueError for any other value.

    Examples
    --------
    >>> check_number("td", 1)
    1.0
    >>> check_number("margin", -1, Number(0.0))
    Traceback (most recent call last):
    ValueError: margin is -1, but a number of at least 0 was expected
    """
    if not is_number(value):
        raise TypeError(
            f"{name} is {_format_wrong_value(value)}, but a number was expected{suggest_without_unit(value)}"
        )
    converted = float(value)  # type: ignore[arg-type]  # is_number() excludes other types
    if not math.isfinite(converted):
        raise ValueError(f"{name} is {converted}, but a finite number was expected")
    if limit := limits.missed(converted):
        raise ValueError(f"{name} is {converted:g}, but a number {limit} was expected")
    return converted


def is_number(value: object) -> bool:
    """Return True for a Python or numpy number, or a 0-dimensional array of one; False for True, text or complex."""
    kind = getattr(getattr(value, "dtype", None), "kind", "")
    if (
        isinstance(value, bool | str | bytes)
        or (kind and kind not in "iuf")
        or getattr(value, "ndim", 0)
    ):
        return False
    return hasattr(value, "__float__")


def is_whole_number(value: object) -> bool:
    """Return True for a Python or numpy whole number; False for True, text or a float."""
    return (
        is_number(value)
        and hasattr(value, "__index__")
        and getattr(getattr(value, "dtype", None), "kind", "i") in "iu"
    )


def _format_wrong_value(value: object) -> str:
    """Return an invalid value as a single line, shortened if it is long."""
    text = " ".join(repr(value).split())
    if len(text) <= _LONGEST_SHOWN:
        return text
    return f"{text[:_LONGEST_SHOWN]}... of type {type(value).__name__}"


def check_flag(name: str, value: object, default: bool) -> bool:
    """Return True or False; None gives the default. Raise TypeError for anything else.

    Examples
    --------
    >>> check_flag("replay", None, True), check_flag("replay", False, True)
    (True, False)
    """
    if value is None:
        return default
    kind = getattr(getattr(value, "dtype", None), "kind", "")
    if not isinstance(value, bool) and (kind != "b" or getattr(value, "ndim", 0)):
        raise TypeError(
            f"{name} is {_format_wrong_value(value)}, but True or False was expected"
        )
    return bool(value)


def check_windows(name: str, value: object) -> list[tuple[float, float]]:
    """Return the given time windows as a list; None gives an empty list.

    Examples
    --------
    >>> check_windows("done", [(0.1, 0.2), [0.3, 0.4]]), check_windows("done", None)
    ([(0.1, 0.2), (0.3, 0.4)], [])
    """
    if value is None:
        return []
    windows = []
    for number_of_pair, pair in enumerate(
        _check_iterable(name, value, "pairs of times")
    ):
        times = check_time_window(f"{name}[{number_of_pair}]", pair)
        if times is None:
            raise TypeError(
                f"{name}[{number_of_pair}] is None, but a pair of times was expected"
            )
        windows.append(times)
    return windows


def suggest_decimal_point(value: object) -> str:
    """Explain how to write a number that was given with a decimal comma; return "" for any other string.

    Examples
    --------
    >>> suggest_decimal_point("0,064"), suggest_decimal_point("0.064 s")
    (': write it with a decimal point, 0.064', '')
    """
    text = str(value).strip()
    if text.count(",") != 1:
        return ""
    written = text.replace(",", ".")
    try:
        float(written)
    except ValueError:
        return ""
    return f": write it with a decimal point, {written}"


def suggest_without_unit(value: object) -> str:
    """Explain how to write a time that was given with a unit; return "" for any other string."""
    from d2rpick.histories.digits import parse_seconds

    seconds = parse_seconds(str(value))
    if seconds is None:
        return ""
    return f": give a number in the unit of the run, {seconds:g} if it is s"


def suggest_seconds(value: object) -> str:
    """Explain how to write a time by the clock that was given with a unit; return "" for any other string.

    Examples
    --------
    >>> suggest_seconds("5s"), suggest_seconds("five")
    (': give the seconds as a number, 5', '')
    """
    from d2rpick.histories.digits import parse_seconds

    seconds = parse_seconds(str(value))
    return "" if seconds is None else f": give the seconds as a number, {seconds:g}"


def suggest_share(number: float) -> str:
    """Explain how to write a fraction if a number above 1 looks like a percentage; return "" for any other number.

    Examples
    --------
    >>> suggest_share(20.0), suggest_share(1.5), suggest_share(-3.0)
    ('; for 20% write 0.2', '', '')
    """
    is_percentage = _LEAST_PERCENT <= number <= _WHOLE
    return f"; for {number:g}% write {number / _WHOLE:g}" if is_percentage else ""


def suggest_without_percent(value: object, *, is_time: bool) -> str:
    """Explain how to write a fraction or a time that was given in percent; return "" for any other string.

    Examples
    --------
    >>> suggest_without_percent("20%", is_time=False), suggest_without_percent("20%", is_time=True)
    (': write the share as a number, 0.2', ': give a time in the unit of the run, without %')
    """
    number, percent, rest = str(value).strip().partition("%")
    if not percent or rest:
        return ""
    try:
        share = float(number) / 100
    except ValueError:
        return ""
    if is_time:
        return ": give a time in the unit of the run, without %"
    return f": write the share as a number, {share:g}"


def check_optional_number(
    name: str, value: object, limits: Number = TIME
) -> float | None:
    """Return a finite number within its limits; None if no number is given."""
    return None if value is None else check_number(name, value, limits)


def check_time_window(name: str, value: object) -> tuple[float, float] | None:
    """Return a time window with the lower time first; None if no window is given.

    Examples
    --------
    >>> check_time_window("td_window", [0.06, 0.07])
    (0.06, 0.07)
    """
    if value is None:
        return None
    if not _is_pair(value):
        raise TypeError(
            f"{name} is {_format_wrong_value(value)}, but a pair of times was expected"
        )
    first, last = list(value)  # type: ignore[call-overload]  # _is_pair() excludes other types
    times = check_number(f"{name}[0]", first), check_number(f"{name}[1]", last)
    if not times[0] < times[1]:
        raise ValueError(
            f"{name} is {times[0]:g} to {times[1]:g}, which is empty; the lower time comes first"
        )
    return times


def _is_pair(value: Any) -> bool:
    """Return True for an ordered collection of two values, such as a tuple or a numpy array."""
    is_ordered = (
        hasattr(value, "__len__")
        and hasattr(value, "__iter__")
        and getattr(value, "ndim", 1) == 1
        and not isinstance(value, str | bytes | Mapping | Set)
    )
    return is_ordered and len(value) == 2


def list_part_names(name: str, value: Parts | None) -> tuple[str, ...]:
    """Return parts in the notation of the command line: numbers, ranges (``"10-19"``) and titles.

    Examples
    --------
    >>> list_part_names("parts", [3, "roof"]), list_part_names("parts", "10-19"), list_part_names("parts", None)
    (('3', 'roof'), ('10-19',), ())
    """
    if value is None:
        return ()
    from d2rpick.histories.names import Part

    # A `Part` has both a number and a title.
    single = isinstance(value, str | int | Part) or is_whole_number(value)
    if single:
        listed = [value]
    else:
        listed = list(_check_iterable(name, value, "a number, a title or several"))
    for part in listed:
        if not (isinstance(part, str) or is_whole_number(part)):
            raise TypeError(
                f"{name} holds {_format_wrong_value(part)}; numbers and titles of parts were expected"
            )
    if not listed:
        raise ValueError(f"{name} is empty; give a part, or leave {name} out")
    return tuple(str(part) for part in listed)


def list_rule_ids(name: str, value: str | Iterable[str] | None) -> tuple[str, ...]:
    """Return the ids or id prefixes of rules as a tuple; a string is a single id.

    Examples
    --------
    >>> list_rule_ids("select", "D2R1"), list_rule_ids("ignore", ["D2R104", "D2R2"])
    (('D2R1',), ('D2R104', 'D2R2'))
    """
    if value is None:
        return ()
    if isinstance(value, str):
        listed = [value]
    else:
        listed = list(_check_iterable(name, value, "ids of rules"))
    for rule in listed:
        if not isinstance(rule, str):
            raise TypeError(f"{name} holds {rule!r}; ids of rules were expected")
    return tuple(listed)


def check_whole_number(name: str, value: object, low: int) -> int:
    """Return a whole number that is at least ``low``.

    Examples
    --------
    >>> check_whole_number("steps", 2.5, 1)
    Traceback (most recent call last):
    TypeError: steps is 2.5, but a whole number was expected
    """
    if not is_whole_number(value):
        raise TypeError(
            f"{name} is {_format_wrong_value(value)}, but a whole number was expected"
        )
    return int(check_number(name, value, Number(low)))


def list_paths(name: str, value: Path | Iterable[Path]) -> tuple[str, ...]:
    """Return the names of files as a tuple; a string is a single name.

    Examples
    --------
    >>> list_paths("source", "run/"), list_paths("source", ["glstat", "matsum"])
    (('run/',), ('glstat', 'matsum'))
    """
    if isinstance(value, str | os.PathLike):
        listed = [value]
    else:
        listed = list(_check_iterable(name, value, "a path or several"))
    for path in listed:
        if not isinstance(path, str | os.PathLike):
            raise TypeError(
                f"{name} holds {_format_wrong_value(path)}; paths were expected"
            )
    if not listed:
        raise ValueError(f"{name} is empty; give a file or folder")
    names = tuple(os.fsdecode(path) for path in listed)
    for path in names:
        if "\0" in path:
            raise ValueError(
                f"{name} holds {path!r} with a NUL byte, which no name of a file has"
            )
    return names


def check_run(name: str, run: object) -> None:
    """Raise TypeError unless the argument is a run returned by `read`."""
    from d2rpick.api.tables import is_table

    # The class is not imported here, because its module imports this module.
    if not (hasattr(run, "files") and hasattr(run, "overview")):
        if isinstance(run, str | os.PathLike):
            description = repr(run)
        else:
            description = f"of type {type(run).__name__}"
        function = "from_frame(...)" if is_table(run) else "read(...)"
        raise TypeError(
            f"{name} is {description}; give what d2rpick.{function} makes of it"
        )


def refuse_unknown(
    name: str, known_names: Iterable[str], other_names: Iterable[str] = ()
) -> NoReturn:
    """Raise TypeError for an unknown argument, and suggest the most similar known name."""
    from difflib import get_close_matches

    near = get_close_matches(name, {*known_names, *other_names} - {name}, 1)
    meant = (
        f"is {near[0]!r} meant?"
        if near
        else f"expected one of {', '.join(known_names)}"
    )
    raise TypeError(f"there is no argument {name!r}; {meant}")


def check_option(name: str, value: object, option: Option, default: Any = None) -> Any:
    """Return a value converted to the type of its option; None gives the default.

    Examples
    --------
    >>> check_option("min_quality", "best", OPTIONS["min_quality"])
    Traceback (most recent call last):
    ValueError: min_quality is 'best', but one of poor, fair, good was expected
    """
    kind: Any = option.kind
    if value is None:
        return default
    if kind == "flag":
        return check_flag(name, value, default)
    if option.many:
        return list_part_names(name, value)  # type: ignore[arg-type]  # the function checks the type
    if option.pair and isinstance(kind, range):
        return check_two_whole_numbers(name, value, kind.start)
    if option.pair:
        return check_time_window(name, value)
    if isinstance(kind, range):
        return check_whole_number(name, value, kind.start)
    if isinstance(kind, Number):
        return check_number(name, value, kind)
    if not isinstance(value, str):
        raise TypeError(
            f"{name} is {_format_wrong_value(value)}, but a text was expected"
        )
    if isinstance(kind, tuple) and value not in kind:
        raise ValueError(
            f"{name} is {_format_wrong_value(value)}, but one of {', '.join(kind)} was expected"
        )
    return value


def read_choosing(choosing: Choosing | Mapping[str, Any]) -> dict[str, Any]:
    """Return the request fields that determine how the times are chosen."""
    from d2rpick.api.choosing import Choosing as Arguments

    expected_names = Arguments.__annotations__
    arguments: dict[str, Any] = dict(choosing)
    if unknown := [name for name in arguments if name not in expected_names]:
        other_names = ("parts", "flying", "deck", "weights", "td_window")
        refuse_unknown(unknown[0], expected_names, other_names)
    oscillator = _check_oscillator(arguments.pop("oscillator", None))
    if (oscillator is None) != (arguments.get("v0") is None):
        raise ValueError("give oscillator and v0 together")
    replay = check_flag("replay", arguments.pop("replay", None), True)
    checked = {
        name: check_option(name, value, OPTIONS[name], getattr(Request, name))
        for name, value in arguments.items()
    }
    checked["no_verify"] = not replay
    if oscillator is not None:
        for name in ("stiffness", "mass", "frame_mass", "alpha"):
            checked[name] = float(getattr(oscillator, name))
    return checked


def check_two_whole_numbers(name: str, value: object, low: int) -> tuple[int, int]:
    """Return two whole numbers that are at least ``low``."""
    if not _is_pair(value):
        raise TypeError(
            f"{name} is {_format_wrong_value(value)}, but a pair of numbers was expected"
        )
    first, second = list(value)  # type: ignore[call-overload]  # _is_pair() excludes other types
    return check_whole_number(name, first, low), check_whole_number(name, second, low)


def _check_oscillator(value: object) -> Oscillator | None:
    if value is None:
        return None
    # Imported here to keep start-up fast.
    from d2rpick.vibration.oscillator import Oscillator

    if not isinstance(value, Oscillator):
        raise TypeError(
            f"oscillator is {_format_wrong_value(value)}, but a d2rpick.Oscillator was expected"
        )
    return value


def check_weights(value: object) -> Any:
    """Return weights or the name of a file with weights; None if none are given."""
    if value is None:
        return None
    if isinstance(value, str | os.PathLike):
        return check_path("weights", value)
    # Imported here to keep start-up fast.
    from d2rpick.choice.parts.cost import Weights

    if not isinstance(value, Weights):
        raise TypeError(
            f"weights is {_format_wrong_value(value)}, but d2rpick.Weights or the name of a file was expected"
        )
    return value


def _check_iterable(name: str, value: Any, expected: str) -> Iterable[Any]:
    if (
        not hasattr(value, "__iter__")
        or isinstance(value, bytes | Mapping)
        or getattr(value, "ndim", 1) == 0
    ):
        raise TypeError(
            f"{name} is {_format_wrong_value(value)}; {expected} were expected"
        )
    values: Iterable[Any] = value
    return values


def check_path(name: str, value: Path) -> str:
    """Return the name of a single file."""
    names = list_paths(name, value)
    if len(names) > 1:
        raise ValueError(f"{name} names {len(names)} files, but one was expected")
    return names[0]


def read_windows(text: str, source: str) -> tuple[tuple[float, float], ...]:
    """Read windows from the output of ``d2rpick plan -f value``, in which each line ``tr td`` is a window.

    The journal of a driven run is accepted, too.

    Empty lines and lines that begin with ``#`` are skipped.

    Raises
    ------
    DeckError
        If there is any other line (the message has its number), or if there is no window.
    """
    windows: list[tuple[float, float]] = []
    if text.lstrip().startswith("{"):
        windows = _read_journal(text)
        text = ""
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        place = f"{source}:{number}"
        try:
            tr, td = map(float, words)
        except ValueError:
            raise DeckError(
                f"{place}: {line.strip()[:60]!r} was found, but two numbers 'tr td' were expected; "
                f"{_correct_line(line)}"
            ) from None
        if tr > td:
            raise DeckError(
                f"{place}: tr = {tr:g} lies after td = {td:g}; write the earlier time first"
            )
        windows.append((tr, td))
    if not windows:
        raise DeckError(
            f"{source}: no window was found, but a line 'tr td' for each was expected"
        )
    return tuple(windows)


def _correct_line(line: str) -> str:
    """Return how to correct a line that is not two numbers separated by blanks."""
    words = re.split(r"[\s,;]+", line.strip())
    try:
        tr, td = map(float, words)
    except ValueError:
        return "put # before headings and remarks, or give the journal of d2rpick drive, drive.ndjson"
    return f"separate them by a blank: {tr:g} {td:g}"


def _read_journal(text: str) -> list[tuple[float, float]]:
    """Return the windows of the rigid restart segments in a journal; the last entry for each segment number is used."""
    import json  # Imported here to keep start-up fast.

    # Each item describes a restart segment: its number, True if it is rigid, its start and its end.
    legs: list[tuple[int, bool, float, float]] = []
    for line in text.splitlines():
        try:
            record = json.loads(line)
            if record["event"] == "back":
                del legs[record["legs"] :]
            elif record["event"] == "ended":
                kind, number, start, until = record["order"][:4]
                legs.append(
                    (
                        int(number),
                        kind in {"probe", "rigid"},
                        float(start),
                        float(until),
                    )
                )
        except (ValueError, KeyError, TypeError):
            continue  # The line is incomplete, or has other content.
    latest = {leg[0]: leg for leg in legs if leg[0] <= legs[-1][0]}
    windows: list[tuple[float, float]] = []
    rigid_before = False
    for _, (_, rigid, start, until) in sorted(latest.items()):
        if rigid:
            windows.append(
                (windows.pop()[0], until) if rigid_before else (start, until)
            )
        rigid_before = rigid
    return windows
