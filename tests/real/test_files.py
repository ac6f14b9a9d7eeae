"""Files that solvers really wrote: what is read from each, or why it is refused.

Each time the first state, the one in the middle (n // 2, from 0) and the last, read by others:

* glstat by awk: last field of the lines whose columns 2-32 are ``time`` or ``internal energy`` and dots, of the states
  that have both; matsum by awk: columns 8-20 of the time lines, columns 32-44 of the ``mat.#=`` lines added;
* CSV by awk: fields 1 and 2 between commas, below one header line, with LS-PrePost two; Curveplot: lines of the file;
* T01: what the solver's own converter th_to_csv prints in the CSV file beside it, seven digits;
* binout: lasso-python 2.0.4; HDF5: h5py alone.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import pytest

from d2rpick.errors import FormatError
from d2rpick.histories.opening import Selection, open_run
from tests.reading import read_history
from tests.real.files import real

LONE = ("2",)  # column or curve of another quantity, taken only when it is asked for
FLOOR = 1.999999936531045e-20  # 2e-20 in single precision


class Readable(NamedTuple):
    channel: str
    states: int
    first_middle_last: tuple[tuple[float, float], ...]  # time, energy
    notes: tuple[str, ...] = ()  # what each of its notes speaks of
    energy: tuple[str, ...] = ()  # what has to be asked for: refused without


READABLE = {
    "Crimping__results-glstat.head16000": Readable(
        "internal energy", 13, ((0.0, 2e-20), (0.00299997, 0.00361695), (0.00599994, 0.356039)),
        ("ends within",),
    ),
    "FV_crashworthiness__DRI-OLD_LSDYNA-z_acc_filtered.csv": Readable(
        "A8874: Z-acceleration", 152,
        ((0.0, -81362.117188), (0.075999438763, 162256.60938), (0.15000039339, -255236.17188)),
        ("not an internal energy by its name",), LONE,
    ),
    "FV_crashworthiness__DRI-OLD_LSDYNA-z_acc_totfloor.csv": Readable(
        "A2: Z-Rigid Body Acceleration", 126,
        ((0.0, -9623.0292969), (0.06299957633, 123345.07812), (0.12499960512, -878.76928711)),
        ("not an internal energy by its name",), LONE,
    ),
    "FV_crashworthiness__DRI-OLD_LSDYNA-z_accel_1.csv": Readable(
        "Z-acceleration", 152, ((0.0, 39466.921875), (0.075999461114, 157388.57812), (0.15000037849, 67724.9375)),
        ("not an internal energy by its name",), LONE,
    ),
    "FV_crashworthiness__F28_validation-e=0-4frames-ALLKE_Global.csv": Readable(
        "Energy(J): XY-History ALLKE(Scalar).1/ALLKE", 61, ((0.0, 38764.8), (0.150001, 1273.01), (0.3, 303.246)),
        ("not an internal energy by its name",), LONE,
    ),
    "FV_crashworthiness__F28_validation-e=0_energies-ALLPD_Frames.csv": Readable(
        "Energy(J): ALLPD_frames/ALLPD/INP2SIM_ELSET_ASSEMBLY_PART-1-1_FRAMES-1/", 301,
        ((0.0, 0.0), (0.150001, 16961.8), (0.3, 16995.3)),
        ("not an internal energy by its name",), LONE,
    ),
    "FV_crashworthiness__mesh_convergence-050x-ALLPD_Skin.csv": Readable(
        "Energy(J): ALLPD_Skin/ALLPD/INP2SIM_ELSET_ASSEMBLY_PART-1-1_SKIN-1/", 61,
        ((0.0, 0.0), (0.150001, 1668.28), (0.3, 1671.43)),
        ("not an internal energy by its name",), LONE,
    ),
    "FV_crashworthiness__ovalization_study-e=070-ALLKE_Global.csv": Readable(
        "Energy(J): ALLKE_Global/ALLKE", 61, ((0.0, 49697.8), (0.150001, 1941.81), (0.3, 787.411)),
        ("not an internal energy by its name",), LONE,
    ),
    "Masters-Project__Steel_Explicit-Kinetic_Energy": Readable(
        "Kinetic Energy", 101, ((0.0, 0.0), (0.02499989979, 0.00057965097949), (0.049999900162, 0.00053615897195)),
        ("not an internal energy by its name",), ("1",),
    ),
    "Masters-Project__Steel_Explicit-glstat.head16000": Readable(
        "internal energy", 17, ((0.0, 2e-20), (0.00399979, 0.330105), (0.0079998, 1.31465)),
        ("ends within",),
    ),
    "OpenRadioss__miniqa-AMS-boxbeam-reference-BOXBEAMT01": Readable(
        "internal_energy", 801, ((0.0, 0.0), (4.0005, 216242.9), (8.001, 350376.8)),
        ("no variables of part 2 in the file",),
    ),
    "OpenRadioss__miniqa-AMS-boxbeam-reference-BOXBEAMT01.csv": Readable(
        "INTERNAL ENERGY", 801, ((0.0, 0.0), (4.0005, 216242.9), (8.001, 350376.8)),
    ),
    "OpenRadioss__miniqa-FLUIDE_NEW-EBCS-INIV-reference-INIVT01": Readable(
        "internal_energy", 69, ((0.0, 506625.0), (0.04930102, 506625.0), (0.09860203, 506625.0)),
    ),
    "OpenRadioss__miniqa-FLUIDE_NEW-EBCS-INIV-reference-INIVT01.csv": Readable(
        "INTERNAL ENERGY", 69, ((0.0, 506625.0), (0.04930102, 506625.0), (0.09860203, 506625.0)),
    ),
    "OpenRadioss__miniqa-FLUIDE_NEW-EBCS-INIV-reference-INIVT02": Readable(
        "internal_energy", 69, ((0.1000521, 506625.0), (0.1493528, 506625.0), (0.1986539, 506625.0)),
    ),
    "OpenRadioss__miniqa-FLUIDE_NEW-EBCS-INIV-reference-INIVT02.csv": Readable(
        "INTERNAL ENERGY", 69, ((0.1000521, 506625.0), (0.1493528, 506625.0), (0.1986539, 506625.0)),
    ),
    "OpenRadioss__miniqa-FLUIDE_NEW-EBCS-INIV-reference-INIVT03": Readable(
        "internal_energy", 552, ((0.2001039, 506625.0), (0.6003122, 506625.0), (0.9990704, 506625.0)),
    ),
    "OpenRadioss__miniqa-FLUIDE_NEW-EBCS-INIV-reference-INIVT03.csv": Readable(
        "INTERNAL ENERGY", 552, ((0.2001039, 506625.0), (0.6003122, 506625.0), (0.9990704, 506625.0)),
    ),
    "OpenRadioss__miniqa-INTERF-INT_7-igsti-small_boule_igsti-dtmin_02-reference-BOULE1V5T01": Readable(
        "internal_energy", 3, ((0.0, 0.0), (0.001012834, 0.0), (0.002025667, 0.0)),
    ),
    "OpenRadioss__miniqa-INTERF-INT_7-igsti-small_boule_igsti-dtmin_02-reference-BOULE1V5T01.csv": Readable(
        "INTERNAL ENERGY", 3, ((0.0, 0.0), (0.001012834, 0.0), (0.002025667, 0.0)),
    ),
    "OpenRadioss__miniqa-OPTIONS-NEW_BOX_V11-BOX_GRSHEL-reference-FOAM_GRSHELT01": Readable(
        "internal_energy", 1, ((0.0, 0.0), (0.0, 0.0), (0.0, 0.0)),
        ("no variables of parts 1, 4, 10 in the file",),
    ),
    "OpenRadioss__miniqa-OPTIONS-NEW_BOX_V11-BOX_GRSHEL-reference-FOAM_GRSHELT01.csv": Readable(
        "INTERNAL ENERGY", 1, ((0.0, 0.0), (0.0, 0.0), (0.0, 0.0)),
    ),
    "OpenRadioss__miniqa-RESTART-cra2-reference-CRA2V44T01": Readable(
        "internal_energy", 50, ((0.0, 0.0), (1.250651, 90145.88), (2.451106, 146200.3)),
    ),
    "OpenRadioss__miniqa-RESTART-cra2-reference-CRA2V44T01.csv": Readable(
        "INTERNAL ENERGY", 50, ((0.0, 0.0), (1.250651, 90145.88), (2.451106, 146200.3)),
    ),
    "OpenRadioss__miniqa-RESTART-cra2-reference-CRA2V44T02": Readable(
        "internal_energy", 50, ((2.50147, 148146.4), (3.750046, 170671.5), (4.950121, 189325.7)),
    ),
    "OpenRadioss__miniqa-RESTART-cra2-reference-CRA2V44T02.csv": Readable(
        "INTERNAL ENERGY", 50, ((2.50147, 148146.4), (3.750046, 170671.5), (4.950121, 189325.7)),
    ),
    "OpenRadioss__miniqa-RUPTURE-FAIL_TAB-ELEM_SAMP-reference-1ELEM_SAMPT01": Readable(
        "internal_energy", 258, ((0.0, 0.0), (1.290304, 15.86773), (2.596601, 28.01545)),
        ("no variables of part 1 in the file",),
    ),
    "OpenRadioss__miniqa-RUPTURE-FAIL_TAB-ELEM_SAMP-reference-1ELEM_SAMPT01.csv": Readable(
        "INTERNAL ENERGY", 258, ((0.0, 0.0), (1.290304, 15.86773), (2.596601, 28.01545)),
    ),
    "OpenRadioss__miniqa-SPH-WavesCompression-reference-CUBCT01": Readable(
        "internal_energy", 45, ((0.0, 0.004994001), (14.94388, 0.2808917), (29.52089, 0.3925156)),
        ("no variables of part 1 in the file",),
    ),
    "OpenRadioss__miniqa-SPH-WavesCompression-reference-CUBCT01.csv": Readable(
        "INTERNAL ENERGY", 45, ((0.0, 0.004994001), (14.94388, 0.2808917), (29.52089, 0.3925156)),
    ),
    "OpenRadioss__miniqa-onefile_rad-reference-CRA2AV4T01": Readable(
        "internal_energy", 400, ((0.0, 0.0), (10.0003, 951851.6), (19.95049, 2455007.0)),
    ),
    "OpenRadioss__miniqa-onefile_rad-reference-CRA2AV4T01.csv": Readable(
        "INTERNAL ENERGY", 400, ((0.0, 0.0), (10.0003, 951851.6), (19.95049, 2455007.0)),
    ),
    "PILLARS-LSDyna__Bolt_B_Explicit-glstat": Readable(
        "internal energy", 1001, ((0.0, 2e-20), (2.4998, 52.1919), (4.99989, 56.2738)),
    ),
    "PILLARS-LSDyna__Bolt_B_Explicit-matsum": Readable(
        "internal energy of all parts", 1001, ((0.0, 0.0), (2.4998, 52.19226), (4.9999, 56.2733)),
        ("without any internal energy: part 101", "the energies of all parts were added",),
    ),
    "PILLARS-LSDyna__test_parachute-windflow_v1_thru_v10-glstat": Readable(
        "internal energy", 1501, ((0.0, 2042.35), (0.00749911, 2086.31), (0.0149982, 2085.42)),
    ),
    "Yasu2019__ASSY_T01": Readable(
        "internal_energy", 1, ((0.0, 0.0), (0.0, 0.0), (0.0, 0.0)),
        ("no variables of parts 1, 2, 3, 4, 101, 102, 103 in the file",),
    ),
    "Yasu2019__ASSY_T01.csv": Readable(
        "INTERNAL ENERGY", 1, ((0.0, 0.0), (0.0, 0.0), (0.0, 0.0)),
    ),
    "ansys-example-data__result_files-binout-binout_glstat": Readable(
        "internal_energy", 251,
        ((0.0, FLOOR), (0.0002490814949851483, 134183.59375), (0.0004991799360141158, 1540881.25)),
    ),
    "ansys-example-data__result_files-binout-binout_glstat.l2a-glstat": Readable(
        "internal energy", 251, ((0.0, 2e-20), (0.000249081, 134184.0), (0.00049918, 1540880.0)),
    ),
    "dyna_pladebuk__Plade_300_150_4-BB-binout": Readable(
        "internal_energy", 1, ((0.0, 2e-20), (0.0, 2e-20), (0.0, 2e-20)),
    ),
    "dyna_pladebuk__Plade_300_150_4-BB-binout.l2a-glstat": Readable(
        "internal energy", 1, ((0.0, 2e-20), (0.0, 2e-20), (0.0, 2e-20)),
    ),
    "dyna_pladebuk__Plade_300_150_4-BB-binout.l2a-matsum": Readable(
        "internal energy of all parts", 1, ((0.0, 0.0), (0.0, 0.0), (0.0, 0.0)),
        ("without any internal energy: part 1", "the energies of all parts were added",),
    ),
    "dyna_pladebuk__Plade_300_150_4-BB-matsum": Readable(
        "internal energy of all parts", 1, ((0.0, 0.0), (0.0, 0.0), (0.0, 0.0)),
        ("without any internal energy: part 1", "the energies of all parts were added",),
    ),
    "editOpeniGame__Bolt_B_Explicit-glstat.head16000": Readable(
        "internal energy", 17, ((0.0, 1.6e-19), (0.0398316, 0.0208757), (0.079875, 0.242757)),
        ("ends within",),
    ),
    "lasso-python__sph_models-R12_2_1-binout": Readable(
        "internal_energy", 88,
        ((0.0, FLOOR), (0.017561689019203186, 2.214533567428589), (0.03475764021277428, 2.214017152786255)),
    ),
    "lasso-python__sph_models-R12_2_1-binout.l2a-glstat": Readable(
        "internal energy", 88, ((0.0, 2e-20), (0.0175617, 2.21453), (0.0347576, 2.21402)),
    ),
    "lasso-python__sph_models-R12_2_1-binout.l2a-matsum": Readable(
        "internal energy of all parts", 88, ((0.0, 0.0), (0.017562, 2.2145), (0.034758, 2.214)),
        ("without any internal energy: part 1", "the energies of all parts were added",),
    ),
    "lasso-python__sph_models-R7_1_2-binout": Readable(
        "internal_energy", 88,
        ((0.0, FLOOR), (0.01757276989519596, 2.353053331375122), (0.03478036820888519, 2.3515756130218506)),
    ),
    "lasso-python__sph_models-R7_1_2-binout.l2a-glstat": Readable(
        "internal energy", 88, ((0.0, 2e-20), (0.0175728, 2.35305), (0.0347804, 2.35158)),
    ),
    "lasso-python__sph_models-R7_1_2-binout.l2a-matsum": Readable(
        "internal energy of all parts", 88, ((0.0, 0.0), (0.017573, 2.3531), (0.03478, 2.3516)),
        ("without any internal energy: part 1", "the energies of all parts were added",),
    ),
    "lasso_ansys_glstat.h5": Readable(
        "internal_energy", 251,
        ((0.0, FLOOR), (0.0002490814949851483, 134183.59375), (0.0004991799360141158, 1540881.25)),
    ),
    "pandas_fixed.h5": Readable(
        "glstat/internal_energy", 251,
        ((0.0, FLOOR), (0.0002490814949851483, 134183.59375), (0.0004991799360141158, 1540881.25)),
    ),
    "pandas_fixed_rangeindex.h5": Readable(
        "glstat/internal_energy", 251,
        ((0.0, FLOOR), (0.0002490814949851483, 134183.59375), (0.0004991799360141158, 1540881.25)),
    ),
    "pandas_table.h5": Readable(
        "glstat/internal_energy", 251,
        ((0.0, FLOOR), (0.0002490814949851483, 134183.59375), (0.0004991799360141158, 1540881.25)),
    ),
}  # fmt: skip

NO_TABLE = "no rows of at least two numbers"
REFUSED = {
    "lasso-python__sph_models-R12_2_1-d3hsp": NO_TABLE,
    "lasso-python__sph_models-R7_1_2-d3hsp": NO_TABLE,
    "qd-cae-python__test-binout": "no glstat or matsum in it, but swforc; name the binout of the run that holds it",
}


@pytest.mark.parametrize("file", READABLE)
def test_read(file: str) -> None:
    expected = READABLE[file]
    if expected.energy:
        with pytest.raises(FormatError, match="by its name not an internal energy"):
            read_history([real(f"histories/{file}")])
    history = read_history([real(f"histories/{file}")], Selection(energy=expected.energy))
    assert (history.channel, history.time.size) == (expected.channel, expected.states)
    states = list(zip(history.time.tolist(), history.energy.tolist(), strict=True))
    digits = {"radioss-th": 1e-6, "matsum": 1e-15}.get(history.format, 0.0)  # sums depend on their order
    for state, written in zip(
        (states[0], states[len(states) // 2], states[-1]), expected.first_middle_last, strict=True
    ):
        assert state == pytest.approx(written, rel=digits, abs=0.0)
    assert history.complete is not file.endswith(".head16000")
    assert len(history.notes) == len(expected.notes)
    for note, phrase in zip(history.notes, expected.notes, strict=True):
        assert phrase in note


@pytest.mark.parametrize("file", REFUSED)
def test_refused(file: str) -> None:
    with pytest.raises(FormatError, match=REFUSED[file]):
        read_history([real(f"histories/{file}")])


def test_no_file_is_left_out() -> None:
    assert {file.name for file in Path(real("histories")).iterdir()} == {*READABLE, *REFUSED}


# Tables among the files beside them, and what is said of each.
MORE = {
    "FV_crashworthiness__DRI-OLD_LSDYNA-z_many.csv": "'Z-acceleration', by its name not an internal energy",
    "FV_crashworthiness__F28_validation-plot-data.csv": r":14: time steps back from 12\.011 to 0\.967",
    "FV_crashworthiness__ovalization_study-e=030-AT3_Floor.csv": ":303: a second header, another curve begins here",
    "Masters-Project__Steel_Implicit-Energy_Ratio.head6": "'Energy Ratio', by its name not an internal energy",
}
PAIRS = {
    "UMAT_2scale_LSDYNA__curve.txt": (300, (0.0, 4e7), (4.2000001606841885e-06, 42607482.295758456)),
    "UMAT_2scale_LSDYNA__stress_x_av.csv": (24, (0.0, 922.56408691), (0.50034189224, 667.45178223)),
}


def test_a_time_history_as_text_is_read() -> None:
    """One state, whose second line of numbers begins with the mass, as the file shows."""
    file = real("more-histories/luchete80__radioss_tutorials-test-testT01.ascii")
    history = read_history([file])
    assert (history.format, history.channel, history.time.tolist()) == ("radioss-th", "internal_energy", [0.0])
    run = open_run([file])
    assert run.databases[0].channel("mass").tolist() == [0.500980584]
    assert run.databases[0].channel("contact_energy").tolist() == [381.780503]
    assert run.databases[0].complete
    assert "no variables of parts 1, 2, 4, 5" in history.notes[0]


@pytest.mark.parametrize("file", MORE)
def test_tables_that_hold_no_energy_are_refused(file: str) -> None:
    with pytest.raises(FormatError, match=MORE[file]):
        read_history([real(f"more-histories/{file}")])


@pytest.mark.parametrize("file", PAIRS)
def test_pairs_with_a_count_are_read(file: str) -> None:
    states, first, second = PAIRS[file]
    history = read_history([real(f"more-histories/{file}")])
    assert history.time.size == states
    assert list(zip(history.time[:2].tolist(), history.energy[:2].tolist(), strict=True)) == [first, second]
    assert not history.notes
    assert history.complete


def test_a_history_whose_part_variables_have_no_code_has_those_of_the_model() -> None:
    file = "OpenRadioss__miniqa-OPTIONS-damp-new_test_v11-reference-FFO25SCBT01"
    history = read_history([real(f"more-histories/{file}")])
    assert history.time.size == 11
    assert (history.energy[0], history.energy[-1]) == pytest.approx((0.0, 0.001894467), rel=1e-6)
    assert any("no variables of parts 1, 2" in note for note in history.notes)
