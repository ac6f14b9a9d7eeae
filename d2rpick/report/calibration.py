"""The answer of ``calibrate`` as table, JSON and the TOML file that ``--weights`` reads."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import make_printable
from d2rpick.choice.cost import MEASURED, weights_as_toml
from d2rpick.report import keys, tables
from d2rpick.report.fields import Document, Field, each, many, row

if TYPE_CHECKING:
    from d2rpick.choice.calibration import Calibration
    from d2rpick.report.formats import Shown

_LEG: Final = row(
    Field("name", "text"),
    Field("counts", each("number")),
    Field("rigid_nodes", "number"),
    Field("step_time", "number", get=lambda leg: leg.total),
    Field("element_time", "number?", get=lambda leg: leg.elements),
)
DOCUMENT: Final = Document("d2rpick/calibrate/1", "Answer of d2rpick calibrate; times in us per cycle.", row(
    keys.WARNINGS,
    Field("element_share", "number", "share of the elements in a deformable step",
          lambda ours: ours.weights.element_share),
    Field("rigid_node", "number", "cost of a node of a rigid body", lambda ours: ours.weights.rigid_node),
    Field("per_element", each("number"), "cost of an element by formulation", lambda ours: ours.weights.per_element),
    Field("told", "texts", "what the legs decide; the others keep the measured ratio"),
    Field("misfit", "number"),
    Field("legs", many(_LEG)),
), closed=True)  # fmt: skip
HEAD = ("formulation", "weight", "measured with OpenRadioss", "by")
COLUMNS = ("formulation", "weight", "measured", "told")
LEG_HEAD = ("leg", "step", "elements", "rigid nodes")


def as_table(found: Calibration, shown: Shown) -> str:
    """The weights beside those that were measured, and the legs they rest on."""
    weights = found.weights
    lines = [
        tables.as_text(HEAD, _rows(found), shown.width), "",
        f"elements of a step  {weights.element_share:.3f}",
        f"node of a body      {weights.rigid_node:.3g} us",
        f"misfit              {found.misfit:.1%} of the time of a leg", "",
        tables.as_text(LEG_HEAD, _legs(found), shown.width),
    ]  # fmt: skip
    return "\n".join(lines)


def as_markdown(found: Calibration, _: Shown) -> str:
    """The weights and the legs as Markdown tables."""
    return "\n\n".join(
        [
            tables.as_markdown(HEAD, _rows(found)),
            tables.as_markdown(LEG_HEAD, _legs(found)),
        ]
    )


def as_csv(found: Calibration, _: Shown) -> str:
    """A row per formulation."""
    return tables.as_csv(COLUMNS, plain_rows(found)).rstrip("\n")


def as_toml(found: Calibration, _: Shown) -> str:
    """The file that ``--weights`` reads."""
    return weights_as_toml(found.weights)


def plain_rows(found: Calibration) -> list[list[tables.Cell]]:
    """Cells of a row per formulation at full precision, below ``COLUMNS``."""
    return [
        [name, weight, MEASURED[name], name in found.told]
        for name, weight in found.weights.per_element.items()
    ]


def _rows(found: Calibration) -> list[list[tables.Cell]]:
    return [
        [
            name,
            f"{weight:.3g}",
            f"{MEASURED[name]:.3g}",
            "these legs" if name in found.told else "ratio as measured",
        ]
        for name, weight in found.weights.per_element.items()
    ]


def _legs(found: Calibration) -> list[list[tables.Cell]]:
    return [
        [make_printable(one.name), f"{one.total:.4g} us", None if one.elements is None else f"{one.elements:.4g} us",
         f"{one.rigid_nodes:.0f}"]
        for one in found.legs
    ]  # fmt: skip
