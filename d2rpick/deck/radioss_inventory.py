"""Read parts, elements, gravity, supports, prescribed motions and joints from a Radioss starter deck.

The columns come from Altair's public help for the elements, properties and materials, /GRAV, /FUNCT, /BCS, /IMPVEL,
/IMPDISP, /IMPACC and /INTER/TYPE2, and from the solver's published source.
"""

from __future__ import annotations

from math import inf
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.deck import formulations, model
from d2rpick.deck.expression import parse_real
from d2rpick.deck.mesh import KINDS, NOT_COUNTED, Mesh, read_elements, read_nodes
from d2rpick.deck.model import Formulation, Inventory, Material, PartData, Section
from d2rpick.deck.radioss_columns import (
    AREA,
    DENSITY,
    ELASTIC,
    FREE_MOTION,
    FUNCTION_POINT,
    GRAVITY,
    ID_LIST,
    INTERFACE,
    MOTION_TIMES,
    SHELL_SECTION,
    SOLID_FLAGS,
    SPRING,
    SPRING_FUNCTION,
    SPRING_MASS,
    SUPPORT,
)
from d2rpick.deck.radioss_deck import (
    SOLIDS,
    Starter,
    find_bodies_kept_off,
    get_lines_below_title,
    get_number,
    parse_id,
    read_blocks,
    read_reals,
    split_keyword,
)
from d2rpick.deck.radioss_flaws import find_flaws
from d2rpick.deck.radioss_run import (
    RadiossRun,
    find_left_rigid,
    find_parts_of_fixed_bodies,
    find_run_windows,
    find_sensors_of_parts,
)
from d2rpick.deck.reader import find_cuts, has_mesh
from d2rpick.deck.unswitchable import find_unswitchable_in_radioss

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from d2rpick.deck.card import Card, Row
    from d2rpick.deck.columns import CardColumn
    from d2rpick.deck.mesh import Integers
    from d2rpick.deck.switching import SwitchWindow


# Material laws whose lines begin with density, Young's modulus and Poisson's ratio.
_ELASTIC: Final = {
    *(
        "ELAST",
        "LAW1",
        "LAW01",
        "PLAS_JOHNS",
        "LAW2",
        "LAW02",
        "PLAS_ZERIL",
        "PLAS_BRIT",
        "LAW27",
        "PLAS_TAB",
        "LAW36",
    ),
    *("COWPER", "LAW44", "DAMA", "LAW22", "LAW22_DAMA"),
}
_VOID: Final = {"VOID", "LAW0", "LAW00"}
_AIRBAG: Final = {"FABRI", "FABR_A", "LAW19", "LAW58"}
# Shell property types that all have the thickness in the same columns.
_PLAIN_SHELLS: Final = {
    "SHELL",
    "TYPE1",
    "SH_ORTH",
    "TYPE9",
}
_SHELLS: Final = {
    *_PLAIN_SHELLS,
    "SH_COMP",
    "TYPE10",
    "SH_SANDW",
    "TYPE11",
    "SH_FABR",
    "TYPE16",
    "STACK",
    "TYPE17",
    "TYPE51",
}
_AREA_LINE: Final = {
    "BEAM": 2,
    "TYPE3": 2,
    "TRUSS": 0,
    "TYPE2": 0,
}  # Number of the line below the title that contains the area, by property type.
_SPRING: Final = {"SPRING", "TYPE4"}
_OTHER_SPRINGS: Final = {
    "SPR_GENE",
    "TYPE8",
    "SPR_BEAM",
    "TYPE13",
    "SPR_PUL",
    "TYPE12",
    "SPR_AXI",
    "TYPE25",
    "KJOINT",
    "TYPE33",
    "KJOINT2",
    "TYPE45",
}
_OF_SPRINGS: Final = _SPRING | _OTHER_SPRINGS
_DEFAULT_SHELL, _DEFAULT_TRIANGLE, _DEFAULT_SOLID = 1, 2, 1

# Other keywords that connect parts; d2rpick does not read which parts these keywords connect.
_OTHER_TIES: Final = ("RBE2", "RBE3", "RLINK", "MPC")
_MOTIONS: Final = ("IMPVEL", "IMPDISP", "IMPACC")
_AXES: Final = "XYZ"


class _Property(NamedTuple):
    """A property card: its type, the formulation flags of shells, triangles and solids, and its section."""

    type: str
    shell: int = 0
    triangle: int = 0
    solid: int = 0
    section: Section = Section()


def read_radioss_inventory(run: RadiossRun) -> Inventory:
    """Return the parts and elements of a run; without a starter deck, return only a note."""
    starter = run.starter
    if starter is None:
        return Inventory(
            "radioss",
            {},
            (),
            np.empty((0, 3)),
            ("no starter deck (NAME_0000.rad) was found",),
            False,
        )
    ids, coordinates = read_nodes(starter.named("NODE"))
    mesh = Mesh.of(
        [block for card in starter.named(*KINDS) for block in read_elements(card)],
        ids,
        coordinates,
    )
    notes = (*_collect_notes(run, starter), *mesh.doubts(starter.parts.keys(), "/"))
    windows = find_run_windows(run).windows.windows if run.legs else ()
    joints = _find_joints(run, starter)
    # If there is no engine file, all bodies may be switched.
    switched = run.named if run.legs else {body.node.value for body in starter.bodies}
    rigid = _find_always_rigid(windows) | find_parts_of_fixed_bodies(run)
    local_nodes = _find_watched_nodes(starter, local=True)
    watched_nodes = np.union1d(_find_watched_nodes(starter, local=False), local_nodes)
    watched = mesh.table.known(watched_nodes)
    return Inventory(
        "radioss",
        _collect_parts(starter, mesh, rigid),
        mesh.elements,
        mesh.coordinates,
        notes,
        not notes,
        joints=model.place_nodes(joints.found, mesh.table),
        switched=model.place_nodes(joints.switched, mesh.table),
        ties=joints.unknown,
        watched=watched,
        watched_ids=mesh.table.ids[watched],
        local_ids=frozenset(local_nodes.tolist()),
        moved=starter.transformed,
        files=tuple(run.deck.sources),
        history_groups=frozenset(
            get_number(card, -1) for card in starter.named("THPART")
        ),
        kept_off=find_bodies_kept_off(run.legs),
        flaws=find_flaws(run, switched),
        boundary=_collect_boundary(run, starter).placed(mesh.table),
        left_rigid=find_left_rigid(run, windows),
    )


def _find_watched_nodes(starter: Starter, *, local: bool) -> Integers:
    """Return the node ids on a /TH/NODE card, below its title and its line of variables.

    If ``local`` is True, only nodes whose motion is written in a skew system are returned, otherwise only the others.
    """
    rows = [
        row
        for card in starter.named("TH")
        if card.words[1:2] == ("NODE",)
        for row in get_lines_below_title(card)
    ]
    ids = []
    for row in rows:
        number, skew = (ID_LIST[name].cut(row.text).strip() for name in ("ID1", "ID2"))
        is_local = skew.isdecimal() and int(skew) > 0
        if number.isdecimal() and int(number) and is_local is local:
            ids.append(int(number))
    return np.unique(np.array(ids, np.int64))


def _collect_notes(run: RadiossRun, starter: Starter) -> Iterator[str]:
    """Yield notes on elements that may be missing from the inventory."""
    yield from (
        f"{card.at}: elements of /{card.name} are not read"
        for card in starter.named(*NOT_COUNTED)
    )
    yield from (
        f"{block.source.name}: {sign}"
        for block, sign in find_cuts(run.deck)
        if has_mesh(block)
    )
    yield from (
        f"{include.name.at}: {include.name.text} was not read: {include.reason}; add the file, or correct its name"
        for include in run.deck.unread
    )
    if starter.moved:
        yield "a //SUBMODEL may offset ids, which d2rpick does not evaluate"


def _collect_parts(
    starter: Starter, mesh: Mesh, rigid: set[int]
) -> Mapping[int, PartData]:
    """Return the data of all parts, keyed by part id."""
    materials = dict(_collect_materials(starter))
    properties = dict(_collect_properties(starter))
    kinds = mesh.kinds
    unturned = starter.unturned
    unswitchable = find_unswitchable_in_radioss(starter)
    sensors = find_sensors_of_parts(starter)
    part_data: dict[int, PartData] = {}
    for part, line in starter.parts.items():
        section = _complete_section(
            properties.get(line.prop),
            kinds.get(part, set()),
            turns=part not in unturned,
        )
        material = _choose_material(
            materials.get(line.material), properties.get(line.prop), part in rigid
        )
        if part in sensors:
            by_sensor = f"the deck switches it by sensor {sensors[part]} already"
        else:
            by_sensor = ""
        reason = unswitchable[part].reason if part in unswitchable else by_sensor
        part_data[part] = PartData(part, line.title, material, section, reason)
    return part_data


def _choose_material(
    written: Material | None, prop: _Property | None, rigid: bool
) -> Material | None:
    """Return the material of a part. A spring has its stiffness in its property; a rigid body has a rigid material."""
    if prop and prop.type in _OF_SPRINGS:
        return Material(f"PROP/{prop.type}", "spring")
    if written and rigid:
        return written._replace(kind="rigid")
    return written


def _find_always_rigid(windows: Sequence[SwitchWindow]) -> set[int]:
    """Return the parts that are rigid from start to end of the run; empty if there is no engine file."""
    return {
        window.unit.id
        for window in windows
        if not window.unit.is_body and window.tr == 0 and window.td is None
    }


def _collect_materials(starter: Starter) -> Iterator[tuple[int, Material]]:
    """Yield the id and the material of each /MAT card."""
    for card in starter.named("MAT"):
        if len(card.words) < 3:
            continue
        rows = [row.text for row in get_lines_below_title(card)]
        law = card.words[1]
        is_elastic = law in _ELASTIC
        modulus, poisson = (
            _read_positive(rows, 1, column) if is_elastic else None
            for column in ELASTIC
        )
        kind = "deformable"
        if law in _VOID:
            kind = "void"
        elif law in _AIRBAG:
            kind = "airbag"
        yield (
            get_number(card, 2),
            Material(
                f"MAT/{law}",
                kind,
                _read_positive(rows, 0, DENSITY["rho"]),
                modulus,
                poisson,
            ),
        )


def _collect_properties(starter: Starter) -> Iterator[tuple[int, _Property]]:
    """Yield the id and property of each /PROP, with missing values from /DEF_SHELL and /DEF_SOLID."""
    defaults = {
        card.words[0]: _read_flags(card, card.lines)
        for card in starter.named("DEF_SHELL", "DEF_SOLID")
    }
    shell, _, triangle = defaults.get("DEF_SHELL", [0, 0, 0])[:3]
    solid = defaults.get("DEF_SOLID", [0])[0]
    for card in starter.named("PROP"):
        if len(card.words) < 3:
            continue
        below = get_lines_below_title(card)
        type_ = card.words[1]
        flags = _read_flags(card, below)
        rows = [row.text for row in below]
        shells = (
            flags[0] or shell or _DEFAULT_SHELL,
            flags[2] or triangle or _DEFAULT_TRIANGLE,
        )
        bricks = flags[0] or solid or _DEFAULT_SOLID
        prop = _Property(
            type_,
            *(shells if type_ in _SHELLS else (0, 0)),
            bricks if type_ in SOLIDS else 0,
        )
        yield get_number(card, 2), prop._replace(section=_read_section(type_, rows))


def _read_section(type_: str, rows: Sequence[str]) -> Section:
    """Read the thickness, area or spring constants from the lines of a property."""
    if type_ in _PLAIN_SHELLS:
        return _read_shell_section(rows)
    if type_ in _AREA_LINE:
        return Section(area=_read_positive(rows, _AREA_LINE[type_], AREA["Area"]))
    return _read_spring_section(rows) if type_ in _SPRING else Section()


def _complete_section(
    prop: _Property | None, kinds: set[str], *, turns: bool
) -> Section:
    """Return the section of a part, with the formulations of its elements."""
    if prop is None:
        return Section(turns=turns)
    formulations_by_kind: dict[str, Formulation] = {}
    for kind in sorted(kinds):
        flags = (prop.shell, prop.triangle, prop.solid)
        needed = {"shell": flags[0], "triangle": flags[1]}.get(kind, 1)
        formulation = (
            formulations.find_radioss_formulation(kind, *flags) if needed else None
        )
        if formulation:
            formulations_by_kind[kind] = formulation
    return prop.section._replace(formulations=formulations_by_kind, turns=turns)


def _read_spring_section(rows: Sequence[str]) -> Section:
    """Read the mass and stiffness of a spring; the stiffness is unknown if a function defines it."""
    linear = len(rows) < 3 or not SPRING_FUNCTION["fct_ID1"].cut(rows[2]).strip(" 0")
    return Section(
        damped=_read_positive(rows, 1, SPRING["C"]) is not None,
        mass=_read_positive(rows, 0, SPRING_MASS["Mass"]),
        stiffness=_read_positive(rows, 1, SPRING["K"]) if linear else None,
    )


def _read_shell_section(rows: Sequence[str]) -> Section:
    """Read the thickness and integration points of a shell; 0 means global integration, which is treated as 1 point."""
    points = SHELL_SECTION["N"].cut(rows[2]).strip() if len(rows) > 2 else None
    if points is None:
        layers = None
    else:
        layers = max(int(points) if points.isdecimal() else 0, 1)
    return Section(
        thickness=_read_positive(rows, 2, SHELL_SECTION["Thick"]), layers=layers
    )


def _read_flags(card: Card, rows: Sequence[Row]) -> list[int]:
    """Return the flags on the first line; 0 for text that is not a flag."""
    return [
        card.integer(rows[0], column).value if rows else 0 for column in SOLID_FLAGS
    ]


def _read_positive(rows: Sequence[str], row: int, column: CardColumn) -> float | None:
    """Read a positive number from a column; None for any other content."""
    value = parse_real(column.cut(rows[row])) if row < len(rows) else 0.0
    return value if value > 0 else None


def _collect_boundary(run: RadiossRun, starter: Starter) -> model.Boundary:
    """Return the supports, prescribed motions and gravity in a starter deck."""
    if starter.moved and starter.named("GRAV", "BCS", *_MOTIONS):
        return model.Boundary(
            notes=(
                "a //SUBMODEL may offset ids, so supports and gravity of the deck are unknown",
            )
        )
    holds = [*_find_holds(run, starter)]
    holds += [
        *_find_body_holds(
            run, starter, [hold for hold in holds if isinstance(hold, model.Hold)]
        )
    ]
    return model.Boundary.of(
        holds, [*_find_gravity(starter)], whole=not run.deck.unread
    )


def _name_card(card: Card) -> str:
    """Return the keyword, file and line of a card for messages."""
    return f"/{card.name} ({card.at})"


# The functions below read supports and prescribed motions.


def _find_holds(run: RadiossRun, starter: Starter) -> Iterator[model.Hold | str]:
    """Yield the supports and prescribed motions, or notes on those that cannot be read."""
    engine = [source for source in run.deck.sources if source not in starter.sources]
    lifted = any(
        split_keyword(block)[:1] == ("BCSR",)
        for source in engine
        for block in read_blocks(source)
    )
    for card in starter.named("BCS", *_MOTIONS):
        words = card.words
        rows = get_lines_below_title(card)
        if not rows:
            continue
        if words[0] == "BCS" and lifted:
            yield f"{_name_card(card)}: an engine file removes supports (/BCSR), which d2rpick does not evaluate"
        elif words[1:2] == ("FGEO",):
            part = card.integer(rows[0], FREE_MOTION["part_ID"]).value
            group = frozenset({part} - {0})
            nodes = model.make_ids(
                {parse_id(ID_LIST["ID1"].cut(row.text)) for row in rows[2:]} - {0}
            )
            yield model.Hold(_name_card(card), nodes, group, counts=True)
        else:
            held = (
                _find_support(card, rows)
                if words[0] == "BCS"
                else _find_motion(card, rows)
            )
            line = SUPPORT if words[0] == "BCS" else GRAVITY
            members = starter.group_members(
                card.integer(rows[0], line["grnod_ID"]).value
            )
            if members is None:
                yield f"{_name_card(card)}: the nodes of its group are unknown"
            elif held:
                yield held._replace(
                    nodes=model.make_ids(members[0]), parts=frozenset(members[1])
                )


def _find_support(card: Card, rows: Sequence[Row]) -> model.Hold | None:
    """Read a /BCS card. In local axes, it is always treated as a support unless it fixes all translations."""
    moves, turns = (SUPPORT[name].cut(rows[0].text) for name in ("Tra", "Rot"))
    axes = frozenset(axis for axis, code in enumerate(moves) if code == "1")
    if not axes and "1" not in turns:
        return None
    skewed = bool(card.integer(rows[0], SUPPORT["skew_ID"]).value) and 0 < len(
        axes
    ) < len(_AXES)
    return model.Hold(_name_card(card), model.make_ids(()), axes=axes, counts=skewed)


def _find_motion(card: Card, rows: Sequence[Row]) -> model.Hold:
    """Read a prescribed motion with its times; with a sensor or its own units, it is assumed to act at all times."""
    timed = (
        len(rows) > 1
        and not card.integer(rows[0], GRAVITY["sens_ID"]).value
        and not get_number(card, 2)
    )
    start, stop = read_reals(rows[1], MOTION_TIMES)[2:] if timed else (0.0, 0.0)
    is_finite = np.isfinite([start, stop]).all()
    return model.Hold(
        _name_card(card),
        model.make_ids(()),
        counts=True,
        start=start if is_finite else 0.0,
        end=stop if is_finite and stop else inf,
    )


def _find_body_holds(
    run: RadiossRun, starter: Starter, holds: Sequence[model.Hold]
) -> Iterator[model.Hold]:
    """Yield a support of all nodes of an active rigid body for each support of the body's main node."""
    for body in starter.bodies:
        if body.sensor or body.node.value in run.named:
            members = None
        else:
            members = starter.group_members(body.group)
        for hold in holds if members else ():
            if members and body.node.value in hold.nodes:
                yield hold._replace(
                    nodes=model.make_ids(members[0]), parts=frozenset(members[1])
                )


# The functions below read gravity.


def _find_gravity(starter: Starter) -> Iterator[model.Gravity | str]:
    """Yield the gravity loads, or notes on those that cannot be read."""
    loads = [card for card in starter.named("GRAV") if get_lines_below_title(card)]
    functions = dict(_read_functions(starter)) if loads else {}
    units = next(
        (card.rows[2:4] for card in starter.named("BEGIN") if len(card.words) == 1), ()
    )
    converted = (
        len(units) > 1
        and units[0].text.split() != units[1].text.split()
        and units[1].text.strip() != ""
    )
    for card in loads:
        if converted or get_number(card, 2):
            load = None
        else:
            load = _read_gravity_card(card, starter, functions)
        yield (
            load
            or f"{_name_card(card)} cannot be read, so gravity is found from the run alone"
        )


def _read_gravity_card(
    card: Card, starter: Starter, functions: Mapping[int, tuple[float, ...]]
) -> model.Gravity | None:
    """Read the values and nodes of a /GRAV card; None if they are unknown. Gravity is 0 until its sensor is active."""
    row = get_lines_below_title(card)[0]
    function, skew, sensor, group = (
        card.integer(row, GRAVITY[name]).value
        for name in ("fct_ID", "skew_ID", "sens_ID", "grnod_ID")
    )
    scale = read_reals(row, [GRAVITY["Fscale_y"]])[0] or 1.0
    if function:
        values = model.find_plateaus(functions.get(function, ()), scale)
    else:
        values = (scale,)
    members = starter.group_members(group) if group else (set[int](), set[int]())
    direction = GRAVITY["Dir"].cut(row.text).strip().upper() or "Z"
    if (
        not values
        or not np.isfinite(values).all()
        or members is None
        or direction not in _AXES
    ):
        return None
    axis = None if skew else _AXES.index(direction)
    values = (0.0, *values) if sensor else values
    if group:
        return model.Gravity(
            axis, values, model.make_ids(members[0]), frozenset(members[1])
        )
    return model.Gravity(axis, values)


def _read_functions(starter: Starter) -> Iterator[tuple[int, tuple[float, ...]]]:
    """Yield the id and ordinates of each function; a function that the deck scales has no known ordinates."""
    moved = {get_number(card) for card in starter.named("MOVE_FUNCT") if card.words[1:]}
    for card in starter.named("FUNCT"):
        number = get_number(card)
        yield (
            number,
            ()
            if number in moved
            else tuple(
                read_reals(row, FUNCTION_POINT)[1]
                for row in get_lines_below_title(card)
            ),
        )


# Joints connect parts that do not share nodes; they are ties and rigid bodies that are always active.
# Joints must be inactive while a part is rigid, because a node cannot belong to two rigid bodies.
# The rule on joints comes from Altair's help on incompatible kinematic conditions.


def _find_joints(run: RadiossRun, starter: Starter) -> model.Joints:
    """Return the rigid bodies, and the tied interfaces (/INTER/TYPE2) whose main surface belongs to one part.

    A rigid body that no engine file and no sensor switches is always active, and connects the parts of its nodes. If
    there are no engine files, any body may be switched.
    """
    of_parts = (
        card
        for card in starter.named("SURF")
        if card.words[1:2] == ("PART",) and card.words[2:]
    )
    surfaces = {get_number(card, -1): card for card in of_parts}
    joints = list[model.Joint]()
    switched = list[model.Joint]()
    unknown = list[str]()
    for card in starter.named("INTER", *_OTHER_TIES):
        interface = card.words[:2] == ("INTER", "TYPE2")
        tie = _read_interface(card, starter, surfaces) if interface else None
        if tie:
            joints.append(tie)
        elif interface or card.words[0] != "INTER":
            unknown.append(_name_card(card))
    for body in starter.bodies:
        always_on = (
            bool(run.legs) and not body.sensor and body.node.value not in run.named
        )
        members = starter.group_members(body.group)
        if members:
            joint = model.Joint(
                "rigid body",
                model.make_ids(members[0] | {body.node.value}),
                frozenset(members[1]),
            )
            (joints if always_on else switched).append(joint)
        elif always_on:
            unknown.append(f"/RBODY/{body.id} ({body.card.at})")
    return model.Joints(tuple(joints), tuple(unknown), tuple(switched))


def _read_interface(
    card: Card, starter: Starter, surfaces: dict[int, Card]
) -> model.Joint | None:
    """Return the joint of a tied interface; None if its nodes or its main part are unknown."""
    rows = get_lines_below_title(card)
    if rows:
        group, surface = (value.value for value in card.numbers(rows[0], INTERFACE))
    else:
        group, surface = (0, 0)
    members = starter.group_members(group)
    main = frozenset(
        _list_surface_ids(surfaces[surface]) if surface in surfaces else ()
    )
    if members is None or len(main) != 1:
        return None
    return model.Joint(
        "tied interface", model.make_ids(members[0]), frozenset(members[1]) | main
    )


def _list_surface_ids(card: Card) -> Iterator[int]:
    """Yield the ids below the title of a surface."""
    for row in get_lines_below_title(card):
        yield from (
            value.value for value in card.numbers(row, ID_LIST) if value.value > 0
        )
