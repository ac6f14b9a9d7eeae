"""The answer of ``calibrate`` as table, JSON and the TOML file that ``--weights`` reads."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from d2rpick.choice.cost import MEASURED
from d2rpick.choice.weights_file import written
from d2rpick.errors import printable
from d2rpick.report import keys, tables
from d2rpick.version import __version__

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.choice.calibration import Calibration, Observation

SCHEMA = "d2rpick/calibrate/1"
HEAD = ("formulation", "weight", "measured with OpenRadioss", "by")
COLUMNS = ("formulation", "weight", "measured", "told")
LEG_HEAD = ("leg", "step", "elements", "rigid nodes")


def as_table(found: Calibration) -> str:
    """The weights beside those that were measured, and the legs they rest on."""
    weights = found.weights
    lines = [
        tables.as_text(HEAD, _rows(found)), "",
        f"elements of a step  {weights.element_share:.3f}",
        f"node of a body      {weights.rigid_node:.3g} us",
        f"misfit              {found.misfit:.1%} of the time of a leg", "",
        tables.as_text(LEG_HEAD, _legs(found)),
    ]  # fmt: skip
    return "\n".join(lines)


def as_markdown(found: Calibration) -> str:
    """The weights and the legs as Markdown tables."""
    return "\n\n".join([tables.as_markdown(HEAD, _rows(found)), tables.as_markdown(LEG_HEAD, _legs(found))])


def as_csv(found: Calibration) -> str:
    """A row per formulation."""
    return tables.as_csv(COLUMNS, plain_rows(found)).rstrip("\n")


def as_toml(found: Calibration) -> str:
    """The file that ``--weights`` reads."""
    return written(found.weights)


def as_json(found: Calibration, command: Sequence[str]) -> str:
    """Everything by schema d2rpick/calibrate/1; times in us per cycle."""
    return tables.as_json(
        {
            "schema": SCHEMA,
            "tool_version": __version__,
            "command": list(command),
            "warnings": keys.of_warnings(found.cautions),
            "element_share": found.weights.element_share,
            "rigid_node": found.weights.rigid_node,
            "per_element": dict(found.weights.per_element),
            "told": list(found.told),
            "misfit": found.misfit,
            "legs": [_leg(one) for one in found.observations],
        }
    )


def _leg(one: Observation) -> dict[str, Any]:
    return {
        "name": one.name,
        "counts": dict(one.counts),
        "rigid_nodes": one.rigid_nodes,
        "step_time": one.total,
        "element_time": one.elements,
    }


def plain_rows(found: Calibration) -> list[list[tables.Cell]]:
    """Cells of a row per formulation at full precision, below ``COLUMNS``."""
    return [[name, weight, MEASURED[name], name in found.told] for name, weight in found.weights.per_element.items()]


def _rows(found: Calibration) -> list[list[tables.Cell]]:
    return [
        [name, f"{weight:.3g}", f"{MEASURED[name]:.3g}", "these legs" if name in found.told else "ratio as measured"]
        for name, weight in found.weights.per_element.items()
    ]


def _legs(found: Calibration) -> list[list[tables.Cell]]:
    return [
        [printable(one.name), f"{one.total:.4g} us", None if one.elements is None else f"{one.elements:.4g} us",
         f"{one.rigid_nodes:.0f}"]
        for one in found.observations
    ]  # fmt: skip
