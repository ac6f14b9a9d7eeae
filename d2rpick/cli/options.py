"""Options that several commands share: defined once, same name and help everywhere."""

from __future__ import annotations

from functools import wraps
from typing import TYPE_CHECKING, Any, NamedTuple

import click
from click.core import ParameterSource

from d2rpick.cli import values
from d2rpick.cli.typed import JUDGING, dashed, judging

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from d2rpick.choice.ranking import Quality
    from d2rpick.choice.settings import Settings
    from d2rpick.histories.opening import Run, Selection
    from d2rpick.vibration.modes import Mode
    from d2rpick.vibration.oscillator import Oscillator

# Kinds of values, under the names by which commands ask for them.
CHANNELS, FILE, NAMES, PARTS = values.CHANNELS, values.FILE, values.NAMES, values.PARTS
TIME, POSITIVE, NOT_NEGATIVE, FRACTION = values.TIME, values.POSITIVE, values.NOT_NEGATIVE, values.FRACTION
STEP_RATIO = values.AT_LEAST_ONE  # elements that are rigid no longer limit the step: it cannot become smaller
FORMATS = values.FORMATS
Decorated = Any  # a command function; click's decorators do not say more


class Either(click.Option):
    """An option that excludes others: what the environment says of it gives way to those on the command line."""

    def __init__(self, *args: Any, instead_of: Sequence[str], **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.instead_of = instead_of

    def consume_value(self, ctx: click.Context, opts: Any) -> tuple[Any, ParameterSource]:
        """Find the value and its source; click has done so before for all that is on the command line."""
        value, source = super().consume_value(ctx, opts)
        typed = (ctx.get_parameter_source(name) is ParameterSource.COMMANDLINE for name in self.instead_of)
        if source is ParameterSource.ENVIRONMENT and any(typed):
            return self.get_default(ctx), ParameterSource.DEFAULT
        return value, source


def _stack(*decorators: Callable[[Decorated], Decorated]) -> Callable[[Decorated], Decorated]:
    def apply(function: Decorated) -> Decorated:
        for decorator in reversed(decorators):
            function = decorator(function)
        return function

    return apply


_AFTER = click.option("--after", type=TIME, metavar="T", help="End of the load.  [default: found from the record]")
_MARGIN = click.option(
    "--margin", type=NOT_NEGATIVE, metavar="T",
    help="Time to keep clear after the load and before the next contact.  [default: 0; where td is chosen, derived]",
)  # fmt: skip
_TOLERANCE = click.option(
    "--tolerance", type=FRACTION, default=0.2, show_default=True, metavar="L",
    help="Limit on the lock-in error, or on the level error where no oscillator is known.",
)  # fmt: skip
EXIT_ZERO = click.option("--exit-zero", is_flag=True, help="Exit with 0 instead of 1 when the answer is an objection.")
MIN_QUALITY = click.option(
    "--min-quality", type=click.Choice(["good", "fair"]), help="Exit with 1 where the pair is worse than that."
)
_FORMAT = click.option(
    "-F", "--input-format", type=click.Choice(["auto", *FORMATS]), default="auto", show_default=True,
    help="Format of the history; auto recognises it by content.",
)  # fmt: skip
_TIME = click.option("--time", metavar="NAME|NUMBER", help="Time column, by name, number or HDF5 path.")
_ENERGY = click.option(
    "--energy", metavar="NAME|NUMBER", multiple=True, type=CHANNELS, cls=Either, instead_of=("part",),
    help="Energy column, label or HDF5 path; repeat it to add several.",
)  # fmt: skip
_CHANNEL = click.option(
    "--channel", metavar="QUANTITY=NAME", multiple=True, type=NAMES,
    help="Channel of another quantity, where its name is unusual: kinetic_energy=E2, x_momentum=7; repeatable.",
)  # fmt: skip
_FLYING = click.option(
    "--flying", metavar="IDS", multiple=True, type=PARTS, help="Parts that fly together with the switched parts."
)


def history_options(function: Decorated) -> Decorated:
    """HISTORY... and how to read it; collected by ``selection`` and ``open_run``."""
    argument = click.argument("history", metavar="HISTORY...", nargs=-1, required=True, type=FILE)
    return _stack(argument, reading_options)(function)


def reading_options(function: Decorated) -> Decorated:
    """How to read a history; collected by ``selection``."""
    return _stack(
        _FORMAT, _TIME, _ENERGY,
        click.option(
            "--part", metavar="IDS", multiple=True, type=PARTS, cls=Either, instead_of=("energy",),
            help="Parts to switch: number (3,7), range (10-19), title, `flying` or `all`; energies are added.",
        ),
        _FLYING, _CHANNEL,
    )(function)  # fmt: skip


def reference_options(function: Decorated) -> Decorated:
    """``--history``, how to read it, and how to judge by it; for commands that also do without one."""
    return _stack(
        click.option(
            "--history", metavar="HISTORY", multiple=True, type=FILE,
            help="Energy history of the run without switching to judge by: file, folder or glob; repeatable.",
        ),
        _FORMAT, _TIME, _ENERGY, _FLYING, _CHANNEL, _AFTER, _MARGIN, _TOLERANCE,
    )(function)  # fmt: skip


def output_options(*formats: str) -> Callable[[Decorated], Decorated]:
    """Where the result goes, and in which of ``formats``, the first by default."""

    def apply(function: Decorated) -> Decorated:
        return _stack(
            click.option(
                "-f", "--output-format", type=click.Choice(formats), default=formats[0], show_default=True,
                help="Format of the result.",
            ),
            EXIT_ZERO,
        )(file_options(function))  # fmt: skip

    return apply


def file_options(function: Decorated) -> Decorated:
    """Where the result goes."""
    return _stack(
        click.option(
            "-o", "--output-file", metavar="FILE", type=FILE, help="Write the result to FILE, completely or not at all."
        ),
        click.option("--overwrite", is_flag=True, help="Replace existing files."),
        click.option("-q", "--quiet", is_flag=True, help="Print no notes and warnings to stderr."),
        click.option(
            "-v", "--verbose", is_flag=True, expose_value=False, callback=_remember("verbose"),
            help="Say on stderr what was read and how long it took.",
        ),
        click.option(
            "--show-settings", is_flag=True, expose_value=False, callback=_remember("show-settings"),
            help="Print every option with its value and its source, and do nothing else.",
        ),
        click.option(
            "--debug", is_flag=True, expose_value=False, callback=_remember("debug"),
            help="Show the traceback of an error.",
        ),
    )(_unless_shown(function))  # fmt: skip


def oscillator_options(*, required: bool) -> Callable[[Decorated], Decorated]:
    """Parameters of the floating oscillator."""
    rest = "" if required else "; all else at rest"

    def given(name: str, *instead_of: str, **kwargs: Any) -> Callable[[Decorated], Decorated]:
        return click.option(name, cls=Either, instead_of=(*instead_of, "fit_window", "no_verify"), **kwargs)

    return _stack(
        given("--stiffness", type=POSITIVE, required=required, help="Spring k."),
        given("--mass", type=POSITIVE, required=required, help="Suspended mass M."),
        given("--frame-mass", "beta", type=POSITIVE, help="Frame mass m (or give --beta)."),
        given("--beta", "frame_mass", type=POSITIVE, help="Mass ratio M/m (instead of --frame-mass)."),
        given(
            "--alpha", type=NOT_NEGATIVE, default=0.0 if required else None, show_default=required,
            help="Rate of damping proportional to mass.",
        ),
        given("--v0", "vz0", type=TIME, help=f"Velocity of the frame at time 0{rest}."),
    )  # fmt: skip


def choosing_options(function: Decorated) -> Decorated:
    """Options of ``suggest`` and ``verify``; collected by ``settings``."""
    return _stack(
        judging_options,
        click.option(
            "--cost-share", type=FRACTION, metavar="C",
            help="Share of the cost of a time step spent on the elements of the switched parts; gives the run time.",
        ),
        click.option(
            "--step-ratio", type=STEP_RATIO, metavar="N",
            help="Time step while rigid over that before, 1 or more.  [default: 1]",
        ),
        click.option("--plot", metavar="FILE", type=FILE, help="Draw energy and motion to FILE (png, svg, pdf)."),
        click.option(
            "--report", metavar="FILE", type=FILE, help="Write everything to one HTML page to read, print and sign."
        ),
    )(function)  # fmt: skip


def judging_options(function: Decorated) -> Decorated:
    """How to judge a tr; collected by ``settings``."""
    return _stack(
        _AFTER,
        _MARGIN,
        _TOLERANCE,
        click.option(
            "--max-kinetic-share", type=NOT_NEGATIVE, metavar="K", help="Reject a td with a larger kinetic share.",
        ),
        click.option("--max-residual", type=NOT_NEGATIVE, metavar="R", help="Reject a pair with a larger residual."),
        oscillator_options(required=False),
        click.option(
            "--fit-window", type=(TIME, TIME), metavar="LO HI", cls=Either, instead_of=("stiffness", "no_verify"),
            help="Identify the oscillator only here.",
        ),
        click.option(
            "--no-verify", is_flag=True, cls=Either, instead_of=("stiffness", "fit_window"),
            help="Judge by the energy level alone, without an oscillator.",
        ),
        click.option(
            "--strict", is_flag=True, help="Recommend nothing where the energy alone shows when the load is over."
        ),
    )(function)  # fmt: skip


def selection(options: dict[str, Any]) -> Selection:
    """Collect what of a run is asked for; UsageError when energies are asked for in two ways."""
    from d2rpick.histories.opening import Selection

    parts = options.get("part", ())
    if options["energy"] and parts:
        raise click.UsageError("--energy and --part exclude each other: give columns or parts")
    return Selection(
        options["time"], options["energy"], parts, options["flying"], _channels(options["channel"]),
        options.get("springs"),
    )  # fmt: skip


def _channels(given: tuple[str, ...]) -> tuple[tuple[str, str], ...]:
    """Read ``QUANTITY=NAME``; UsageError for a quantity that is none, or one that is given twice."""
    from d2rpick.histories.names import QUANTITIES

    pairs = [
        (quantity.strip().replace("-", "_"), name) for quantity, _, name in (text.partition("=") for text in given)
    ]
    for quantity, name in pairs:
        if quantity not in QUANTITIES or not name:
            raise click.UsageError(
                f"--channel {quantity}={name}: QUANTITY=NAME was expected, with one of {', '.join(QUANTITIES)}"
            )
    if len({quantity for quantity, _ in pairs}) < len(pairs):
        raise click.UsageError("--channel names a quantity twice; name each once")
    return tuple(pairs)


class Reading(NamedTuple):
    """What is read, and how: the options of ``history_options``."""

    names: tuple[str, ...]
    selection: Selection
    input_format: str
    quiet: bool

    @classmethod
    def of(cls, options: dict[str, Any]) -> Reading:
        """Take the options as they were given; UsageError when energies are asked for in two ways."""
        click.get_current_context().meta["d2rpick.history"] = options["history"]
        return cls(options["history"], selection(options), options["input_format"], options["quiet"])

    def open(self) -> Run:
        """Open the run."""
        from d2rpick.histories.opening import open_run

        return open_run(self.names, self.selection, self.input_format)


class Extras(NamedTuple):
    """What is written beside the result: a figure, and a page with the options that judge by the same history."""

    plot: str | None
    report: str | None
    judging: tuple[str, ...]

    @classmethod
    def of(cls, options: dict[str, Any]) -> Extras:
        """Take the options as they were given."""
        return cls(options["plot"], options["report"], tuple(judging(options)))


def reference(options: dict[str, Any]) -> tuple[Run, Settings] | None:
    """Open what the options of ``reference_options`` name; UsageError when they say how to judge but not by what."""
    if not options["history"]:
        source = click.get_current_context().get_parameter_source
        lost = [name for name in JUDGING if source(name) is not click.core.ParameterSource.DEFAULT]
        if lost:
            raise click.UsageError(f"--{dashed(lost[0])} needs an energy history; give one with --history")
        return None
    from d2rpick.choice.settings import Settings

    judging = Settings(after=options["after"], margin=options["margin"], tolerance=options["tolerance"])
    return Reading.of({**options, "part": ()}).open(), judging


def oscillator(options: dict[str, Any]) -> Oscillator | None:
    """Build the oscillator that the options give, None when they give none; UsageError when they give half of one."""
    names = ("stiffness", "mass", "alpha", "v0")
    given = [name for name in (*names, "frame_mass", "beta") if options[name] is not None]
    if not given:
        return None
    missing = [name for name in names if options[name] is None]
    if missing:
        raise click.UsageError(
            f"--{dashed(given[0])} needs --{dashed(missing[0])} too: give all parameters of the oscillator"
        )
    if (options["frame_mass"] is None) == (options["beta"] is None):
        raise click.UsageError("the oscillator needs either --frame-mass or --beta")
    from d2rpick.vibration.oscillator import Oscillator

    mass, frame_mass = options["mass"], options["frame_mass"]
    return Oscillator(options["stiffness"], mass, frame_mass or mass / options["beta"], options["alpha"])


def settings(options: dict[str, Any]) -> Settings:
    """Collect the options of ``choosing_options``; UsageError where they contradict each other."""
    from d2rpick.choice.settings import Settings

    given, window = oscillator(options), options["fit_window"]
    ways = {"an oscillator": given, "--fit-window": window, "--no-verify": options["no_verify"]}
    chosen = [name for name, value in ways.items() if value]
    if len(chosen) > 1:
        raise click.UsageError(f"{chosen[0]} and {chosen[1]} exclude each other")
    cost_share, step_ratio = options.get("cost_share"), options.get("step_ratio")
    if step_ratio is not None and cost_share is None and not options.get("deck"):
        raise click.UsageError("--step-ratio needs --cost-share or --deck too: the run time needs both")
    if window and not window[0] < window[1]:
        raise click.UsageError(f"--fit-window {window[0]:g} {window[1]:g} is empty; give the lower time first")
    return Settings(
        after=options["after"],
        margin=options["margin"],
        tolerance=options["tolerance"],
        max_kinetic_share=options["max_kinetic_share"],
        max_residual=options["max_residual"],
        oscillator=_mode_of(given, options["v0"]) if given else None,
        fit_window=window,
        replay=not options["no_verify"],
        strict=options["strict"],
        cost_share=cost_share,
        step_ratio=step_ratio or 1.0,
    )


def _mode_of(oscillator: Oscillator, v0: float) -> Mode:
    from d2rpick.vibration.oscillator import to_mode  # not above: mostly none is given

    return to_mode(oscillator, v0)


def falls_short(quality: Quality | None, wanted: str | None) -> bool:
    """Whether a pair is worse than --min-quality asks for."""
    if wanted is None or quality is None:
        return False
    from d2rpick.choice.ranking import GRADES

    return GRADES.index(quality.grade) < GRADES.index(wanted)


def _remember(name: str) -> Callable[[click.Context, click.Parameter, bool], None]:
    """Keep a flag that no command asks for itself."""

    def keep(ctx: click.Context, _: click.Parameter, value: bool) -> None:
        ctx.meta[f"d2rpick.{name}"] = value

    return keep


def _unless_shown(function: Decorated) -> Decorated:
    """Let a command show its settings instead of running, where that is asked for."""

    @wraps(function)
    def run(*args: Any, **kwargs: Any) -> Any:
        context = click.get_current_context()
        if not context.meta.get("d2rpick.show-settings"):
            return function(*args, **kwargs)
        from d2rpick.cli.settings_shown import show

        return show(context)

    return run
