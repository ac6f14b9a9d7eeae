"""Declare the data lines of the Radioss blocks that d2rpick reads or writes.

The names and their order come from Altair's public help for each keyword, and from the solver's published source. Real
numbers have 20 characters, other fields 10. Columns after the last one that is read are omitted.
"""

from __future__ import annotations

from typing import Final

from d2rpick.deck.columns import DataLine, blank, integers, reals, words

_REAL: Final = 20  # Width of the column of a real number [characters].

# Lines of /BEGIN: the version of the input, and a line with units.
BEGIN: Final = DataLine(integers("Invers"))
UNITS: Final = DataLine(words("Mass Length Time", _REAL))

# The four lines of /RBODY.
RIGID_BODY: Final = DataLine(
    integers("node_ID sens_ID Skew_ID Ispher"),
    reals("Mass", _REAL),
    integers("grnd_ID Ikrem ICoG surf_ID"),
)
BODY_INERTIA: Final = DataLine(reals("Jxx Jyy Jzz", _REAL))
BODY_PRODUCTS: Final = DataLine(reals("Jxy Jyz Jxz", _REAL))
BODY_FLAGS: Final = DataLine(integers("Ioptoff Iexpams Ifail"))

# Lines of /PART: the line below the title, and the additional line of a rigid part (Irigid 1).
PART: Final = DataLine(
    integers("prop_ID mat_ID subset_ID"), reals("Thick", _REAL), integers("Irigid")
)
RIGID_PART: Final = DataLine(integers("node_ID"), blank(40), integers("sens_ID"))

MERGE: Final = DataLine(integers("main_ID M_type secon_ID S_type"))
NODE: Final = DataLine(integers("node_ID"), reals("X Y Z", _REAL))
# Line of ids in /GRNOD, /SUBSET and /SURF/PART; the first field is also that of the id in /TH/NODE and /INIVEL/NODE.
# In /TH/NODE, the second number is the skew system.
ID_LIST: Final = DataLine(integers("ID1 ID2 ID3 ID4 ID5 ID6 ID7 ID8 ID9 ID10"))

# Lines of /RWALL: the line below the title, the distance, and points.
WALL: Final = DataLine(integers("node_ID Slide grnd_ID1 grnd_ID2 Iform"))
WALL_SIZES: Final = DataLine(reals("d fric Diameter", _REAL))
POINT: Final = DataLine(reals("X Y Z", _REAL))

# Lines of /INIVEL with a node group; with AXIS, the group has its own line above the velocities.
VELOCITY: Final = DataLine(reals("Vx Vy Vz", _REAL), integers("grnod_ID"))
AXIS_GROUP: Final = DataLine(integers("Dir frame_ID grnod_ID"))
AXIS_VELOCITY: Final = DataLine(reals("Vx Vy Vz Vr", _REAL))
VELOCITY_START: Final = DataLine(reals("Tstart", _REAL), integers("sens_ID"))

# Lines of /GRAV and of the prescribed motions /IMPVEL, /IMPDISP and /IMPACC, with or without FGEO.
GRAVITY: Final = DataLine(
    integers("fct_ID"),
    words("Dir"),
    integers("skew_ID sens_ID grnod_ID"),
    blank(10),
    reals("Ascale_x Fscale_y", _REAL),
)
MOTION_TIMES: Final = DataLine(reals("Ascale_x Fscale_y Tstart Tstop", _REAL))
FREE_MOTION: Final = DataLine(integers("fct_ID part_ID"))

# Line of /BCS: three digits for the translations, three for the rotations, and the skew.
SUPPORT: Final = DataLine(
    blank(3),
    words("Tra", 3),
    blank(1),
    words("Rot", 3),
    integers("skew_ID grnod_ID"),
)
FUNCTION_POINT: Final = DataLine(reals("X Y", _REAL))
INTERFACE: Final = DataLine(integers("grnod_ID surf_ID"))

# Lines of /MAT: the density, and below it the elastic constants.
DENSITY: Final = DataLine(reals("rho", _REAL))
ELASTIC: Final = DataLine(reals("E nu", _REAL))

# Lines of /PROP: flags of solids and shells, shell thickness, area of beams and trusses, spring constants.
SOLID_FLAGS: Final = DataLine(
    integers("Isolid Ismstr Icpre Itetra10 Inpts Itetra4 flag7 Iframe")
)
SHELL_SECTION: Final = DataLine(integers("N Istrain"), reals("Thick", _REAL))
AREA: Final = DataLine(reals("Area", _REAL))
SPRING_MASS: Final = DataLine(reals("Mass", _REAL))
SPRING: Final = DataLine(reals("K C", _REAL))
SPRING_FUNCTION: Final = DataLine(words("fct_ID1"))

# Lines below the title of each kind of /SENSOR.
DELAY: Final = DataLine(reals("Tdelay", _REAL))
STOP: Final = DataLine(reals("Tstop", _REAL))
SENSOR_INPUTS: Final = DataLine(integers("sens_ID1 sens_ID2"))
FORCE_SENSOR: Final = DataLine(
    integers("ID"), words("Dir"), reals("Fmin Fmax Tmin", _REAL)
)
# A second number after Tdelay on the same line, which the solver does not read.
AFTER_DELAY: Final = DataLine(blank(_REAL), words("number", _REAL))

# Line of a /RUN in an engine file.
RUN: Final = DataLine(reals("Tstop", _REAL))


def make_radioss_element_line(id_count: int) -> DataLine:
    """Return a data line of elements with ``id_count`` ids."""
    names = " ".join(f"ID{number}" for number in range(1, id_count + 1))
    return DataLine(integers(names))
