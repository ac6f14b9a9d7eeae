"""Map formulation numbers of elements to formulation names and to the classes that determine the element cost.

The costs of the following classes were measured: QBAT, QEPH and BT shells, beams, solids and springs (weights in
`d2rpick.choice.parts.cost`). Any other formulation has the class of a similar formulation, and ``measured`` is False.
"""

from __future__ import annotations

from typing import Final

from d2rpick.deck.model import Formulation

BT, QEPH, QBAT, BEAM, SOLID, SPRING = "BT", "QEPH", "QBAT", "beam", "solid", "spring"
# Number of integration points per layer of a shell, keyed by formulation class.
_IN_PLANE: Final = {BT: 1, QEPH: 1, QBAT: 4}

# Formulation of Radioss quadrilaterals, keyed by Ishell. Source: Altair's public help for /PROP/TYPE1.
_ISHELL: Final = {
    **{number: Formulation(f"BT (Ishell {number})", BT) for number in (1, 2, 3, 4)},
    12: Formulation("QBAT", QBAT), 24: Formulation("QEPH", QEPH),
}  # fmt: skip
_ISH3N: Final = {
    **dict.fromkeys((0, 1, 2), Formulation("C0 triangle", BT, measured=False)),
    30: Formulation("DKT18", QBAT, measured=False), 31: Formulation("DKT_S3", QEPH, measured=False),
}  # fmt: skip
# Names of Radioss solids by Isolid. They share one class, because the measured costs of 24, 17 and 1 are equal.
_ISOLID: Final = {
    5: "HEPH5",
    14: "HA8",
    24: "HEPH",
    **{number: f"SOLID{number}" for number in (1, 2, 12, 17, 18)},
}
_ISOLID_MEASURED: Final = {1, 17, 24}

# Formulation name and class of LS-DYNA shells by ELFORM; the class follows from the integration points.
_ELFORM_SHELL: Final = {
    1: ("Hughes-Liu", BT), 2: ("Belytschko-Tsay", BT), 3: ("BCIZ triangle", BT), 4: ("C0 triangle", BT),
    5: ("membrane", BT), 6: ("S/R Hughes-Liu", QBAT), 7: ("S/R co-rotational Hughes-Liu", QBAT),
    8: ("Belytschko-Leviathan", QEPH), 9: ("membrane", QBAT), 10: ("Belytschko-Wong-Chiang", BT),
    11: ("co-rotational Hughes-Liu", BT), 16: ("fully integrated", QBAT), 17: ("DKT triangle", QBAT),
    18: ("fully integrated linear", QBAT), 20: ("fully integrated linear", QBAT), 21: ("fully integrated linear", QBAT),
    25: ("Belytschko-Tsay with thickness stretch", BT), 26: ("fully integrated with thickness stretch", QBAT),
    -16: ("fully integrated, more accurate", QBAT),
}  # fmt: skip


def find_radioss_formulation(
    kind: str, shell: int, triangle: int, solid: int
) -> Formulation | None:
    """Return the Radioss formulation of one kind of element from its property flags; None if it is unknown."""
    if kind == "shell":
        return _add_layer_points(
            _ISHELL.get(shell, Formulation(f"Ishell {shell}", None, measured=False))
        )
    if kind == "triangle":
        return _add_layer_points(
            _ISH3N.get(triangle, Formulation(f"Ish3n {triangle}", None, measured=False))
        )
    if kind == "solid":
        return Formulation(
            _ISOLID.get(solid, f"Isolid {solid}"),
            SOLID,
            measured=solid in _ISOLID_MEASURED,
        )
    return _make_plain_formulation(kind, measured=True)


def find_ls_dyna_formulation(kind: str, elform: int) -> Formulation | None:
    """Return the LS-DYNA formulation of one kind of element from its ELFORM; None if it is unknown."""
    if kind == "shell":
        name, cost = _ELFORM_SHELL.get(elform, ("shell", None))
        return _add_layer_points(
            Formulation(f"{name} (ELFORM {elform})", cost, measured=False)
        )
    if kind in ("solid", "thick shell"):
        return Formulation(f"{kind} (ELFORM {elform})", SOLID, measured=False)
    return _make_plain_formulation(kind, measured=False)


def _add_layer_points(shell: Formulation) -> Formulation:
    """Add the number of integration points per layer to the formulation of a shell."""
    return shell._replace(in_plane=_IN_PLANE.get(shell.cost or "", 0))


def _make_plain_formulation(kind: str, *, measured: bool) -> Formulation | None:
    """Return the formulation of an element kind that has only one formulation; None if it is unknown."""
    alike = {"beam": BEAM, "truss": BEAM, "spring": SPRING, "seatbelt": SPRING}
    cost = alike.get(kind)
    if kind in ("tetrahedron", "pentahedron", "thick shell"):
        cost = SOLID
    if cost:
        return Formulation(kind, cost, measured and kind in ("beam", "spring"))
    return None
