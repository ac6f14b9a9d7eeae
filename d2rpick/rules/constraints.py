"""D2R112, D2R113, D2R116: what holds on to switched parts, and solids whose stresses do not turn with them."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Final

from d2rpick.deck.constraints import read_constraints
from d2rpick.deck.elements import nodes_of
from d2rpick.errors import name_units
from d2rpick.rules.base import BOTH, Example, Rule, Severity
from d2rpick.rules.example_decks import BACK, END, GOOD, HEAD, PARTS, THERE, automatic

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.deck.card import Field
    from d2rpick.deck.constraints import Constraint
    from d2rpick.deck.switching import Header
    from d2rpick.rules.base import Case, Objection

_DELETED = 1  # NRBF, NCSF


def _held(case: Case, *, nodal: bool) -> Iterator[Objection]:
    """Constraints on parts that cards make rigid while leaving the constraints active."""
    switched = _left_active(case, nodal=nodal)
    wanted = (
        [one for one in read_constraints(case.deck) if (one.kind == "nodal rigid body") == nodal] if switched else []
    )
    owner = nodes_of(case.deck, switched) if wanted else {}
    for constraint in wanted:
        part = _on(constraint, owner, switched)
        if part is None:
            continue
        name = f"{constraint.kind} {constraint.id}" if constraint.id else constraint.kind
        flag = "NRBF" if nodal else "NRBF and NCSF"
        place = switched[part].nrbf.field
        yield (
            constraint.place,
            (
                f"{name} on part {part}, which is made rigid at {place.file}:{place.line} with {flag} "
                f"{switched[part].nrbf.value}: it stays active; delete it there (1) and activate it on the way back (2)"
            ),
        )


def _left_active(case: Case, *, nodal: bool) -> dict[int, Header]:
    """Parts made rigid by cards that delete nothing, with the first such card."""
    found: dict[int, Header] = {}
    for event in case.windows.events:
        header = event.by.header
        if not event.line.to_rigid or event.unit.is_set or header is None:
            continue
        flags = [header.nrbf] if nodal else [header.nrbf, header.ncsf]
        if all(flag.value != _DELETED for flag in flags):
            found.setdefault(event.unit.id, header)
    return found


def _on(constraint: Constraint, owner: dict[int, int], switched: dict[int, Header]) -> int | None:
    if constraint.part in switched:
        return constraint.part
    return next((owner[node] for node in sorted(constraint.nodes) if node in owner), None)


def _unturned(case: Case) -> Iterator[Objection]:
    loaded = [window for window in case.windows.windows if window.td is not None and window.tr > 0]
    formulations = case.unturned if loaded else {}
    by_form: dict[str, list[int]] = {}
    place: dict[str, Field] = {}
    for window in loaded:
        if window.part is not None and window.part in formulations:
            form = formulations[window.part]
            by_form.setdefault(form, []).append(window.part)
            place.setdefault(form, window.opened.line.part.field)
    for form, parts in by_form.items():
        yield (
            place[form],
            (
                f"{name_units(parts)} of solids that do not co-rotate ({form}): the stresses locked in do not turn "
                "with the rigid body; expect an error after a large rotation"
            ),
        )


_MESH: Final = "*ELEMENT_SHELL\n       1       1       1       2       3       4\n"
_SET: Final = "*SET_NODE_LIST\n         5\n         3         4        99\n"
_NODAL: Final = "*CONSTRAINED_NODAL_RIGID_BODY\n         9         0         5\n"
_EXTRA: Final = "*CONSTRAINED_EXTRA_NODES_NODE\n         8         3\n"
_JOINT: Final = "*CONSTRAINED_JOINT_REVOLUTE\n" + "".join(f"{node:10d}" for node in (3, 3, 50, 51, 52, 53)) + "\n"
_COUNTS: Final = "         0         0         0       0.0         1         0"


def _constrained(text: str, flags: str = "         0         0") -> Example:
    there = THERE.replace(_COUNTS, flags + _COUNTS[20:])
    return Example(HEAD + PARTS + _MESH + _SET + text + there + BACK + END)


def _solid(elform: str, tr: str = "0.02") -> Example:
    cards = automatic(1, tr, rigid=["1"]) + BACK
    return Example(HEAD + PARTS + f"*SECTION_SOLID\n         1{elform:>10s}\n" + cards + END)


RULES: Final = (
    Rule(
        "D2R112",
        Severity.ERROR,
        "a nodal rigid body on a switched part stays active (NRBF)",
        "A node cannot belong to two rigid bodies. A nodal rigid body on a part that is made rigid must be deleted by "
        "the same card (NRBF 1) and activated again on the way back (2); else the run stops (Error 30164, as a public "
        "drop tool reports). Source: vendor keyword data for NRBF, which says that such bodies cause instabilities.",
        partial(_held, nodal=True),
        (Example(GOOD), _constrained(_NODAL, "         1         0"), _constrained(_NODAL.replace("   5\n", "   6\n"))),
        (_constrained(_NODAL), _constrained(_NODAL, "         2         1")),
    ),
    Rule(
        "D2R113",
        Severity.WARNING,
        "extra nodes or a joint on a switched part stay active (NRBF, NCSF)",
        "Extra nodes and joints tie nodes to a rigid body; on a part that a card makes rigid the nodes then belong to "
        "two. The vendor asks to delete what lies in switched parts (1) and to activate it on the way back (2); "
        "which of NRBF and NCSF does so for joints and extra nodes is not confirmed, so either keeps this quiet.",
        partial(_held, nodal=False),
        (Example(GOOD), _constrained(_EXTRA, "         0         1"), _constrained(_JOINT, "         1         0")),
        (_constrained(_EXTRA), _constrained(_JOINT), _constrained(_EXTRA.replace("  8  ", "  1  "))),
    ),
    Rule(
        "D2R116",
        Severity.WARNING,
        "solids whose stresses do not turn with the rigid body",
        "While a part is rigid its elements are not computed. Formulations without a co-rotating frame keep their "
        "stresses in global axes: after a rotation they spring back in the wrong direction. Parts that are rigid from "
        "the start hold no stress and are not reported. Source: Altair's help says so for Radioss (bricks with Isolid "
        "1 or 2 without Iframe 2, tetrahedra, 16-node thick shells, 20-node bricks; not HEPH, HA8). For LS-DYNA it is "
        "concluded from the theory of the formulations; sources differ on what it does with their stresses.",
        _unturned,
        (Example(GOOD), _solid("0"), _solid("2", "0.0")),
        (_solid("2"), _solid(""), _solid("13")),
        solvers=BOTH,
    ),
)
