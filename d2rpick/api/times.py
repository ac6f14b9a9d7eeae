"""Convert times with a unit, e.g. 64ms, to numbers in the unit of a run, and check arguments that are times."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Final

from d2rpick.api import arguments
from d2rpick.base.errors import ArgumentError, list_names
from d2rpick.base.options import TIME
from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.digits import convert_to_unit, parse_seconds

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from d2rpick.api.runs import Run
    from d2rpick.base.options import Option
    from d2rpick.base.ranges import Number
    from d2rpick.histories.names import Selection


class TimeUnit(NamedTuple):
    """Time unit of a run (empty if unknown), and the name of the input that would have to define the unit."""

    name: str
    source: str


_WITHOUT_RUN: Final = TimeUnit("", "the arguments, which contain no run")


class TimeArguments:
    """Check arguments that are times: numbers in the unit of a run, or strings with a unit, e.g. "64ms".

    ``find_unit`` returns the unit to which strings are converted. It is called only if there is a string, because it
    may have to open a run.

    Examples
    --------
    >>> times = TimeArguments(lambda: TimeUnit("s", "energy.csv"))
    >>> times.check_time("td", "64ms"), times.check_window("td_window", ("60ms", 0.07))
    (0.064, (0.06, 0.07))
    """

    def __init__(self, find_unit: Callable[[], TimeUnit]) -> None:
        self._find_unit = find_unit

    @classmethod
    def of_deck(cls, deck: str | None) -> TimeArguments:
        """Return a converter of times to the unit of a deck; only Radioss decks give a unit."""
        return cls(lambda: find_unit_of_deck(deck))

    @classmethod
    def of_run(cls, run: Run | None) -> TimeArguments:
        """Return a converter of times to the unit of a run."""
        return cls(lambda: find_unit_of_run(run))

    def check_time(
        self, name: str, value: object, limits: Number = TIME
    ) -> float | None:
        """Return a finite time within its limits; None if no time is given."""
        return arguments.check_optional_number(name, self.convert(name, value), limits)

    def check_window(self, name: str, value: object) -> tuple[float, float] | None:
        """Return a time window with the lower time first; None if no window is given."""
        return arguments.check_time_window(name, self.convert(name, value))

    def check_windows(self, name: str, value: object) -> list[tuple[float, float]]:
        """Return the given time windows as a list; None gives an empty list."""
        if isinstance(value, Iterator):
            value = list(value)
        return arguments.check_windows(name, self.convert(name, value))

    def convert_options(
        self, values: Mapping[str, Any], options: Mapping[str, Option]
    ) -> dict[str, Any]:
        """Return the values of options, keyed by name, with the times among them converted."""
        return {
            name: self.convert(name, value)
            if name in options and options[name].is_time
            else value
            for name, value in values.items()
        }

    def convert(self, name: str, value: object) -> object:
        """Return a value in which each time with a unit is replaced by a number, even within lists and tuples.

        Raises
        ------
        ArgumentError
            If the unit of the run is not known.
        """
        if isinstance(value, list | tuple):
            return [self.convert(name, single) for single in value]
        if not (isinstance(value, str) and is_time_with_unit(value)):
            return value
        unit = self._find_unit()
        try:
            return convert_typed_time(value, unit.name, unit.source)
        except ArgumentError as error:
            raise ArgumentError(f"{name}: {error}") from None


def is_time_with_unit(text: str) -> bool:
    """Return True for a string that consists of a number and a unit of time.

    Hours are refused, because no explicit run lasts that long, so the letter is a slip.

    Examples
    --------
    >>> [is_time_with_unit(text) for text in ("64ms", "1.5 min", "64", "64 mm", "64 h")]
    [True, True, False, False, False]
    """
    return parse_seconds(text) is not None and not text.rstrip().endswith("h")


def find_unit_of_deck(deck: str | None) -> TimeUnit:
    """Return the time unit given in a deck; empty if the deck gives none, as in LS-DYNA.

    Raises
    ------
    DeckError
        If the deck cannot be read.
    """
    if deck is None:
        return TimeUnit("", "the run, since no deck is given")
    from d2rpick.deck import find_time_unit  # Imported here to keep start-up fast.

    return TimeUnit(find_time_unit(deck), deck)


def find_unit_of_run(run: Run | None) -> TimeUnit:
    """Return the time unit that the files of an opened run give; empty if they give none or different units."""
    if run is None:
        return _WITHOUT_RUN
    arguments.check_run("run", run)
    units = {database.time_unit for database in run.files.databases}
    return TimeUnit(_choose_only_unit(units), list_names(run.sources))


def find_common_unit(
    runs: Sequence[Sequence[str]], selection: Selection, input_format: str
) -> TimeUnit:
    """Return the time unit that the files of all runs give; empty if they give none or different units.

    Raises
    ------
    D2RPickError
        If a file cannot be read.
    """
    from d2rpick.histories.opening import open_run

    opened_runs = [open_run(names, selection, input_format) for names in runs]
    units = {
        database.time_unit for opened in opened_runs for database in opened.databases
    }
    source = list_names([name for names in runs for name in names])
    return TimeUnit(_choose_only_unit(units), source)


def _choose_only_unit(units: set[str]) -> str:
    """Return the unit if there is exactly one; otherwise empty."""
    return next(iter(units)) if len(units) == 1 else ""


def convert_typed_time(text: str, unit: str, source: str) -> float:
    """Return a typed time as a number in the ``unit`` of the run; raise an error if the unit is unknown.

    Raises
    ------
    ArgumentError
        If the unit of the run is not known; the message states the numbers to give for a run in s and in ms.

    Examples
    --------
    >>> convert_typed_time("64ms", "s", "energy.csv")
    0.064
    """
    number = convert_to_unit(text, unit)
    if number is not None:
        return number
    in_seconds = convert_to_unit(text, "s")
    in_milliseconds = convert_to_unit(text, "ms")
    raise ArgumentError(
        f"{text!r}: the unit of time is not known from {source}; "
        f"give {in_seconds:.12g} if it is s, {in_milliseconds:.12g} if it is ms"
    )
