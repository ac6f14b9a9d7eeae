"""Files written by real solvers: what is read from each, or why it is refused.

What is expected of each stands in ``readable.csv``: the first state, the one in the middle (n // 2, from 0) and the
last, read by others:

* glstat by awk: last field of the lines whose columns 2-32 are ``time`` or ``internal energy`` and dots, of the states
  that have both; matsum by awk: columns 8-20 of the time lines, columns 32-44 of the ``mat.#=`` lines added;
* CSV by awk: fields 1 and 2 between commas, below one header line, with LS-PrePost two; Curveplot: lines of the file;
* T01: what the solver's own converter th_to_csv prints in the CSV file beside it, seven digits;
* binout: lasso-python 2.0.4; HDF5: h5py alone.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from d2rpick.base.errors import FormatError
from d2rpick.histories.opening import Selection, open_run
from tests.reading import read_history
from tests.real.files import real, rows_of

READABLE = {
    row["file"]: row for row in rows_of("readable")
}  # refused by default, but accepted on request

LISTING = "this is a listing of LS-DYNA"
REFUSED = {
    "lasso-python__sph_models-R12_2_1-d3hsp": LISTING,
    "lasso-python__sph_models-R7_1_2-d3hsp": LISTING,
    "qd-cae-python__test-binout": "no glstat or matsum in it, but swforc; name the binout of the run that contains it",
}

# Tables among the files next to them, and the note on each.
MORE = {
    "FV_crashworthiness__DRI-OLD_LSDYNA-z_many.csv": "'Z-acceleration', whose name is not an internal energy",
    "FV_crashworthiness__F28_validation-plot-data.csv": r":14: time steps back from 12\.011 to 0\.967",
    "FV_crashworthiness__ovalization_study-e=030-AT3_Floor.csv": "whose name is not an internal energy",
    "Masters-Project__Steel_Implicit-Energy_Ratio.head6": "'Energy Ratio', whose name is not an internal energy",
}
PAIRS = {
    "UMAT_2scale_LSDYNA__curve.txt": (
        300,
        (0.0, 4e7),
        (4.2000001606841885e-06, 42607482.295758456),
    ),
    "UMAT_2scale_LSDYNA__stress_x_av.csv": (
        24,
        (0.0, 922.56408691),
        (0.50034189224, 667.45178223),
    ),
}


@pytest.mark.parametrize("file", READABLE)
def test_read(file: str) -> None:
    expected = READABLE[file]
    energy = tuple(expected["asked"].split())
    if energy:
        with pytest.raises(FormatError, match="whose name is not an internal energy"):
            read_history([real(f"histories/{file}")])
    history = read_history([real(f"histories/{file}")], Selection(energy=energy))
    assert (history.channel, str(history.time.size)) == (
        expected["channel"],
        expected["states"],
    )
    digits = {"radioss-th": 1e-6, "matsum": 1e-15}.get(
        history.format, 0.0
    )  # the sums depend on the order of their terms
    for position, state in (
        ("first", 0),
        ("middle", history.time.size // 2),
        ("last", -1),
    ):
        written = (
            float(expected[f"{position}_time"]),
            float(expected[f"{position}_energy"]),
        )
        assert (history.time[state], history.energy[state]) == pytest.approx(
            written, rel=digits, abs=0.0
        )
    assert history.complete is not file.endswith(".head16000")
    notes = expected["notes"].split("; ") if expected["notes"] else []
    # Some files are restart segments of a run whose later segments lie beside them.
    of_file = [note for note in history.notes if "in the same folder" not in note]
    assert len(of_file) == len(notes)
    assert all(phrase in note for note, phrase in zip(of_file, notes, strict=True))


@pytest.mark.parametrize("file", REFUSED)
def test_refused(file: str) -> None:
    with pytest.raises(FormatError, match=REFUSED[file]):
        read_history([real(f"histories/{file}")])


def test_no_file_is_left_out() -> None:
    assert {file.name for file in Path(real("histories")).iterdir()} == {
        *READABLE,
        *REFUSED,
    }


def test_a_time_history_as_text_is_read() -> None:
    """One state, whose second line of numbers begins with the mass, as the file shows."""
    file = real("more-histories/luchete80__radioss_tutorials-test-testT01.ascii")
    history = read_history([file])
    assert (history.format, history.channel, history.time.tolist()) == (
        "radioss-th",
        "internal_energy",
        [0.0],
    )
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
    assert list(
        zip(history.time[:2].tolist(), history.energy[:2].tolist(), strict=True)
    ) == [first, second]
    assert not history.notes
    assert history.complete


def test_a_history_whose_part_variables_have_no_code_has_those_of_the_model() -> None:
    file = "OpenRadioss__miniqa-OPTIONS-damp-new_test_v11-reference-FFO25SCBT01"
    history = read_history([real(f"more-histories/{file}")])
    assert history.time.size == 11
    assert (history.energy[0], history.energy[-1]) == pytest.approx(
        (0.0, 0.001894467), rel=1e-6
    )
    assert any("no variables of parts 1, 2" in note for note in history.notes)
