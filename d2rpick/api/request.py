"""Define, in a single table, all options of the questions that a user can ask about a run.

The fields of `Request` determine the options of the command line with their environment variables, the keyword
arguments of Python, and the command line that repeats an answer.
"""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, Any, Final

from d2rpick.base.data_classes import dataclass
from d2rpick.base.errors import ArgumentError
from d2rpick.base.options import (
    NOT_NEGATIVE,
    POSITIVE,
    TIME,
    Option,
    list_options,
    make_option,
    make_option_name,
)
from d2rpick.choice import options as choice_options
from d2rpick.choice.options import ChoiceOptions, list_uses
from d2rpick.choice.pair import grades
from d2rpick.histories.formats import READERS

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping

    from d2rpick.base.ranges import Number
    from d2rpick.choice.parts.cost import Weights
    from d2rpick.choice.question import Settings
    from d2rpick.histories.names import Selection
    from d2rpick.report.formats import RepeatedQuestion
    from d2rpick.vibration.oscillator import Oscillator

MIN_MEAN_ENERGY: Final = grades.MIN_MEAN_ENERGY
MIN_QUALITY: Final = choice_options.MIN_QUALITY
# Options for reading a history.
READING: Final = ("input_format", "time", "energy", "part", "flying", "channel")
# The same arguments as above except ``part``, because a deck that is checked defines the switched parts itself.
_READING_FOR_CARDS: Final = tuple(name for name in READING if name != "part")
OSCILLATOR: Final = ("stiffness", "mass", "frame_mass", "beta", "alpha", "v0")
_MODEL: Final = (*OSCILLATOR, "no_verify")
# Options for choosing a pair, parts of which also apply to sets of parts, to many runs, and to judging cards.
_USES: Final = list_uses()
CHOOSING: Final = (*_USES, *_MODEL)
CHOOSING_FOR_SETS: Final = (
    *(name for name, use in _USES.items() if use.of_sets),
    *_MODEL,
)
CHOOSING_FOR_CARDS: Final = tuple(name for name, use in _USES.items() if use.of_cards)
ADVANCED: Final = (
    *_MODEL,
    *(name for name, use in _USES.items() if use.is_advanced),
)
JUDGING: Final = (*_READING_FOR_CARDS, *CHOOSING_FOR_CARDS)
_NOT_TYPED: Final = ("history", "given", "run_folder", "deck_in_folder")
# Placeholder in a command line for weights that were not read from a file.
# d2rpick refuses such a command line, because it does not contain the weights.
_IN_MEMORY: Final = "<weights in memory>"


def _make_oscillator_option(text: str, kind: Number = POSITIVE, *others: str) -> Any:
    return make_option(text, kind, instead_of=(*others, "fit_window", "no_verify"))


@dataclass(frozen=True, init=False, eq=False, repr=False, kw_only=True)
class ReadingOptions:
    """The files of a run, and how they are read."""

    deck: str | None = make_option(
        "Main deck of the run.", "file", "DECK", instead_of=("no_deck",)
    )
    no_deck: bool = make_option(
        "Use no deck.  [default: the main deck in HISTORY, if that is a folder]",
        *("flag",), default=False, instead_of=("deck",),
    )  # fmt: skip
    weights: str | Weights | None = make_option(
        "File with the cost per element of each formulation, from d2rpick calibrate.  [default: measured with "
        "OpenRadioss]",
        *("file", "FILE"),
    )
    history: tuple[str, ...] = make_option(
        "History of the reference run, by which the times are judged: file, folder or pattern; repeatable.",
        *("file", "HISTORY"), many=True,
    )  # fmt: skip
    input_format: str = make_option(
        f"Format of the history: auto, which recognises it by content, or {', '.join(READERS)}.",
        *(("auto", *READERS), "FORMAT"), default="auto", short=("-F",),
    )  # fmt: skip
    time: str | None = make_option(
        "Time column, by name, number or HDF5 path.", metavar="NAME|NUMBER"
    )
    energy: tuple[str, ...] = make_option(
        "Energy column, label or HDF5 path; repeat the option to sum several energies.",
        *("channels", "NAME|NUMBER"), many=True, instead_of=("part",),
    )  # fmt: skip
    part: tuple[str, ...] = make_option(
        'Parts to switch: number (3,7), range (10-19), title, "flying" or "all"; their energies are added.',
        *("parts", "IDS"), many=True, instead_of=("energy",),
    )  # fmt: skip
    flying: tuple[str, ...] = make_option(
        "Parts that fly together with the switched parts.", "parts", "IDS", many=True
    )
    channel: tuple[str, ...] = make_option(
        "Channel of another quantity, if d2rpick info does not recognise it: kinetic_energy=E2, x_momentum=7; "
        "repeatable.",
        *("names", "QUANTITY=NAME"), many=True,
    )  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Request(ChoiceOptions, ReadingOptions):
    """A question about a run, with times in the unit of the history; contradictions raise ArgumentError.

    ``given`` contains the names of the options that were given, including those given with their default value.
    """

    stiffness: float | None = _make_oscillator_option("Spring stiffness k.")
    mass: float | None = _make_oscillator_option("Suspended mass M.")
    frame_mass: float | None = _make_oscillator_option(
        "Frame mass m (or give --beta).", POSITIVE, "beta"
    )
    beta: float | None = _make_oscillator_option(
        "Mass ratio M/m (instead of --frame-mass).", POSITIVE, "frame_mass"
    )
    alpha: float | None = _make_oscillator_option(
        "Rate of damping proportional to mass.", NOT_NEGATIVE
    )
    v0: float | None = _make_oscillator_option(
        "Initial velocity of the frame; everything else starts at rest.", TIME, "vz0"
    )
    no_verify: bool = make_option(
        "Do not check pairs with a vibration model; judge by the energy level alone.",
        *("flag",), default=False, instead_of=("stiffness", "fit_window"),
    )  # fmt: skip
    run_folder: str | None = None  # Folder of the run with the files in `history`.
    # True if `deck` was found in the folder of the run.
    deck_in_folder: bool = False
    given: Collection[str] | None = None

    def __post_init__(self) -> None:
        """Refuse options that contradict each other."""
        if self.no_deck and self.deck:
            raise ArgumentError("`deck` and `no_deck` exclude each other")
        if self.folder is None:
            self.check_deck()
        ways = {
            "an oscillator": self._oscillator_given,
            "`fit_window`": self.fit_window,
            "`replay`": self.no_verify,
        }
        chosen = [name for name, value in ways.items() if value]
        if len(chosen) > 1:
            raise ArgumentError(f"{chosen[0]} and {chosen[1]} exclude each other")
        check_window("fit_window", self.fit_window)
        if (
            self.after is not None
            and self.landing is not None
            and not self.after < self.landing
        ):
            raise ArgumentError(
                f"`landing` {self.landing:g} is not after `after` {self.after:g}, the end of the load"
            )

    @property
    def folder(self) -> str | None:
        """Folder of the run, which should contain its main deck; None if the user names or excludes a deck."""
        import os

        if self.deck is not None or self.no_deck:
            return None
        name = self.history[0] if len(self.history) == 1 else ""
        return self.run_folder or (name if os.path.isdir(name) else None)  # noqa: PTH112  Path.is_dir fails on some names

    def check_deck(self) -> None:
        """Refuse options that need a deck if none is given."""
        if self.step_ratio is not None and self.cost_share is None and not self.deck:
            raise ArgumentError(
                "`step_ratio` needs `cost_share` or `deck` too: the CPU time depends on both"
            )
        if self.weights is not None and self.deck is None:
            raise ArgumentError(
                "`weights` needs `deck`, the deck whose elements are weighted"
            )

    @property
    def _oscillator_given(self) -> bool:
        """Return True if an oscillator is given; raise ArgumentError if it is incomplete."""
        names = ("stiffness", "mass", "alpha", "v0")
        given_names = [
            name
            for name in (*names, "frame_mass", "beta")
            if getattr(self, name) is not None
        ]
        ratio_problem = []
        if (self.frame_mass is None) == (self.beta is None):
            ratio_problem = ["needs either `frame_mass` or `beta`, not both"]
        if given_names and (
            missing := [name for name in names if getattr(self, name) is None]
        ):
            wanted = [f"`{name}`" for name in missing]
            needs = [f"needs {' and '.join(wanted)} too", *ratio_problem]
            raise ArgumentError(
                f"`{given_names[0]}` {', and '.join(needs)}: give all parameters of the oscillator"
            )
        if given_names and ratio_problem:
            raise ArgumentError(f"the oscillator {ratio_problem[0]}")
        return bool(given_names)

    @property
    def oscillator(self) -> Oscillator | None:
        """The oscillator that the options define."""
        if self.stiffness is None or self.mass is None or self.alpha is None:
            return None
        from d2rpick.vibration.oscillator import Oscillator

        return Oscillator(
            self.stiffness,
            self.mass,
            self.frame_mass or self.mass / (self.beta or 1.0),
            self.alpha,
        )

    @property
    def settings(self) -> Settings:
        """The settings for choosing and judging pairs."""
        from d2rpick.choice.question import Settings

        mode = None
        oscillator = self.oscillator
        if oscillator is not None and self.v0 is not None:
            # Imported here to keep start-up fast.
            from d2rpick.vibration.oscillator import to_mode

            mode = to_mode(oscillator, self.v0)
        # Options without a value keep the defaults of the settings.
        chosen = {
            name: getattr(self, name)
            for name in _USES
            if getattr(self, name) is not None
        }
        return Settings(**chosen, oscillator=mode, replay=not self.no_verify)

    def selection(self, *, parts: bool = True) -> Selection:
        """Return the selected columns and, with ``parts``, the selected parts; refuse energies that are given twice."""
        from d2rpick.histories.names import Selection

        if parts and self.energy and self.part:
            raise ArgumentError(
                "`energy` and `parts` exclude each other: give columns or parts"
            )
        part = self.part if parts else ()
        return Selection(
            self.time, self.energy, part, self.flying, read_channels(self.channel)
        )

    def asking(self, names: Collection[str] | None = None) -> tuple[str, ...]:
        """Return the given options, or only those in ``names``, as they are typed after a td on the command line."""
        chosen = list(self._given())
        if names is not None:
            chosen = [name for name in chosen if name in names]
        return tuple(
            text
            for name in chosen
            for text in write_option(name, getattr(self, name), many=OPTIONS[name].many)
        )

    def checking(self) -> tuple[str, ...]:
        """Return the options with which ``check`` uses the same history to judge windows."""
        history_options = [
            text for name in self.history for text in ("--history", name)
        ]
        return (*history_options, *self.asking(JUDGING))

    def judging(self) -> tuple[str, ...]:
        """Return the options with which ``card`` uses the same history to judge windows."""
        return (*self.checking(), *self.asking(("part",)))

    def repeat(self, *, without: Collection[str] = ()) -> RepeatedQuestion:
        """Return the parts, options and files with which other commands ask about the same run."""
        from d2rpick.report.formats import RepeatedQuestion

        left_out = {"part", *without}
        names = [name for name in self._given() if name not in left_out]
        of_deck = {"deck", "no_deck"} - left_out
        return RepeatedQuestion(
            parts=self.asking(("part",)),
            options=self.asking(names),
            judging=(*self.judging(), *self.asking(of_deck)),
            checking=self.checking(),
            files=self.history,
        )

    def without_history(self) -> None:
        """Refuse options for judging windows if there is no history; the deck of a card needs none."""
        if lost := [
            name for name in self._given() if name in {*JUDGING, *CHOOSING, "no_deck"}
        ]:
            raise ArgumentError(
                f"`{lost[0]}` needs an energy history; give one with `history`"
            )

    def _given(self) -> Iterator[str]:
        for entry in fields(self):
            if self.given is None:
                is_given = getattr(self, entry.name) != entry.default
            else:
                is_given = entry.name in self.given
            if is_given and entry.name not in _NOT_TYPED:
                yield entry.name


def write_option(name: str, value: Any, *, many: bool) -> Iterator[str]:
    """Yield the words of an option and its value as typed; ``many`` is True if the option has several values."""
    if isinstance(value, bool):
        yield from (f"--{make_option_name(name)}",) * value
        return
    for single_value in value if many else [value]:
        words = single_value if isinstance(single_value, tuple) else (single_value,)
        yield from (
            f"--{make_option_name(name)}",
            *(word if isinstance(word, str) else _write_word(word) for word in words),
        )


def _write_word(value: Any) -> str:
    return repr(value) if isinstance(value, int | float) else _IN_MEMORY


def _explain_missing_name(text: str, quantities: tuple[str, ...]) -> str:
    """Return the message on a channel without the name of a column."""
    from d2rpick.histories.names import suggest_name

    quantity = text.strip("= ").replace("-", "_")
    if quantity in quantities:
        return f"`channels` {text}: the name of its column is missing; write {quantity}=NAME, such as {quantity}=E2"
    near = suggest_name(quantity, quantities)
    known = near or f", where QUANTITY is one of {', '.join(quantities)}"
    return (
        f"`channels` {text}: QUANTITY=NAME was expected, such as kinetic_energy=NAME, with the name of a "
        f"column{known}"
    )


def read_channels(texts: Collection[str]) -> tuple[tuple[str, str], ...]:
    """Read ``QUANTITY=NAME``; raise ArgumentError if the quantity is unknown or occurs twice."""
    from d2rpick.histories.names import QUANTITIES, suggest_name

    for text in texts:
        if not text.partition("=")[2]:
            raise ArgumentError(_explain_missing_name(text, tuple(QUANTITIES)))
    split = (text.partition("=") for text in texts)
    pairs = [(quantity.strip().replace("-", "_"), name) for quantity, _, name in split]
    for quantity, name in pairs:
        if quantity not in QUANTITIES:
            near = suggest_name(quantity, tuple(QUANTITIES))
            known = near or f", but one of {', '.join(QUANTITIES)} was expected"
            raise ArgumentError(
                f"`channels` {quantity}={name}: unknown quantity {quantity!r}{known}"
            )
    if len({quantity for quantity, _ in pairs}) < len(pairs):
        raise ArgumentError("`channels` names a quantity twice; name each once")
    return tuple(pairs)


def check_window(name: str, window: tuple[float, float] | None) -> None:
    """Refuse an empty time window."""
    if window and not window[0] < window[1]:
        raise ArgumentError(
            f"`{name}` {window[0]:g} {window[1]:g} is empty; give the lower time first"
        )


def choose_time_or_window(
    td: float | None, window: tuple[float, float] | None
) -> float | tuple[float, float] | None:
    """Return the given td or the range for td; raise ArgumentError if both are given."""
    if td is not None and window is not None:
        raise ArgumentError(
            "`td` and `td_window` exclude each other: give `td` to keep that time, `td_window` to have it chosen"
        )
    check_window("td_window", window)
    return window if td is None else td


OPTIONS: Final[Mapping[str, Option]] = list_options(Request)
