"""Curves one after the other, as LS-PrePost, T/HIS and DYNAFORM export them, and texts that are refused."""

import contextlib

import pytest
from hypothesis import given, strategies as st

from d2rpick.base.errors import FormatError
from d2rpick.histories.formats import csv_table
from d2rpick.histories.history import History, Precision
from d2rpick.histories.opening import Selection
from tests.reading import list_states, open_contents, read_contents

CURVEPLOT = """\
Curveplot
Deck title
Time (ms)
Internal Energy
Component
A12 #pts=3
* Minval=     1.0000000000e+00 at time=         0.0000000000
* Maxval=     4.0000000000e+00 at time=         2.5000000000
    0.0000000000e+00    1.0000000000e+00
    1.0000000000e+00   -3.2500000000e+00
    2.5000000000e+00    4.0000000000e+00
endcurve
Kinetic Energy #pts=2
* Minval=     5.0000000000e+00 at time=         0.0000000000
    0.0000000000e+00    5.0000000000e+00
    0.5000000000e+00    6.0000000000e+00
endcurve
"""
T_HIS = """\
$ exported by hand
Run 7
Time
Internal Energy
box
0.0 1.0
1.0 -3.25
2.5 4.0
CONTINUE
Run 7
Time
Kinetic Energy
step
0.0 5.0
0.5 6.0
"""
DYNAFORM = "2\n1 'Internal Energy'\n0.0, 1.0\n1.0, -3.25\n2.5, 4.0\n2 'Kinetic Energy'\n0.0, 5.0\n0.5, 6.0\n"
TEXTS = {"Curveplot": CURVEPLOT, "T/HIS": T_HIS, "DYNAFORM": DYNAFORM}
FIRST, SECOND = [(0.0, 1.0), (1.0, -3.25), (2.5, 4.0)], [(0.0, 5.0), (0.5, 6.0)]
CHANNELS = {
    "Curveplot": ("A12: Internal Energy", "Kinetic Energy: Internal Energy"),
    "T/HIS": ("box: Internal Energy", "step: Kinetic Energy"),
    "DYNAFORM": ("Internal Energy", "Kinetic Energy"),
}

COUNTED = "3\n0.0, 1.5\n 0.25 2.75\n0.625, -3.125\n"
PAIRS = [(0.0, 1.5), (0.25, 2.75), (0.625, -3.125)]
OASYS = """\
$ written by a postprocessor
Drop of a case
Time <TIME/0.001>;
Internal energy <ENERGY>;
Whole model
0.0, 1.0
1.0, -3.25
2.5, 4.0
continue
Drop of a case
Time <TIME/0.001>;
Kinetic energy <ENERGY/1.0>;
Whole model
0.0 5.0
1.0 6.0
2.5 7.0
"""


def read_curves(text: str, *energy: str, time: str | None = None) -> History:
    return read_contents(
        csv_table, text, selection=Selection(time, energy), name="curves"
    )


@pytest.mark.parametrize("form", TEXTS)
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_each_curve_has_its_own_times(form: str, end: str) -> None:
    text = TEXTS[form].replace("\n", end)
    first, second = CHANNELS[form]
    assert open_contents(csv_table, text, selection=Selection(energy=("2",))).databases[
        0
    ].channels == (first, second)
    history = read_curves(text, "1")
    assert (history.channel, list_states(history), history.complete) == (
        first,
        FIRST,
        True,
    )
    assert (
        list_states(read_curves(text, second.upper()))
        == list_states(read_curves(text, "2"))
        == SECOND
    )
    with pytest.raises(
        FormatError, match="differ from those of the first requested curve"
    ):
        read_curves(text, "1", "2")


@pytest.mark.parametrize("form", ["T/HIS", "DYNAFORM"])
def test_the_internal_energy_is_taken_by_default(form: str) -> None:
    assert list_states(read_curves(TEXTS[form])) == FIRST


@pytest.mark.parametrize("form", TEXTS)
def test_a_single_curve_needs_no_name(form: str) -> None:
    ends = {
        "Curveplot": "Kinetic Energy #pts",
        "T/HIS": "CONTINUE",
        "DYNAFORM": "2 'Kin",
    }
    history = read_curves(
        TEXTS[form].partition(ends[form])[0].replace("Internal Energy", "Heat")
    )
    assert list_states(history) == FIRST


def test_what_the_labels_say() -> None:
    history = read_curves(CURVEPLOT, "1")
    assert history.time_unit == "ms"
    assert (history.time_precision, history.energy_precision) == (
        Precision(digits=11),
        Precision(digits=11),
    )
    assert (
        "'Displacement'; it was used as the time"
        in read_curves(CURVEPLOT.replace("Time (ms)", "Displacement"), "1").notes[0]
    )
    assert "not an internal energy by its name" in read_curves(CURVEPLOT, "2").notes[0]


def test_a_curve_has_its_own_times_and_no_others() -> None:
    assert list_states(read_curves(CURVEPLOT, "1", time="Time")) == FIRST
    with pytest.raises(
        FormatError, match="each curve has its own times; leave `time` '2' out"
    ):
        read_curves(CURVEPLOT, "1", time="2")


@pytest.mark.parametrize("form", TEXTS)
def test_a_text_cut_anywhere_never_yields_a_wrong_number(form: str) -> None:
    counts = set()
    for cut in range(len(TEXTS[form])):
        text = TEXTS[form][:cut]
        for number, true in (("1", FIRST), ("2", SECOND)):
            with contextlib.suppress(FormatError):
                history = read_curves(text, number)
                states_read = list_states(history)
                assert states_read == true[: len(states_read)]
                counts.add((number, len(states_read)))
                assert history.complete or history.notes
    assert counts >= {("1", 1), ("1", 2), ("1", 3), ("2", 1)}


@given(
    st.text(alphabet="01.,eE+- \n'$CONTIUE#pts=curve", max_size=120),
    st.sampled_from([*TEXTS]),
)
def test_no_text_raises_anything_else(text: str, form: str) -> None:
    with contextlib.suppress(FormatError):
        read_curves(TEXTS[form][:90] + text + TEXTS[form][90:])


def test_pairs_below_their_count_are_a_curve() -> None:
    history = read_curves(COUNTED)
    assert (list_states(history), history.channel, history.complete) == (
        PAIRS,
        "curve 1",
        True,
    )
    assert list_states(read_curves(COUNTED + COUNTED.replace("1.5", "7"), "2"))[0] == (
        0.0,
        7.0,
    )
    history = read_curves(COUNTED.replace("3\n", "4\n"))
    assert (list_states(history), history.complete) == (PAIRS, False)
    assert history.notes == ("the file ends within the curve 1",)


@pytest.mark.parametrize(
    ("text", "energy", "reason"),
    [
        (
            CURVEPLOT.replace("Kinetic Energy #", "B13 #"),
            [],
            "2 curves are named like an internal energy.*1 'A12: Internal Energy', 2 'B13: Internal Energy'",
        ),
        (
            CURVEPLOT.replace("Kinetic Energy #", "Velocity #").replace(
                "Internal Energy", "Displacement"
            ),
            [],
            "none of the curves is an energy by its name: 1 '",
        ),
        (CURVEPLOT, ["3"], "no '3'; there are: A12"),
        (CURVEPLOT, ["A21: Internal Energy"], "did you mean 'A12: Internal Energy'"),
        (
            CURVEPLOT.replace("pts=3", "pts=4"),
            ["1"],
            "curves:12: 3 pairs, but 4 were expected in the curve 'A12'",
        ),
        (
            CURVEPLOT.replace("-3.2500000000e+00", ""),
            ["1"],
            "curves:10: '1.0000000000e.00', but a pair of numbers was expected",
        ),
        (
            CURVEPLOT.replace("-3.2500000000e+00", "NaN"),
            ["1"],
            "curves:10: 'NaN' of 'A12: Internal Energy'",
        ),
        (
            T_HIS.replace("1.0 -3.25", "1.0 -3.25 7"),
            ["1"],
            "curves:7: '1.0 -3.25 7', but a pair of numbers",
        ),
        (
            DYNAFORM.replace("1.0, -3.25", "1.0; -3.25"),
            ["1"],
            "curves:4: '1.0;' of 'Internal Energy'",
        ),
        (
            COUNTED.replace("3\n", "2\n"),
            [],
            "curves:4: 3 pairs, but 2 were expected in the curve 1",
        ),
        ("5\n0 1\n1 2\n2\n0 1\n1 2\n", [], "curves:4: 2 pairs, but 5 were expected"),
        ("1" * 5000 + "\n0 1\n1 2\n", [], "curves:1: a count of 5000 digits"),
        ("1" * 5000 + "\n1 'IE'\n0 1\n1 2\n", [], "curves:1: a count of 5000 digits"),
        (
            "Curveplot\nt\nTime\nIE\nA #pts=" + "1" * 5000 + "\n0 1\n",
            [],
            "curves:5: a count of 5000 digits",
        ),
        (
            "3\n0 1\n1e999 2\n1e999 3\n",
            [],
            "curves:3: '1e999' of 'curve 1', but a number was expected",
        ),
        (
            "Curveplot\nt\nTime\nEnergy Ratio\nC\nEnergy Ratio #pts=2\n0 1\n1 1\nendcurve\n",
            [],
            "'Energy Ratio', whose name",
        ),
        (
            "4\n0 1\n1 2\n0 3\n1 4\n",
            [],
            "curves:4, 'curve 1': time steps back from 1 to 0",
        ),
    ],
)
def test_refused(text: str, energy: list[str], reason: str) -> None:
    with pytest.raises(FormatError, match=reason):
        read_curves(text, *energy)


@pytest.mark.parametrize("title", ["Drop of a case\n", "\n"])
def test_labels_of_the_oasys_programs_have_types_and_factors(title: str) -> None:
    history = read_curves(OASYS.replace("Drop of a case\n", title))
    assert (history.channel, history.time_unit) == (
        "Whole model: Internal energy",
        "ms",
    )
    assert list_states(history) == FIRST
    assert history.balance is not None
    assert history.balance.kinetic is not None
    assert history.balance.kinetic.tolist() == [5.0, 6.0, 7.0]


def test_a_type_without_factor_says_no_unit() -> None:
    assert read_curves(OASYS.replace("/0.001", "")).time_unit == ""
