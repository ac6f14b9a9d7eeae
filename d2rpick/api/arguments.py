"""Arguments of the library, checked before any file is opened: a wrong one is named in a TypeError or ValueError.

And windows as a file gives them.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping, Set
from typing import TYPE_CHECKING, Any, Final, NoReturn, TypedDict

from d2rpick.api.request import OPTIONS, TIME, Number
from d2rpick.base.errors import DeckError
from d2rpick.choice.grades import GRADES

if TYPE_CHECKING:
    from typing import Literal

    from d2rpick.vibration.oscillator import Oscillator

    Path = str | os.PathLike[str]
    Deck = (
        Path | Literal[False]
    )  # False: none, also where one lies in the folder of the run
    Parts = str | int | Iterable[str | int]

_LONGEST_SHOWN: Final = 60  # of a wrong value in a message


class Choosing(TypedDict, total=False):
    """How to choose and judge, as the options of ``d2rpick suggest``; times in the unit of the history.

    None stands for the default.

    ``after``: the load ends here, ``landing``: the next contact comes here (default: found from the record).
    ``margin``: kept clear after the load and before the next contact (0; where td is chosen or the landing is given,
    derived).
    ``tolerance``: on the lock-in error, on the level error where no oscillator is known (0.2).
    ``max_kinetic_share``, ``max_residual``: limits that a recommendation must keep.  ``oscillator``: given instead of
    identified, with ``v0``, the velocity of its frame at the first state.  ``fit_window``: (from, to), the oscillator
    is identified there only.  ``replay`` False: judge by the energy level alone.  ``strict``: accept no tr where the
    energy alone shows when the load is over.  ``keep_vibration``: grade the vibration by itself, however little its
    error is worth in the next contact.  ``min_quality``: "poor", "fair" or "good", the least grade of a pair that
    `plan` plans and `check` passes ("fair").  ``cost_share``, ``step_ratio``: of the switched parts in the cost of a
    step, and of the step while rigid to that while deformable, 1 or more.
    """

    after: float | None
    landing: float | None
    margin: float | None
    tolerance: float | None
    max_kinetic_share: float | None
    max_residual: float | None
    oscillator: Oscillator | None
    v0: float | None
    fit_window: tuple[float, float] | None
    replay: bool | None
    strict: bool | None
    keep_vibration: bool | None
    min_quality: str | None
    cost_share: float | None
    step_ratio: float


def number(name: str, value: object, limits: Number = TIME) -> float:
    """Give a finite number within its limits.

    Examples
    --------
    >>> number("td", 1)
    1.0
    >>> number("margin", -1, Number(0.0))
    Traceback (most recent call last):
    ValueError: margin is -1, a number of at least 0 was expected
    """
    if not is_number(value):
        raise TypeError(
            f"{name} is {_shown(value)}, a number was expected{without_unit(value)}"
        )
    found = float(value)  # type: ignore[arg-type]
    if not math.isfinite(found):
        raise ValueError(f"{name} is {found}, a finite number was expected")
    if limit := limits.missed(found):
        raise ValueError(f"{name} is {found:g}, a number {limit} was expected")
    return found


def is_number(value: object) -> bool:
    """Return True for a number of Python or numpy, also in an array without axes; not for True, text or complex."""
    kind = getattr(getattr(value, "dtype", None), "kind", "")
    if (
        isinstance(value, bool | str | bytes)
        or (kind and kind not in "iuf")
        or getattr(value, "ndim", 0)
    ):
        return False
    return hasattr(value, "__float__")


def is_whole_number(value: object) -> bool:
    """Return True for a whole number of Python or numpy; not for True, text or a float."""
    return (
        is_number(value)
        and hasattr(value, "__index__")
        and getattr(getattr(value, "dtype", None), "kind", "i") in "iu"
    )


def _shown(value: object) -> str:
    """Write a wrong value in one line, cut where it is long."""
    text = " ".join(repr(value).split())
    return (
        text
        if len(text) <= _LONGEST_SHOWN
        else f"{text[:_LONGEST_SHOWN]}... of type {type(value).__name__}"
    )


def flag(name: str, value: object, default: bool) -> bool:
    """Return True or False, the default for None; TypeError for anything else.

    Examples
    --------
    >>> flag("replay", None, True), flag("replay", False, True)
    (True, False)
    """
    if value is None:
        return default
    kind = getattr(getattr(value, "dtype", None), "kind", "")
    if not isinstance(value, bool) and (kind != "b" or getattr(value, "ndim", 0)):
        raise TypeError(f"{name} is {_shown(value)}, True or False was expected")
    return bool(value)


def pairs(name: str, value: object) -> list[tuple[float, float]]:
    """Return windows of time, none for None.

    Examples
    --------
    >>> pairs("done", [(0.1, 0.2), [0.3, 0.4]]), pairs("done", None)
    ([(0.1, 0.2), (0.3, 0.4)], [])
    """
    if value is None:
        return []
    found = []
    for number_of_pair, pair in enumerate(_each(name, value, "pairs of times")):
        times = window(f"{name}[{number_of_pair}]", pair)
        if times is None:
            raise TypeError(
                f"{name}[{number_of_pair}] is None, a pair of times was expected"
            )
        found.append(times)
    return found


def with_point(value: object) -> str:
    """Say how a number with a decimal comma is given, or nothing.

    Examples
    --------
    >>> with_point("0,064"), with_point("0.064 s")
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


def without_unit(value: object) -> str:
    """Say how a time with a unit is given, or nothing."""
    from d2rpick.histories.names import parse_seconds

    seconds = parse_seconds(str(value))
    return (
        ""
        if seconds is None
        else f": give a number in the unit of the history, {seconds:g} where it is s"
    )


def optional(name: str, value: object, limits: Number = TIME) -> float | None:
    """Give a finite number within its limits, None where none is given."""
    return None if value is None else number(name, value, limits)


def window(name: str, value: object) -> tuple[float, float] | None:
    """Give a window of time, the lower time first; None where none is given.

    Examples
    --------
    >>> window("td_window", [0.06, 0.07])
    (0.06, 0.07)
    """
    if value is None:
        return None
    is_pair = (
        hasattr(value, "__len__")
        and hasattr(value, "__iter__")
        and getattr(value, "ndim", 1) == 1
    )
    if not is_pair or isinstance(value, str | bytes | Mapping | Set) or len(value) != 2:  # type: ignore[arg-type]
        raise TypeError(f"{name} is {_shown(value)}, a pair of times was expected")
    first, last = list(value)  # type: ignore[call-overload]
    found = number(f"{name}[0]", first), number(f"{name}[1]", last)
    if not found[0] < found[1]:
        raise ValueError(
            f"{name} is {found[0]:g} to {found[1]:g}, which is empty; the lower time comes first"
        )
    return found


def part_names(name: str, value: Parts | None) -> tuple[str, ...]:
    """Give parts as the command line names them: numbers, ranges (``"10-19"``) and titles.

    Examples
    --------
    >>> part_names("parts", [3, "roof"]), part_names("parts", "10-19"), part_names("parts", None)
    (('3', 'roof'), ('10-19',), ())
    """
    if value is None:
        return ()
    from d2rpick.histories.names import Part

    single = isinstance(value, str | int | Part) or is_whole_number(
        value
    )  # a Part holds its number and its title
    listed = (
        [value] if single else list(_each(name, value, "a number, a title or several"))
    )
    for one in listed:
        if not (isinstance(one, str) or is_whole_number(one)):
            raise TypeError(
                f"{name} holds {_shown(one)}; numbers and titles of parts were expected"
            )
    if not listed:
        raise ValueError(f"{name} is empty; give a part, or leave {name} out")
    return tuple(str(one) for one in listed)


def rule_ids(name: str, value: str | Iterable[str] | None) -> tuple[str, ...]:
    """Give ids of rules or their beginnings; a string is one of them.

    Examples
    --------
    >>> rule_ids("select", "D2R1"), rule_ids("ignore", ["D2R104", "D2R2"])
    (('D2R1',), ('D2R104', 'D2R2'))
    """
    if value is None:
        return ()
    listed = (
        [value] if isinstance(value, str) else list(_each(name, value, "ids of rules"))
    )
    for one in listed:
        if not isinstance(one, str):
            raise TypeError(f"{name} holds {one!r}; ids of rules were expected")
    return tuple(listed)


def whole(name: str, value: object, low: int) -> int:
    """Give a whole number of at least ``low``.

    Examples
    --------
    >>> whole("steps", 2.5, 1)
    Traceback (most recent call last):
    TypeError: steps is 2.5, a whole number was expected
    """
    if not is_whole_number(value):
        raise TypeError(f"{name} is {_shown(value)}, a whole number was expected")
    return int(number(name, value, Number(low)))


def paths(name: str, value: Path | Iterable[Path]) -> tuple[str, ...]:
    """Give the names of files; a string is one of them.

    Examples
    --------
    >>> paths("source", "run/"), paths("source", ["glstat", "matsum"])
    (('run/',), ('glstat', 'matsum'))
    """
    listed = (
        [value]
        if isinstance(value, str | os.PathLike)
        else list(_each(name, value, "a path or several"))
    )
    for one in listed:
        if not isinstance(one, str | os.PathLike):
            raise TypeError(f"{name} holds {_shown(one)}; paths were expected")
    if not listed:
        raise ValueError(f"{name} is empty; give a file or folder")
    found = tuple(os.fsdecode(one) for one in listed)
    for one in found:
        if "\0" in one:
            raise ValueError(
                f"{name} holds {one!r} with a NUL byte, which no name of a file has"
            )
    return found


def check_run(name: str, run: object) -> None:
    """Raise TypeError for what is not a run that was read."""
    from d2rpick.api.tables import is_table

    if not (
        hasattr(run, "files") and hasattr(run, "overview")
    ):  # its class imports this module
        found = (
            repr(run)
            if isinstance(run, str | os.PathLike)
            else f"of type {type(run).__name__}"
        )
        made = "from_frame(...)" if is_table(run) else "read(...)"
        raise TypeError(f"{name} is {found}; give what d2rpick.{made} makes of it")


def refuse_unknown(
    name: str, known: Iterable[str], others: Iterable[str] = ()
) -> NoReturn:
    """Raise the TypeError of an argument that does not exist, with the one of all that may be meant."""
    from difflib import get_close_matches

    near = get_close_matches(name, {*known, *others} - {name}, 1)
    meant = f"is {near[0]!r} meant?" if near else f"expected one of {', '.join(known)}"
    raise TypeError(f"there is no argument {name!r}; {meant}")


def chosen(choosing: Choosing) -> dict[str, Any]:
    """Give the fields of a request that say how to choose."""
    known = Choosing.__annotations__
    if unknown := [name for name in choosing if name not in known]:
        refuse_unknown(
            unknown[0], known, ("parts", "flying", "deck", "weights", "td_window")
        )
    given: dict[str, Any] = dict(choosing)
    oscillator = _check_oscillator(given.pop("oscillator", None))
    if (oscillator is None) != (given.get("v0") is None):
        raise ValueError(
            "oscillator and v0 go together: the one vibrates because of the other"
        )
    if given.get("tolerance", 0.0) is None:
        del given["tolerance"]
    check_grade(given.get("min_quality"))
    of_other_kinds = {"replay", "strict", "keep_vibration", "fit_window", "min_quality"}
    for name in given.keys() - of_other_kinds:
        limits: Any = OPTIONS[name].kind
        if given[name] is not None:
            given[name] = number(name, given[name], limits)
    given["fit_window"] = window("fit_window", given.get("fit_window"))
    given["no_verify"] = not flag("replay", given.pop("replay", None), True)
    given["strict"] = flag("strict", given.get("strict"), False)
    given["keep_vibration"] = flag("keep_vibration", given.get("keep_vibration"), False)
    of_oscillator = ("stiffness", "mass", "frame_mass", "alpha")
    return given | {
        name: float(getattr(oscillator, name))
        for name in of_oscillator
        if oscillator is not None
    }


def check_grade(value: object) -> None:
    """Refuse what is no grade of a pair.

    Examples
    --------
    >>> check_grade("best")
    Traceback (most recent call last):
    ValueError: min_quality is 'best', one of poor, fair, good was expected
    """
    if value is None or value in GRADES:
        return
    raise ValueError(
        f"min_quality is {_shown(value)}, one of {', '.join(GRADES)} was expected"
    )


def _check_oscillator(value: object) -> Oscillator | None:
    if value is None:
        return None
    from d2rpick.vibration.oscillator import (
        Oscillator,
    )  # not above: mostly none is given

    if not isinstance(value, Oscillator):
        raise TypeError(
            f"oscillator is {_shown(value)}, a d2rpick.Oscillator was expected"
        )
    return value


def file_or_weights(value: object) -> Any:
    """Return weights, or the name of the file that holds them; None where none are given."""
    if value is None:
        return None
    if isinstance(value, str | os.PathLike):
        return one_path("weights", value)
    from d2rpick.choice.cost import Weights  # not above: mostly none are given

    if not isinstance(value, Weights):
        raise TypeError(
            f"weights is {_shown(value)}, d2rpick.Weights or the name of a file was expected"
        )
    return value


def _each(name: str, value: Any, expected: str) -> Iterable[Any]:
    if (
        not hasattr(value, "__iter__")
        or isinstance(value, bytes | Mapping)
        or getattr(value, "ndim", 1) == 0
    ):
        raise TypeError(f"{name} is {_shown(value)}; {expected} were expected")
    found: Iterable[Any] = value
    return found


def one_path(name: str, value: Path) -> str:
    """Give the name of one file."""
    found = paths(name, value)
    if len(found) > 1:
        raise ValueError(f"{name} names {len(found)} files, one was expected")
    return found[0]


def read_windows(text: str, source: str) -> tuple[tuple[float, float], ...]:
    """Read windows as ``d2rpick plan -f value`` prints them: a line ``tr td`` for each; or the journal of a driven run.

    Empty lines and those that begin with ``#`` are passed over.

    Raises
    ------
    DeckError
        For any other line, with its number, and when there is no window at all.
    """
    windows: list[tuple[float, float]] = []
    if text.lstrip().startswith("{"):
        windows = _of_journal(text)
        text = ""
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        try:
            tr, td = map(float, words)
        except ValueError:
            raise DeckError(
                f"{source}:{number}: {line.strip()[:60]!r} was found, 'tr td' was expected"
            ) from None
        windows.append((tr, td))
    if not windows:
        raise DeckError(
            f"{source}: no window was found, a line 'tr td' for each was expected"
        )
    return tuple(windows)


def _of_journal(text: str) -> list[tuple[float, float]]:
    """Windows of the rigid legs that a run has kept: a leg takes the place of an earlier one of its number."""
    import json  # not above: start-up

    legs: list[
        tuple[int, bool, float, float]
    ] = []  # number, whether it is rigid, start, end
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
            continue  # cut, or of another kind
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
