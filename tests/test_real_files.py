"""Files that solvers really wrote: what is read from each, or why it is refused.

The files are no part of the project.  They are looked for in ``../shared/real`` beside it, or in the folder
named by D2RPICK_REAL_FILES, which holds ``histories/``; without them these tests are skipped.

The numbers are awk's.  glstat: last field of the lines whose columns 2-32 are ``time`` or ``internal energy``
and dots, of the states that have both.  CSV: fields 1 and 2 between commas, below one header line, with
LS-PrePost two.  Each time the first state, the one in the middle (n // 2, from 0) and the last.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import NamedTuple

import pytest

from d2rpick.errors import FormatError
from d2rpick.readers import read_history

FOLDER = Path(os.environ.get("D2RPICK_REAL_FILES", Path(__file__).parents[2] / "shared" / "real")) / "histories"

pytestmark = pytest.mark.skipif(not FOLDER.is_dir(), reason=f"no real files in {FOLDER}; set D2RPICK_REAL_FILES")


class Readable(NamedTuple):
    file: str
    channel: str
    states: int
    first_middle_last: tuple[tuple[float, float], ...]  # time, energy
    note: str  # what its only note speaks of; such files end inside a state or hold no internal energy


READABLE = [
    Readable(
        "Crimping__results-glstat.head16000",
        "internal energy",
        13,
        ((0.0, 2e-20), (0.00299997, 0.00361695), (0.00599994, 0.356039)),
        "stops inside",
    ),
    Readable(
        "FV_crashworthiness__DRI-OLD_LSDYNA-z_acc_filtered.csv",
        "A8874: Z-acceleration",
        152,
        ((0.0, -81362.117188), (0.075999438763, 162256.60938), (0.15000039339, -255236.17188)),
        "no internal energy by its name",
    ),
    Readable(
        "FV_crashworthiness__DRI-OLD_LSDYNA-z_acc_totfloor.csv",
        "A2: Z-Rigid Body Acceleration",
        126,
        ((0.0, -9623.0292969), (0.06299957633, 123345.07812), (0.12499960512, -878.76928711)),
        "no internal energy by its name",
    ),
    Readable(
        "FV_crashworthiness__DRI-OLD_LSDYNA-z_accel_1.csv",
        "Z-acceleration",
        152,
        ((0.0, 39466.921875), (0.075999461114, 157388.57812), (0.15000037849, 67724.9375)),
        "no internal energy by its name",
    ),
    Readable(
        "FV_crashworthiness__F28_validation-e=0-4frames-ALLKE_Global.csv",
        "Energy(J): XY-History ALLKE(Scalar).1/ALLKE",
        61,
        ((0.0, 38764.8), (0.150001, 1273.01), (0.3, 303.246)),
        "no internal energy by its name",
    ),
    Readable(
        "FV_crashworthiness__F28_validation-e=0_energies-ALLPD_Frames.csv",
        "Energy(J): ALLPD_frames/ALLPD/INP2SIM_ELSET_ASSEMBLY_PART-1-1_FRAMES-1/",
        301,
        ((0.0, 0.0), (0.150001, 16961.8), (0.3, 16995.3)),
        "no internal energy by its name",
    ),
    Readable(
        "FV_crashworthiness__mesh_convergence-050x-ALLPD_Skin.csv",
        "Energy(J): ALLPD_Skin/ALLPD/INP2SIM_ELSET_ASSEMBLY_PART-1-1_SKIN-1/",
        61,
        ((0.0, 0.0), (0.150001, 1668.28), (0.3, 1671.43)),
        "no internal energy by its name",
    ),
    Readable(
        "FV_crashworthiness__ovalization_study-e=070-ALLKE_Global.csv",
        "Energy(J): ALLKE_Global/ALLKE",
        61,
        ((0.0, 49697.8), (0.150001, 1941.81), (0.3, 787.411)),
        "no internal energy by its name",
    ),
    Readable(
        "Masters-Project__Steel_Explicit-glstat.head16000",
        "internal energy",
        17,
        ((0.0, 2e-20), (0.00399979, 0.330105), (0.0079998, 1.31465)),
        "cut short",
    ),
    Readable(
        "OpenRadioss__miniqa-AMS-boxbeam-reference-BOXBEAMT01.csv",
        "INTERNAL ENERGY",
        801,
        ((0.0, 0.0), (4.0005, 216242.9), (8.001, 350376.8)),
        "",
    ),
    Readable(
        "OpenRadioss__miniqa-FLUIDE_NEW-EBCS-INIV-reference-INIVT01.csv",
        "INTERNAL ENERGY",
        69,
        ((0.0, 506625.0), (0.04930102, 506625.0), (0.09860203, 506625.0)),
        "",
    ),
    Readable(
        "OpenRadioss__miniqa-FLUIDE_NEW-EBCS-INIV-reference-INIVT02.csv",
        "INTERNAL ENERGY",
        69,
        ((0.1000521, 506625.0), (0.1493528, 506625.0), (0.1986539, 506625.0)),
        "",
    ),
    Readable(
        "OpenRadioss__miniqa-FLUIDE_NEW-EBCS-INIV-reference-INIVT03.csv",
        "INTERNAL ENERGY",
        552,
        ((0.2001039, 506625.0), (0.6003122, 506625.0), (0.9990704, 506625.0)),
        "",
    ),
    Readable(
        "OpenRadioss__miniqa-INTERF-INT_7-igsti-small_boule_igsti-dtmin_02-reference-BOULE1V5T01.csv",
        "INTERNAL ENERGY",
        3,
        ((0.0, 0.0), (0.001012834, 0.0), (0.002025667, 0.0)),
        "",
    ),
    Readable(
        "OpenRadioss__miniqa-OPTIONS-NEW_BOX_V11-BOX_GRSHEL-reference-FOAM_GRSHELT01.csv",
        "INTERNAL ENERGY",
        1,
        ((0.0, 0.0), (0.0, 0.0), (0.0, 0.0)),
        "",
    ),
    Readable(
        "OpenRadioss__miniqa-RESTART-cra2-reference-CRA2V44T01.csv",
        "INTERNAL ENERGY",
        50,
        ((0.0, 0.0), (1.250651, 90145.88), (2.451106, 146200.3)),
        "",
    ),
    Readable(
        "OpenRadioss__miniqa-RESTART-cra2-reference-CRA2V44T02.csv",
        "INTERNAL ENERGY",
        50,
        ((2.50147, 148146.4), (3.750046, 170671.5), (4.950121, 189325.7)),
        "",
    ),
    Readable(
        "OpenRadioss__miniqa-RUPTURE-FAIL_TAB-ELEM_SAMP-reference-1ELEM_SAMPT01.csv",
        "INTERNAL ENERGY",
        258,
        ((0.0, 0.0), (1.290304, 15.86773), (2.596601, 28.01545)),
        "",
    ),
    Readable(
        "OpenRadioss__miniqa-SPH-WavesCompression-reference-CUBCT01.csv",
        "INTERNAL ENERGY",
        45,
        ((0.0, 0.004994001), (14.94388, 0.2808917), (29.52089, 0.3925156)),
        "",
    ),
    Readable(
        "OpenRadioss__miniqa-onefile_rad-reference-CRA2AV4T01.csv",
        "INTERNAL ENERGY",
        400,
        ((0.0, 0.0), (10.0003, 951851.6), (19.95049, 2455007.0)),
        "",
    ),
    Readable(
        "PILLARS-LSDyna__Bolt_B_Explicit-glstat",
        "internal energy",
        1001,
        ((0.0, 2e-20), (2.4998, 52.1919), (4.99989, 56.2738)),
        "",
    ),
    Readable(
        "PILLARS-LSDyna__test_parachute-windflow_v1_thru_v10-glstat",
        "internal energy",
        1501,
        ((0.0, 2042.35), (0.00749911, 2086.31), (0.0149982, 2085.42)),
        "",
    ),
    Readable(
        "Yasu2019__ASSY_T01.csv",
        "INTERNAL ENERGY",
        1,
        ((0.0, 0.0), (0.0, 0.0), (0.0, 0.0)),
        "",
    ),
    Readable(
        "ansys-example-data__result_files-binout-binout_glstat.l2a-glstat",
        "internal energy",
        251,
        ((0.0, 2e-20), (0.000249081, 134184.0), (0.00049918, 1540880.0)),
        "",
    ),
    Readable(
        "dyna_pladebuk__Plade_300_150_4-BB-binout.l2a-glstat",
        "internal energy",
        1,
        ((0.0, 2e-20), (0.0, 2e-20), (0.0, 2e-20)),
        "",
    ),
    Readable(
        "editOpeniGame__Bolt_B_Explicit-glstat.head16000",
        "internal energy",
        17,
        ((0.0, 1.6e-19), (0.0398316, 0.0208757), (0.079875, 0.242757)),
        "stops inside",
    ),
    Readable(
        "lasso-python__sph_models-R12_2_1-binout.l2a-glstat",
        "internal energy",
        88,
        ((0.0, 2e-20), (0.0175617, 2.21453), (0.0347576, 2.21402)),
        "",
    ),
    Readable(
        "lasso-python__sph_models-R7_1_2-binout.l2a-glstat",
        "internal energy",
        88,
        ((0.0, 2e-20), (0.0175728, 2.35305), (0.0347804, 2.35158)),
        "",
    ),
]

# binout, HDF5 and T01 are binary; matsum and d3hsp are text without a table.
BINARY = "binary data of no known format"
NO_TABLE = "no rows of at least two numbers"
REFUSED = {
    "OpenRadioss__miniqa-AMS-boxbeam-reference-BOXBEAMT01": BINARY,
    "OpenRadioss__miniqa-FLUIDE_NEW-EBCS-INIV-reference-INIVT01": BINARY,
    "OpenRadioss__miniqa-FLUIDE_NEW-EBCS-INIV-reference-INIVT02": BINARY,
    "OpenRadioss__miniqa-FLUIDE_NEW-EBCS-INIV-reference-INIVT03": BINARY,
    "OpenRadioss__miniqa-INTERF-INT_7-igsti-small_boule_igsti-dtmin_02-reference-BOULE1V5T01": BINARY,
    "OpenRadioss__miniqa-OPTIONS-NEW_BOX_V11-BOX_GRSHEL-reference-FOAM_GRSHELT01": BINARY,
    "OpenRadioss__miniqa-RESTART-cra2-reference-CRA2V44T01": BINARY,
    "OpenRadioss__miniqa-RESTART-cra2-reference-CRA2V44T02": BINARY,
    "OpenRadioss__miniqa-RUPTURE-FAIL_TAB-ELEM_SAMP-reference-1ELEM_SAMPT01": BINARY,
    "OpenRadioss__miniqa-SPH-WavesCompression-reference-CUBCT01": BINARY,
    "OpenRadioss__miniqa-onefile_rad-reference-CRA2AV4T01": BINARY,
    "Yasu2019__ASSY_T01": BINARY,
    "ansys-example-data__result_files-binout-binout_glstat": BINARY,
    "dyna_pladebuk__Plade_300_150_4-BB-binout": BINARY,
    "lasso-python__sph_models-R12_2_1-binout": BINARY,
    "lasso-python__sph_models-R7_1_2-binout": BINARY,
    "lasso_ansys_glstat.h5": BINARY,
    "pandas_fixed.h5": BINARY,
    "pandas_fixed_rangeindex.h5": BINARY,
    "pandas_table.h5": BINARY,
    "qd-cae-python__test-binout": BINARY,
    "Masters-Project__Steel_Explicit-Kinetic_Energy": "an LS-PrePost Curveplot is not read",
    "PILLARS-LSDyna__Bolt_B_Explicit-matsum": NO_TABLE,
    "dyna_pladebuk__Plade_300_150_4-BB-binout.l2a-matsum": NO_TABLE,
    "dyna_pladebuk__Plade_300_150_4-BB-matsum": NO_TABLE,
    "lasso-python__sph_models-R12_2_1-binout.l2a-matsum": NO_TABLE,
    "lasso-python__sph_models-R12_2_1-d3hsp": NO_TABLE,
    "lasso-python__sph_models-R7_1_2-binout.l2a-matsum": NO_TABLE,
    "lasso-python__sph_models-R7_1_2-d3hsp": NO_TABLE,
}


@pytest.mark.parametrize("expected", READABLE, ids=lambda expected: expected.file)
def test_read(expected: Readable) -> None:
    history = read_history([str(FOLDER / expected.file)])
    assert (history.channel, history.time.size) == (expected.channel, expected.states)
    states = list(zip(history.time.tolist(), history.energy.tolist(), strict=True))
    assert (states[0], states[len(states) // 2], states[-1]) == expected.first_middle_last
    assert history.complete is not expected.file.endswith(".head16000")
    assert len(history.notes) == bool(expected.note)
    assert expected.note in "".join(history.notes)


@pytest.mark.parametrize("file", REFUSED)
def test_refused(file: str) -> None:
    with pytest.raises(FormatError, match=REFUSED[file]):
        read_history([str(FOLDER / file)])


def test_no_file_is_left_out() -> None:
    assert {file.name for file in FOLDER.iterdir()} == {expected.file for expected in READABLE} | set(REFUSED)
