"""Define rules D2R112-113 and D2R120-124: constraints on the parts that a card makes rigid.

A node of a rigid body must not obey a second constraint, so constraints on a switched part have to be deleted while the
part is rigid. Two flags of the cards do this, for all constraints of a kind.  Parts that only a deleted constraint
connects separate unless they are one rigid body.

Source: vendor keyword data for NRBF (nodal rigid bodies, generalized welds), NCSF (nodal constraints, spotwelds) and
LRB; the vendor's public modelling rules for rigid bodies, which permit joints between rigid bodies.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import choose_verb, name_units
from d2rpick.base.graph import find_reachable
from d2rpick.base.tuples import NamedTuple
from d2rpick.deck.ls_dyna_parts import DELETING_FLAGS, read_merged_bodies
from d2rpick.rules.base import ERROR, WARNING, Case, PlacedMessage, group_values
from d2rpick.rules.example import Example, make_deck, write_automatic_card
from d2rpick.rules.rule import (
    BACK,
    PASS,
    THERE,
    make_rule_decorator,
    set_failing,
    set_passing,
)
from d2rpick.rules.switched_parts import (
    are_rigid_together,
    find_bodies_of_parts,
    find_lead_parts,
)

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping, Sequence

    from d2rpick.deck.card import Card, CardField
    from d2rpick.deck.ls_dyna_parts import Constraint, Kind
    from d2rpick.deck.switching import SwitchSet

_DELETED = 1  # Value of NRBF or NCSF with which a card deletes constraints.
_NODAL: Final[tuple[Kind, ...]] = ("nodal rigid body",)
_OTHERS: Final = tuple(kind for kind in DELETING_FLAGS if kind not in _NODAL)

_COUNTS: Final = "         0         0         0       0.0         1         0"
_MESH: Final = "*ELEMENT_SHELL\n       1       1       1       2       3       4\n"
_TWO_PARTS: Final = _MESH + "       2       2       5       6       7       8\n"
_SET: Final = "*SET_NODE_LIST\n         5\n         3         4        99\n"
_BODY: Final = "*CONSTRAINED_NODAL_RIGID_BODY\n         9         0         5\n"
_EXTRA: Final = "*CONSTRAINED_EXTRA_NODES_NODE\n         8         3\n"
_JOINT: Final = (
    "*CONSTRAINED_JOINT_REVOLUTE\n"
    + "".join(f"{node:10d}" for node in (3, 3, 50, 51, 52, 53))
    + "\n"
)
_SPOTWELD: Final = "*CONSTRAINED_SPOTWELD\n         3        99\n"
_JOINING_BODY: Final = _SET.replace("4  ", "6  ") + _BODY
_JOINING_JOINT: Final = _JOINT.replace("3         3        50", "3         6        50")
_HELD_JOINT: Final = _JOINT.replace(
    "3         3        50", "         99         6        50"
)
_JOINING_WELD: Final = _SPOTWELD.replace("99", " 6")
_TIE: Final = (
    "*CONTACT_TIED_NODES_TO_SURFACE\n         1         2         3         3\n"
)
_TIE_BY_PENALTY: Final = _TIE.replace("SURFACE", "SURFACE_OFFSET")
_TIE_OF_MPP: Final = _TIE.replace("SURFACE\n", "SURFACE_MPP\n         1       200\n")
_RIGID_PART: Final = (
    "*PART\nframe\n         7         1         9\n"
    "*MAT_RIGID\n         9    7.8E-9     210.0       0.3\n"
)
_TIE_TO_RIGID: Final = _TIE_BY_PENALTY.replace("         2 ", "         7 ")
_MERGED: Final = "*CONSTRAINED_RIGID_BODIES\n         1         2\n"


def _make_constrained_deck(text: str, flags: str = "         0         0") -> Example:
    """Return a deck with a constraint on a node of part 1; ``flags`` are the values of NRBF and NCSF on its card."""
    rigid_card = THERE.replace(_COUNTS, flags + _COUNTS[20:])
    return make_deck(_MESH + _SET + text + rigid_card + BACK)


def _make_joined_deck(text: str, flags: str, *lines: str) -> Example:
    """Return a deck in which a constraint joins two parts; ``lines`` are the D2R lines of the first card.

    ``flags`` are NRBF and NCSF of the first card; the second card activates what the first deletes.
    """
    rigid_card = write_automatic_card(1, "0.02", rigid=lines)
    back_card = write_automatic_card(2, "0.09", deformable=["1", "2"][: len(lines)])
    deleting = rigid_card.replace(_COUNTS[:40], flags + _COUNTS[20:40], 1)
    activated = flags.replace("1", "2") + _COUNTS[20:40]
    activating = back_card.replace(_COUNTS[:40], activated, 1)
    return make_deck(_TWO_PARTS + text + deleting + activating)


class _Flags(NamedTuple):
    """The flags NRBF and NCSF on a card that makes parts rigid, and the field of the first of these flags."""

    nrbf: int
    ncsf: int
    place: CardField

    def describe(self, kind: Kind) -> str:
        """Return the flags for a kind of constraint with their values, such as 'NRBF 0 and NCSF 0'."""
        return " and ".join(
            f"{name} {self._value(name)}" for name in DELETING_FLAGS[kind]
        )

    def deletes(self, kind: Kind) -> bool:
        """Return True if the card deletes the constraints of a kind."""
        return any(self._value(name) == _DELETED for name in DELETING_FLAGS[kind])

    def _value(self, name: str) -> int:
        return self.nrbf if name == "NRBF" else self.ncsf


def _find_flags(case: Case, card: SwitchSet) -> _Flags | None:
    """Return the flags of a card or, in a restart, of *RIGID_DEFORMABLE_CONTROL; None if the card has no flags."""
    if card.header:
        nrbf = card.header.nrbf
        ncsf = card.header.ncsf
        return _Flags(nrbf.value, ncsf.value, nrbf.field)
    if card.kind != "restart":
        return None
    controls = (
        control
        for control in case.sets
        if control.card.file == card.card.file
        and control.card.name.endswith("_CONTROL")
    )
    values = next((control.values for control in controls if control.values), None)
    if values is None:
        return _Flags(0, 0, card.card.here)
    nrbf_value = values[0].value
    ncsf_value = values[1].value
    return _Flags(int(nrbf_value), int(ncsf_value), values[0].field)


class _Joining(NamedTuple):
    """A constraint and the parts that it joins.

    ``deformable`` contains those of the ``parts`` that no card makes rigid, and ``always_rigid`` those with *MAT_RIGID.
    ``body_count`` is the number of rigid bodies to which the parts that are not deformable belong. ``flags`` contains
    NRBF and NCSF of the cards that make parts rigid, keyed by part id.
    """

    constraint: Constraint
    parts: frozenset[int]
    deformable: frozenset[int]
    always_rigid: frozenset[int]
    body_count: int
    flags: Mapping[int, Sequence[_Flags]]

    @property
    def is_one_body(self) -> bool:
        """Return True if all parts become one rigid body."""
        return self.body_count == 1 and not self.deformable

    @property
    def is_joint_between_bodies(self) -> bool:
        """Return True for a joint between rigid bodies, which may stay active."""
        is_joint = self.constraint.kind == "joint"
        return is_joint and self.body_count > 1 and not self.deformable

    @property
    def name(self) -> str:
        """Return the kind of the constraint, with its id if it has one."""
        if self.constraint.id:
            return f"{self.constraint.kind} {self.constraint.id}"
        return self.constraint.kind

    def find_card(self, *, deletes: bool) -> tuple[int, _Flags] | None:
        """Return the first part made rigid by a card that deletes the constraint, or keeps it, and the card's flags."""
        kind = self.constraint.kind
        cards = (
            (part, flags)
            for part in sorted(self.flags)
            for flags in self.flags[part]
            if flags.deletes(kind) == deletes
        )
        return next(cards, None)


def _find_joinings(case: Case, kinds: Sequence[Kind]) -> Iterator[_Joining]:
    """Yield the constraints of the given kinds on parts that a card makes rigid."""
    flags = group_values(
        (event.unit.id, flags)
        for event in case.made_rigid
        if (flags := _find_flags(case, event.by))
    )
    if not flags:
        return
    leads = find_lead_parts(
        {event.unit.id: event for event in reversed(case.made_rigid)}
    )
    constraints = [item for item in case.constraints if item.kind in kinds]
    parts_of_nodes = case.parts_of_constrained_nodes
    for constraint in constraints:
        parts = {
            part for node in constraint.nodes for part in parts_of_nodes.get(node, ())
        }
        rigid = {part for part in parts if case.parts.is_rigid(part)}
        if constraint.part:
            # Extra nodes belong to a part that is rigid from the start, or to a switched part.
            parts.add(constraint.part)
            rigid.add(constraint.part)
        bodies = {leads.get(part, part) for part in parts & (leads.keys() | rigid)}
        on_parts = {part: flags[part] for part in parts & flags.keys()}
        if on_parts:
            yield _Joining(
                constraint,
                frozenset(parts),
                frozenset(parts - leads.keys() - rigid),
                frozenset(filter(case.parts.is_rigid, parts)),
                len(bodies),
                on_parts,
            )


def _find_active(
    case: Case, kinds: Sequence[Kind], rule_of_deleted: str
) -> Iterator[PlacedMessage]:
    """Yield constraints on parts that a card makes rigid without deleting these constraints.

    ``rule_of_deleted`` is the rule that reports a deleted constraint between parts that then separate.
    """
    for joining in _find_joinings(case, kinds):
        keeping = joining.find_card(deletes=False)
        if keeping is None or joining.is_joint_between_bodies:
            continue
        part, flags = keeping
        described = flags.describe(joining.constraint.kind)
        problem = (
            f"{joining.name} on part {part}, which is made rigid at {flags.place.at} with {described}, "
            "so it stays active"
        )
        cure = "set the flag to 1 there and to 2 on the card that switches back"
        if joining.deformable:
            held = (
                f"it also holds {name_units(joining.deformable)}, so do not delete it"
            )
            cure = (
                f"{held} ({rule_of_deleted}): make all its parts rigid, or none of them"
            )
        elif not joining.is_one_body and joining.always_rigid:
            held = _describe_always_rigid(joining.always_rigid)
            merging = _advise_lead_part(joining)
            cure = f"{held} ({rule_of_deleted}): {merging}, and {cure}; or keep {name_units(joining.flags)} deformable"
        elif not joining.is_one_body:
            held = f"its {name_units(joining.parts)} become separate rigid bodies"
            cure = f"{held} ({rule_of_deleted}): merge them with LRB, and {cure}"
        yield joining.constraint.place, f"{problem}; {cure}"


def _find_separating(case: Case, kinds: Sequence[Kind]) -> Iterator[PlacedMessage]:
    """Yield constraints that a card deletes although their parts do not become one rigid body."""
    for joining in _find_joinings(case, kinds):
        deleting = joining.find_card(deletes=True)
        if deleting is None or joining.is_one_body:
            continue
        described = deleting[1].describe(joining.constraint.kind)
        problem = f"{joining.name} joins {name_units(joining.parts)} and is deleted ({described})"
        if joining.deformable:
            verb = choose_verb(joining.deformable)
            left = f"{name_units(joining.deformable)} {verb} not made rigid"
            message = f"{problem}, but {left}; switch all"
        elif joining.always_rigid:
            held = _describe_always_rigid(joining.always_rigid)
            merging = _advise_lead_part(joining)
            message = f"{problem}, but {held}; {merging}, or keep {name_units(joining.flags)} deformable"
        else:
            message = (
                f"{problem}, but they become separate rigid bodies; merge them with LRB"
            )
        yield joining.constraint.place, message


def _describe_always_rigid(parts: Collection[int]) -> str:
    """Describe parts that stay bodies of their own because they are rigid from the start."""
    has = "has" if len(parts) == 1 else "have"
    return f"{name_units(parts)} {has} *MAT_RIGID and cannot be switched"


def _advise_lead_part(joining: _Joining) -> str:
    """Advise to merge the switched parts into the part that is rigid from the start."""
    return f"write LRB {min(joining.always_rigid)} on the line of {name_units(joining.flags)}"


@set_passing(
    lambda: [
        PASS,
        _make_constrained_deck(_BODY, "         1         0"),
        _make_constrained_deck(_BODY.replace("   5\n", "   6\n")),
    ]
)
@set_failing(
    lambda: [
        _make_constrained_deck(_BODY),
        _make_constrained_deck(_BODY, "         2         1"),
    ]
)
@make_rule_decorator(
    "D2R112", ERROR, "a nodal rigid body that stays active on a switched part (NRBF)"
)
def _check_nodal_bodies(case: Case) -> Iterator[PlacedMessage]:
    """A node cannot belong to two rigid bodies. The card that makes a part rigid must delete the nodal rigid bodies on
    it, and the card that switches back must activate them again. Otherwise the run stops (Error 30164, as a public drop
    tool reports). Source: vendor keyword data for NRBF, according to which such bodies cause instabilities.

    Fix: Set NRBF to 1 on the card that makes the part rigid and to 2 on the card that switches it back. If the nodal
    rigid body also holds a part that stays deformable, do not delete the body (D2R120): switch all of its parts, or
    none.
    """
    return _find_active(case, _NODAL, "D2R120")


@set_passing(
    lambda: [
        PASS,
        _make_joined_deck(
            _JOINING_BODY, "         1         0", "1", "         2         1      PART"
        ),
    ]
)
@set_failing(
    lambda: [
        _make_joined_deck(_JOINING_BODY, "         1         0", "1", "2"),
        _make_joined_deck(_JOINING_BODY, "         1         0", "1"),
    ]
)
@make_rule_decorator(
    "D2R120", ERROR, "a deleted nodal rigid body (NRBF 1) that joins separate bodies"
)
def _check_separated_parts(case: Case) -> Iterator[PlacedMessage]:
    """While a nodal rigid body is deleted (NRBF 1), its parts are held together only by a common rigid body. The parts
    come apart if they become several rigid bodies, or if one of them is not switched. Source: vendor keyword data for
    NRBF and LRB.

    Fix: Switch all parts of the body and merge them with LRB, or switch none of them. If one of them has *MAT_RIGID, it
    cannot be switched: write its id as LRB of the others.
    """
    return _find_separating(case, _NODAL)


@set_passing(
    lambda: [
        PASS,
        _make_joined_deck(_JOINING_JOINT, "         0         0", "1", "2"),
        _make_constrained_deck(_EXTRA, "         0         1"),
        _make_constrained_deck(_JOINT, "         1         0"),
        _make_constrained_deck(_SPOTWELD, "         0         1"),
    ]
)
@set_failing(
    lambda: [
        _make_constrained_deck(_EXTRA),
        _make_constrained_deck(_JOINT),
        _make_constrained_deck(_EXTRA.replace("  8  ", "  1  ")),
        _make_constrained_deck(_SPOTWELD, "         1         0"),
    ]
)
@make_rule_decorator(
    "D2R113",
    WARNING,
    "extra nodes, a joint or a weld that stays active on a switched part (NRBF, NCSF)",
)
def _check_other_constraints(case: Case) -> Iterator[PlacedMessage]:
    """According to the vendor, such a constraint is invalid for a rigid body, because its nodes also belong to that
    body. It must be deleted while the part is rigid, and activated again when the part is switched back. NCSF deletes
    spotwelds, rivets and constrained node sets. NRBF deletes generalized welds. No available source states which flag
    deletes joints and extra nodes: for these, the rule accepts either flag. A joint between separate rigid bodies may
    stay active and is not reported.

    Fix: Set the flag to 1 on the card that makes the part rigid and to 2 on the card that switches it back: NCSF for
    spotwelds, rivets and node sets, NRBF for generalized welds. For joints and extra nodes, set NCSF, and NRBF too if
    they stay active in the run. If the constraint joins parts that do not become one rigid body, merge them with LRB
    first (D2R121). A part with *MAT_RIGID cannot be switched: write its id as LRB of the part that it is joined to, or
    keep that part deformable.
    """
    return _find_active(case, _OTHERS, "D2R121")


@set_passing(
    lambda: [
        PASS,
        _make_joined_deck(
            _JOINING_JOINT,
            "         0         1",
            "1",
            "         2         1      PART",
        ),
        _make_joined_deck(_JOINING_WELD, "         1         0", "1", "2"),
    ]
)
@set_failing(
    lambda: [
        _make_joined_deck(_JOINING_JOINT, "         0         1", "1", "2"),
        _make_joined_deck(_SET + _BODY + _HELD_JOINT, "         1         0", "1", "2"),
        _make_joined_deck(_JOINING_WELD, "         0         1", "1"),
    ]
)
@make_rule_decorator(
    "D2R121",
    WARNING,
    "a deleted joint, weld or set of extra nodes (NRBF 1, NCSF 1) that joins separate bodies",
)
def _check_separated_joints(case: Case) -> Iterator[PlacedMessage]:
    """If NRBF 1 or NCSF 1 deletes a joint, weld or set of extra nodes, only a common rigid body still connects its
    parts. The parts separate if they become several rigid bodies, or if one of them stays deformable. Nodal rigid
    bodies on the parts may hold the joint; NRBF 1 deletes them too. Source: vendor keyword data for NRBF, NCSF and LRB.
    Whether the flags act on joints and extra nodes has not been tested, so the rule only warns.

    Fix: Switch all parts and merge them with LRB. If they move relative to each other in the flight, like a door on its
    hinge, keep all of them deformable.
    """
    return _find_separating(case, _OTHERS)


@set_passing(
    lambda: [
        PASS,
        make_deck(_MERGED.replace("1         2", "7         8") + THERE + BACK),
    ]
)
@set_failing(
    lambda: [
        make_deck(_MERGED + THERE + BACK),
        make_deck(_MERGED.replace("1         2", "2         1") + THERE + BACK),
    ]
)
@make_rule_decorator("D2R122", WARNING, "a switched part on *CONSTRAINED_RIGID_BODIES")
def _check_merged_bodies(case: Case) -> Iterator[PlacedMessage]:
    """*CONSTRAINED_RIGID_BODIES merges rigid bodies whose parts have *MAT_RIGID. A part that a card makes rigid has a
    deformable material, so the keyword does not apply to it. The parts become separate rigid bodies unless the card
    merges them. Source: the vendor's public help on the command that writes this keyword. Not tested with the solver.

    Fix: Remove the part from *CONSTRAINED_RIGID_BODIES, and merge the parts with LRB on the card.
    """
    switched = {
        event.unit.id
        for event in case.made_rigid
        if not case.parts.is_rigid(event.unit.id)
    }
    for place, merged in read_merged_bodies(case.deck) if switched else ():
        if named := sorted(switched.intersection(merged)):
            problem = f"{name_units(named)} {choose_verb(named)} made rigid by a card"
            yield (
                place,
                f"{problem}, but this keyword merges only *MAT_RIGID parts; remove it, and merge with LRB on the card",
            )


@set_passing(
    lambda: [
        PASS,
        _make_joined_deck(_TIE_BY_PENALTY, "         0         0", "1"),
        _make_joined_deck(
            _TIE, "         0         0", "1", "         2         1      PART"
        ),
        _make_joined_deck(
            _RIGID_PART + _TIE_TO_RIGID,
            "         0         0",
            "         1         7      PART",
        ),
    ]
)
@set_failing(
    lambda: [
        _make_joined_deck(_TIE, "         0         0", "1"),
        _make_joined_deck(_TIE_OF_MPP, "         0         0", "1"),
        _make_joined_deck(_TIE, "         0         0", "1", "2"),
        _make_joined_deck(_RIGID_PART + _TIE_TO_RIGID, "         0         0", "1"),
    ]
)
@make_rule_decorator(
    "D2R123",
    WARNING,
    "a tied contact between a switched part and a part outside its rigid body",
)
def _check_tied_contacts(case: Case) -> Iterator[PlacedMessage]:
    """The switching cards do not delete tied contacts. A tied contact without OFFSET is a constraint on nodes, and
    rigid bodies cannot obey it, so the tied parts may separate while one of them is rigid. With OFFSET (but not
    CONSTRAINED_OFFSET), the contact acts by a penalty force and may connect a rigid part to a deformable part. Two
    rigid bodies, such as a switched part and a part with *MAT_RIGID, do not move as one body, even with OFFSET. Source:
    the vendor's public manual on tied contacts. Not tested with the solver.

    Fix: Switch both parts and merge them with LRB. If one of them has *MAT_RIGID, write its id as LRB of the other. If
    one of them should stay deformable, add OFFSET to the contact or keep both deformable.
    """
    first = {event.unit.id: event for event in reversed(case.made_rigid)}
    if not first:
        return
    bodies = find_bodies_of_parts(case, first)
    for card, parts in case.ties:
        switched = sorted(parts & first.keys())
        if not switched:
            continue
        deformable = sorted(parts - bodies.keys())
        always_rigid = sorted(parts & bodies.keys() - first.keys())
        is_one_body = len({bodies[part] for part in parts & bodies.keys()}) < 2
        names = name_units(switched)
        problem = f"this contact ties {names}, made rigid by a card, to"
        if always_rigid and not is_one_body:
            lead = always_rigid[0]
            has = "has" if len(always_rigid) == 1 else "have"
            problem += f" {name_units(always_rigid)}, which {has} *MAT_RIGID and cannot be switched"
            yield (
                card.here,
                f"{problem}; write LRB {lead} on the line of {names}, or keep {names} deformable",
            )
        elif deformable and not _acts_by_penalty(card):
            problem += (
                f" {name_units(deformable)}, which {choose_verb(deformable)} not, and acts only between deformable "
                "parts, so they may separate"
            )
            yield (
                card.here,
                f"{problem}; switch and merge both, or add OFFSET to the contact",
            )
        elif not is_one_body and are_rigid_together(
            case, first[switched[0]].unit, first[switched[-1]].unit
        ):
            yield (
                card.here,
                f"this contact ties {names}, which become separate rigid bodies; merge them with LRB",
            )


_LOOSE_RIGID: Final = (
    _MESH
    + _RIGID_PART
    + "*ELEMENT_SHELL\n       9       7      91      92      93      94\n"
)


@set_passing(
    lambda: [
        PASS,
        *(
            _make_joined_deck(
                text, "         0         0", "         1         7      PART"
            )
            for text in (
                _LOOSE_RIGID.replace("      91", "       4"),
                _LOOSE_RIGID + _TIE_TO_RIGID,
                _LOOSE_RIGID + _SET.replace("99", "91") + _BODY,
                _LOOSE_RIGID + _EXTRA.replace("  8  ", "  7  "),
            )
        ),
    ]
)
@set_failing(
    lambda: [
        _make_joined_deck(
            _LOOSE_RIGID, "         0         0", "         1         7      PART"
        )
    ]
)
@make_rule_decorator(
    "D2R124",
    WARNING,
    "a switched part merged into a *MAT_RIGID part that is not attached",
)
def _check_merged_into_loose_part(case: Case) -> Iterator[PlacedMessage]:
    """LRB merges a switched part into a part with *MAT_RIGID: while the switched part is rigid, both parts move as one
    body. Elements, constraints and tied contacts of the deck connect these parts neither directly nor through other
    parts, so they move separately in the reference run. A flying part that is merged into a rigid ground does not fly.
    d2rpick does not apply this rule if it cannot read some of the elements or ties.

    Fix: Correct LRB (`--merge` of the card): name the *MAT_RIGID part to which the switched parts are attached, or one
    of the switched parts.
    """
    first = {event.unit.id: event for event in reversed(case.made_rigid)}
    bodies = find_bodies_of_parts(case, first) if first else {}
    merged = group_values(
        (bodies[part], part)
        for part in sorted(first)
        if any(bodies[part] == bodies[other] for other in bodies.keys() - first.keys())
    )
    if not merged or not case.knows_all_connections:
        return
    for body, parts in merged.items():
        rigid = {part for part in bodies.keys() - first.keys() if bodies[part] == body}
        connected: list[int] = find_reachable(parts, case.list_connected_parts)
        if rigid.intersection(connected):
            continue
        line = next((line for part in parts if (line := first[part].line).lead), None)
        if line and line.lead:
            names = name_units(parts)
            problem = f"{names} merged into {name_units(rigid)} with *MAT_RIGID, but nothing in the deck connects them"
            yield (
                line.lead.field,
                f"{problem}, so they would move as one body only while {names} {choose_verb(parts)} rigid; correct LRB",
            )


def _acts_by_penalty(card: Card) -> bool:
    """Return True if a tied contact acts by penalty forces, which may also connect a rigid part."""
    options = card.options("CONTACT")
    return ("OFFSET" in options and "CONSTRAINED" not in options) or {
        "AUTOMATIC",
        "TIEBREAK",
    } <= options
