"""Write the result of ``calibrate`` as a table, JSON, CSV or Markdown, and as the TOML file for ``--weights``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import list_names, make_printable
from d2rpick.choice.pair.grades import USE, USE_WITH_CARE
from d2rpick.choice.parts.cost import MEASURED, POINT, format_weights_as_toml
from d2rpick.report import keys, tables
from d2rpick.report.fields import Document, Field, each, many, row
from d2rpick.report.next_step import write_command

if TYPE_CHECKING:
    from d2rpick.choice.parts.calibration import FittedWeights
    from d2rpick.report.formats import DisplayOptions, RepeatedQuestion

_LEG: Final = row(
    Field("name", "text", "name of the engine run or restart segment"),
    Field("counts", each("number"), "number of deformable elements by formulation"),
    Field("rigid_nodes", "number", "number of nodes of rigid bodies"),
    Field("step_time", "number", "CPU time of one time step", lambda leg: leg.total),
    Field(
        "element_time",
        "number?",
        "CPU time that the elements take in one time step; null if the solver lists only the total",
        lambda leg: leg.elements,
    ),
)
DOCUMENT: Final = Document("d2rpick/calibrate/1", "Answer of d2rpick calibrate; times in µs per cycle.", row(
    keys.WARNINGS,
    Field("element_share", "number", "fraction of a time step of the deformable model that is spent on elements",
          lambda ours: ours.weights.element_share),
    Field("rigid_node", "number", "cost of a node of a rigid body", lambda ours: ours.weights.rigid_node),
    Field("per_element", each("number"), "cost of an element by formulation", lambda ours: ours.weights.per_element),
    Field("told", "texts", "costs that these runs determine; the other costs keep the built-in ratio"),
    Field("misfit", "number", "rms difference between measured and fitted CPU times, relative to the measured times"),
    Field("legs", many(_LEG), "engine runs or restart segments to which the costs were fitted"),
), closed=True)  # fmt: skip
HEAD = ("formulation", "weight [us]", "built-in [us]", "source")
COLUMNS = ("formulation", "weight", "measured", "told")
LEG_HEAD = (
    "run",
    "CPU time of a step",
    "CPU time of elements",
    "rigid nodes",
)
# Weights with a misfit up to this need no caution [-]; it is twice the CPU-time error that the fit assumes.
_SMALL_MISFIT: Final = 0.1
# Names of formulations that the solvers do not have.
_IN_WORDS: Final = {POINT: "integration point"}
# File for the weights in the next command.
_FILE: Final = "weights.toml"


def as_table(calibration: FittedWeights, display: DisplayOptions) -> str:
    """Return a table of each formulation's assumed and fitted weight, and a table of the restart segments used."""
    weights = calibration.weights
    lines = [
        *tables.format_in_line(list_verdict_lines(calibration, display.question)), "",
        tables.as_text(HEAD, _list_weight_rows(calibration), display.width), "",
        f"fraction of a time step spent on elements  {weights.element_share:.3f}",
        f"cost per node of a rigid body              {weights.rigid_node:.3g} us",
        f"misfit                                     {calibration.misfit:.1%} of the CPU time of an engine run", "",
        tables.as_text(LEG_HEAD, _list_leg_rows(calibration), display.width),
    ]  # fmt: skip
    return "\n".join(lines)


def list_verdict_lines(
    calibration: FittedWeights, question: RepeatedQuestion
) -> list[tuple[str, str]]:
    """Return whether to use the weights, why, and the command that writes them, as (name, sentence) pairs."""
    misfit = calibration.misfit
    verdict = USE if misfit <= _SMALL_MISFIT else USE_WITH_CARE
    runs = len(calibration.legs)
    counted = f"{runs} engine run{'s' * (runs != 1)}"
    lines = [
        (verdict, f"weights that fit the CPU time of {counted} within {misfit:.1%}")
    ]
    built_in = [
        _IN_WORDS.get(name, name)
        for name in calibration.weights.per_element
        if name not in calibration.told
    ]
    if len(built_in) > 1:
        ratio = f"the ratios of {list_names(built_in)} are the built-in ones"
        lines.append(("why", f"{ratio}, because these runs do not distinguish them"))
    if verdict != USE:
        cure = "repeat the runs, each alone on the machine, or give more runs"
        lines.append(("to improve", cure))
    covered = [
        name for name in calibration.weights.per_element if name not in _IN_WORDS
    ]
    others = "any other formulation keeps its built-in weight, scaled to these"
    lines.append(("covers", f"{list_names(covered)}; {others}"))
    line = write_command(question, "calibrate", "-f", "toml", "-o", _FILE)
    step = f"to give plan or parts --weights {_FILE}, write the weights with {line}"
    return [*lines, ("next", step)]


def as_markdown(calibration: FittedWeights, display: DisplayOptions) -> str:
    """Return whether to use the weights, and the weights and the restart segments as Markdown tables."""
    verdict_lines = list_verdict_lines(calibration, display.question)
    return "\n\n".join(
        [
            *tables.format_as_list(verdict_lines),
            tables.as_markdown(HEAD, _list_weight_rows(calibration)),
            tables.as_markdown(LEG_HEAD, _list_leg_rows(calibration)),
        ]
    )


def as_csv(calibration: FittedWeights, _: DisplayOptions) -> str:
    """Return CSV with one row per formulation."""
    return tables.as_csv(COLUMNS, list_plain_rows(calibration)).rstrip("\n")


def as_toml(calibration: FittedWeights, _: DisplayOptions) -> str:
    """Return the TOML file that ``--weights`` reads."""
    return format_weights_as_toml(calibration.weights)


def list_plain_rows(calibration: FittedWeights) -> list[list[tables.Cell]]:
    """Return one row of cells per formulation at full precision, in the order of ``COLUMNS``."""
    return [
        [name, weight, MEASURED[name], name in calibration.told]
        for name, weight in calibration.weights.per_element.items()
    ]


def _list_weight_rows(calibration: FittedWeights) -> list[list[tables.Cell]]:
    return [
        [
            _IN_WORDS.get(name, name),
            f"{weight:.3g}",
            f"{MEASURED[name]:.3g}",
            "these runs" if name in calibration.told else "built-in ratio",
        ]
        for name, weight in calibration.weights.per_element.items()
    ]


def _list_leg_rows(calibration: FittedWeights) -> list[list[tables.Cell]]:
    return [
        [make_printable(leg.name), f"{leg.total:.4g} us", None if leg.elements is None else f"{leg.elements:.4g} us",
         f"{leg.rigid_nodes:.0f}"]
        for leg in calibration.legs
    ]  # fmt: skip
