"""Rigid bodies that no leg of a Radioss run switches, in a run that switches others: they are rigid all along."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from d2rpick.deck.radioss.starter import rigid_parts
from d2rpick.errors import are, in_rows, name_units

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.deck.radioss.files import Run
    from d2rpick.deck.rows import Field
    from d2rpick.deck.windows import Window


class LeftRigid(NamedTuple):
    """Parts that lie whole in such bodies, where to put them off, what is wrong, and how it is mended."""

    parts: tuple[int, ...]
    place: Field
    found: str
    way_out: str


def left_rigid(run: Run, windows: Sequence[Window]) -> LeftRigid | None:
    """Find the bodies that no leg names, of a run with ``windows``, where they hold whole parts."""
    if run.starter is None or run.starter.moved or not windows:
        return None
    named = {node.value for leg in run.legs for _, _, nodes in leg.switched for node in nodes}
    bodies = [body for body in run.starter.bodies if not body.sensor and body.node.value not in named]
    parts = rigid_parts(run.starter, {body.node.value: body.group for body in bodies}) if bodies else {}
    bodies = [body for body in bodies if parts.get(body.node.value)]
    held = sorted({part for body in bodies for part in parts[body.node.value]})
    if not held:
        return None
    places = [card.here for card, _, _ in run.legs[0].switched]
    ids, mains = (in_rows(number) for number in ((body.id for body in bodies), (body.node.value for body in bodies)))
    found = f"no leg switches /RBODY {', '.join(ids)}, so {name_units(held)} {are(held)} rigid from time 0 to the end"
    way_out = f"name main node{'s' * (len(bodies) > 1)} {', '.join(mains)} in the /RBODY/OFF of every leg"
    return LeftRigid(tuple(held), places[0] if places else run.legs[0].run.here, found, way_out)
