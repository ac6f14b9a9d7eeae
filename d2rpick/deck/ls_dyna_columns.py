"""Declare the data lines of the LS-DYNA keywords that d2rpick reads or writes.

The names and their order come from the vendor's keyword data as published in its Python library. Columns after the last
one that is read are omitted.
"""

from __future__ import annotations

from typing import Final

from d2rpick.deck.columns import DataLine, integers, reals, words

# Lines of *DEFORMABLE_TO_RIGID_AUTOMATIC: two header lines, then one line per part or part set.
SWITCH_TIMES: Final = DataLine(
    integers("SWSET CODE"), reals("TIME1 TIME2 TIME3"), integers("ENTNO RELSW PAIRED")
)
SWITCH_COUNTS: Final = DataLine(
    integers("NRBF NCSF"), reals("RWF DTMAX"), integers("D2R R2D"), reals("OFFSET")
)
TO_RIGID: Final = DataLine(integers("PID LRB"), words("PTYPE"))
TO_DEFORMABLE: Final = DataLine(integers("PID"), words("PTYPE"))

# Lines of *DEFORMABLE_TO_RIGID_INERTIA and *RIGID_DEFORMABLE_CONTROL.
INERTIA_PART: Final = DataLine(integers("PID"))
INERTIA_CENTRE: Final = DataLine(reals("XC YC ZC TM"))
INERTIA_TENSOR: Final = DataLine(reals("IXX IXY IXZ IYY IYZ IZZ"))
RESTART_CONTROL: Final = DataLine(reals("NRBF NCSF RWF DTMAX"))

# Lines of *PART: the line below the title, and the first line that the option INERTIA adds.
PART: Final = DataLine(integers("PID SECID"), words("MID"))
PART_INERTIA: Final = DataLine(reals("XC YC ZC TM"), integers("IRCS"))

# Lines of *SECTION; the second line begins with an area, a thickness or a damping constant.
SECTION: Final = DataLine(integers("SECID ELFORM"), reals("SHRF"), integers("NIP"))
SECTION_SIZES: Final = DataLine(reals("FIRST"))

# Lines of *MAT: the first line of an elastic material, and the second line of *MAT_RIGID.
MATERIAL: Final = DataLine(words("MID"), reals("RO E PR"))
RIGID_MATERIAL: Final = DataLine(reals("CMO"), integers("CON1 CON2"))

# Lines of sets, and the id line of a keyword with the option ID.
SET: Final = DataLine(integers("SID"))
SET_MEMBERS: Final = DataLine(integers("ID1 ID2 ID3 ID4 ID5 ID6 ID7 ID8"))
SET_COLUMN: Final = DataLine(integers("ID1"))
SET_PART_LIST: Final = DataLine(integers("PID1 PID2 PID3 PID4 PID5 PID6 PID7 PID8"))
ENTITY: Final = DataLine(integers("ID"))

# Lines of *CONSTRAINED keywords; NID is a node, or a node set if the keyword has the option SET.
NODAL_BODY: Final = DataLine(integers("PID CID NSID"))
EXTRA_NODES: Final = DataLine(integers("PID NID"))
JOINT: Final = DataLine(integers("N1 N2 N3 N4 N5 N6"))
NODE_PAIR: Final = DataLine(integers("N1 N2"))
NODE_SET: Final = DataLine(integers("NSID"))
MERGED_BODIES: Final = DataLine(integers("PIDL PIDC"))
GLOBAL_CONSTRAINT: Final = DataLine(integers("TC RC DIR"), reals("X Y Z"))

# Lines of *BOUNDARY_SPC with the option BIRTH_DEATH, and of *BOUNDARY_PRESCRIBED_MOTION.
SPC: Final = DataLine(integers("NID CID DOFX DOFY DOFZ DOFRX DOFRY DOFRZ"))
SPC_TIMES: Final = DataLine(reals("BIRTH DEATH"))
MOTION: Final = DataLine(
    integers("TYPEID DOF VAD LCID"), reals("SF"), integers("VID"), reals("DEATH BIRTH")
)

# Lines of *LOAD_BODY, *LOAD_BODY_PARTS, and *DEFINE_CURVE (including its points).
BODY_LOAD: Final = DataLine(
    integers("LCID"),
    reals("SF"),
    integers("LCIDDR"),
    reals("XC YC ZC"),
    integers("CID"),
)
LOADED_PARTS: Final = DataLine(integers("PSID"))
CURVE: Final = DataLine(integers("LCID SIDR"), reals("SFA SFO OFFA OFFO"))
CURVE_POINT: Final = DataLine(reals("A1 O1", 20))

CONTACT: Final = DataLine(integers("SURFA SURFB SURFATYP SURFBTYP"))

# Lines of *SENSOR_CONTROL (two lines), *SENSOR_SWITCH and *SENSOR_DEFINE_FORCE.
SENSOR_CONTROL: Final = DataLine(
    integers("CNTLID"), words("TYPE"), integers("TYPEID TIMEOFF NREP")
)
CONTROL_SWITCHES: Final = DataLine(
    words("INITSTT"), integers("SWIT1 SWIT2 SWIT3 SWIT4 SWIT5 SWIT6 SWIT7")
)
SENSOR_SWITCH: Final = DataLine(
    integers("SWITID"),
    words("TYPE"),
    integers("SENSID"),
    words("LOGIC"),
    reals("VALUE"),
    integers("FILTRID"),
    reals("TIMWIN TDELAY"),
)
SENSOR_FORCE: Final = DataLine(
    integers("SENSID"), words("FTYPE"), integers("TYPEID"), words("VID")
)

TERMINATION: Final = DataLine(reals("ENDTIM"))
DATABASE: Final = DataLine(reals("DT"), integers("BINARY LCUR"))

# The four lines of *INCLUDE_TRANSFORM below the file name.
ID_OFFSETS: Final = DataLine(integers("IDNOFF IDEOFF IDPOFF IDMOFF IDSOFF"))
OTHER_OFFSET: Final = DataLine(integers("IDROFF"))
UNIT_FACTORS: Final = DataLine(reals("FCTMAS FCTTIM FCTLEN"))
TRANSFORMATION: Final = DataLine(integers("TRANID"))

# Lines of *PARAMETER (four pairs of name and value), and of *PARAMETER_DUPLICATION.
PARAMETER_FLAG: Final = DataLine(integers("DFLAG"))
PARAMETERS: Final = DataLine(
    words("NAME1 VALUE1 NAME2 VALUE2 NAME3 VALUE3 NAME4 VALUE4")
)


def make_node_line(id_width: int, real_width: int) -> DataLine:
    """Return a data line of *NODE with the column widths of the deck format."""
    return DataLine(
        integers("NID", id_width), reals("X Y Z", real_width), integers("TC", id_width)
    )


def make_element_line(width: int, node_count: int) -> DataLine:
    """Return a data line of *ELEMENT with ``node_count`` nodes and the width of the deck format."""
    nodes = " ".join(f"N{number}" for number in range(1, node_count + 1))
    return DataLine(integers(f"EID PID {nodes}", width))


def make_watched_line(width: int, node_count: int) -> DataLine:
    """Return a data line of *DATABASE_HISTORY_NODE with ``node_count`` node ids."""
    nodes = " ".join(f"ID{number}" for number in range(1, node_count + 1))
    return DataLine(integers(nodes, width))
