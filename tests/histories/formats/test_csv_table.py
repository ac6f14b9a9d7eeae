"""Tables of text: small texts in, expected numbers out; every cut gives an error or a true prefix."""

import contextlib
from pathlib import Path

import pytest
from hypothesis import example, given, strategies as st

from d2rpick.base.errors import FormatError
from d2rpick.histories.content import OnDisk
from d2rpick.histories.formats import csv_table
from d2rpick.histories.formats.text import Text
from d2rpick.histories.history import EXACT, History, Precision
from d2rpick.histories.opening import Selection
from d2rpick.histories.source import Source
from tests.reading import list_states, open_on_disk, read_contents

TIMES = [0.0, 0.25, 0.625]
ENERGIES = [1.5, 2.75, -3.125]

FOUR = "time_s,boxIE_J,stepIE_J,KE\n0,1,10,5\n1,2,20,6\n2,4,40,7\n"
SIDE_BY_SIDE = (
    "Time,IE,Time,KE,Time,HE\n0,1,0,5,0,7\n1,3,0.5,6,1,8\n2,4,,,2,9\n3,6,,,3,10\n"
)
ROWS = [
    "{},1.5",
    "{},-2",
    "{},2,",
    "1,7",
    "0,3",
    "{},nan",
    "{},1,2",
    "{};3",
    "{},x",
    " {} , 1.5",
    '{},"1.5"',
    "{}",
]
# Comma and point as in the file, whatever their meaning in the table.
CELLS = [
    "1_0",
    "0x10",
    "1e999",
    "1.5d0",
    "1~5",
    "1!5",
    "+.5",
    "5.",
    "1e",
    "1 2",
    "-inf",
    "#",
]
HARD = st.floats(allow_nan=False, allow_infinity=False).map(repr) | st.from_regex(
    r"-?[0-9]{1,25}(\.[0-9]{0,25})?([eE][+-]?[0-9]{1,2})?",
    fullmatch=True,
    alphabet=st.characters(codec="ascii"),
)
FORMS = [
    (",", "."),
    (";", "."),
    (";", ","),
    ("|", "."),
    ("\t", "."),
    ("\t", ","),
    ("  ", "."),
    (" , ", "."),
]


def read_table(text: str | bytes, *energy: str, time: str | None = None) -> History:
    data = text if isinstance(text, bytes) else text.encode()
    return read_contents(
        csv_table, data, selection=Selection(time, energy), name="table"
    )


def write_rows(
    separator: str = ",", decimal: str = ".", end: str = "\n", tail: str = ""
) -> str:
    rows = [
        f"{t}{separator}{e}".replace(".", decimal) + tail + end
        for t, e in zip(TIMES, ENERGIES, strict=True)
    ]
    return "".join(rows)


# name: (text, channel, unit of the time); all hold TIMES and ENERGIES
SCENARIOS: dict[str, tuple[str | bytes, str, str]] = {
    "plain": ("time,internal_energy\n" + write_rows(), "internal_energy", ""),
    "blank behind the comma": ("x, y\n" + write_rows(", "), "y", ""),
    "semicolons": ("Time;IE\n" + write_rows(";"), "IE", ""),
    "semicolons and decimal commas": (
        "Zeit;Innere Energie\n" + write_rows(";", ","),
        "Innere Energie",
        "",
    ),
    "tabs and decimal commas": ("t\tE_int\n" + write_rows("\t", ","), "E_int", ""),
    "bars": ("time|IE\n" + write_rows("|"), "IE", ""),
    "bars and decimal commas": (
        "Zeit | Innere Energie\n" + write_rows(" | ", ","),
        "Innere Energie",
        "",
    ),
    "blanks": ("time ALLIE\n" + write_rows("   "), "ALLIE", ""),
    "blanks and names with blanks": (
        "Time [ms]   Internal Energy\n" + write_rows("   "),
        "Internal Energy",
        "ms",
    ),
    "blanks and decimal commas": ("time IE\n" + write_rows(" ", ","), "IE", ""),
    "no header": (write_rows(), "column 2", ""),
    "no header, blanks": (write_rows("  "), "column 2", ""),
    "UTF-8 with its mark": (
        b"\xef\xbb\xbf" + ("time,IE\n" + write_rows()).encode(),
        "IE",
        "",
    ),
    "UTF-16 from a spreadsheet": (
        ("time\tIE\r\n" + write_rows("\t", end="\r\n")).encode("utf-16"),
        "IE",
        "",
    ),
    "UTF-16, the other order": (
        b"\xfe\xff" + ("time;IE\n" + write_rows(";")).encode("utf-16-be"),
        "IE",
        "",
    ),
    "latin-1": (
        ("time,Gehäuse IE\n" + write_rows()).encode("latin-1"),
        "Gehäuse IE",
        "",
    ),
    "other line ends": ("time,IE\r\n" + write_rows(end="\r\n"), "IE", ""),
    "old line ends": ("time,IE\r" + write_rows(end="\r"), "IE", ""),
    "separator told": (
        "sep=;\nTime (ms);IE (J)\n" + write_rows(";", ","),
        "IE (J)",
        "ms",
    ),
    "any separator told": ("sep=:\ntime:IE\n" + write_rows(":", ","), "IE", ""),
    "no separator told": ("sep=5\ntime,IE\n" + write_rows(), "IE", ""),
    "units in brackets": (
        "Time [s],Internal Energy [J]\n" + write_rows(),
        "Internal Energy [J]",
        "s",
    ),
    "units behind a slash": ("t/ms,E_int/mJ\n" + write_rows(), "E_int/mJ", "ms"),
    "units behind a line": ("time_s,IE_J\n" + write_rows(), "IE_J", "s"),
    "units in a row": (
        "time,internal energy\nms,J\n" + write_rows(),
        "internal energy",
        "ms",
    ),
    "units in a row, in brackets": (
        "time,internal energy\n[ms],[kN mm]\n" + write_rows(),
        "internal energy",
        "ms",
    ),
    "LS-PrePost, unnamed curve": (
        "Global Data,Internal Energy\nTime,\n" + write_rows(tail=","),
        "Internal Energy",
        "",
    ),
    "LS-PrePost, named curve": (
        "Material Data,Internal Energy\nTime,A12,\n" + write_rows(tail=","),
        "A12: Internal Energy",
        "",
    ),
    "3DEXPERIENCE": (
        "Time(s),Energy(J),ALLIE_Global/ALLIE\n" + write_rows(tail=","),
        "Energy(J): ALLIE_Global/ALLIE",
        "s",
    ),
    "comments": (
        "# a run\n$ more\n% more\n// more\ntime,IE\n" + write_rows() + "# the end\n",
        "IE",
        "",
    ),
    "comments between": (
        "time,IE\n" + write_rows().replace("\n0.625", "\n# switched\n\n0.625"),
        "IE",
        "",
    ),
    "a comment with as many cells": (
        "n,time,IE\n0,0,1.5\n# 5,1,2\n1,.25,2.75\n2,.625,-3.125\n",
        "IE",
        "",
    ),
    "names in a comment": (
        "# run 7\n# time internal_energy\n" + write_rows(" "),
        "internal_energy",
        "",
    ),
    "a comment that is no names": ("# box, drop\n" + write_rows(), "column 2", ""),
    "a title": ("Run seven\n" + write_rows(), "column 2: Run seven", ""),
    "quotes": (
        '"time","part 1, IE"\n' + write_rows().replace("2.75", '"2.75"'),
        "part 1, IE",
        "",
    ),
    "a line end inside a name": ('"time","part\nIE"\n' + write_rows(), "part IE", ""),
    "blank lines at the end": ("time,IE\n" + write_rows() + "\n\n", "IE", ""),
    "no line end, digits told": (
        "time,IE\n0.00,1.500\n0.25,2.750\n0.625,-3.125",
        "IE",
        "",
    ),
    "Fortran's exponents": (
        "time,IE\n0.0D+00,1.5d0\n2.5D-01,.275D1\n625.D-3,-3.125\n",
        "IE",
        "",
    ),
    "decimal commas from the second row on": (
        "time;IE\n0;1,5\n0,25;2,75\n0,625;-3,125\n",
        "IE",
        "",
    ),
    "decimal commas and words between blanks": (
        "time phase IE\n0,0 load 1,5\n0,25 flight 2,75\n0,625 flight -3,125\n",
        "IE",
        "",
    ),
    "signs": ("time,IE\n+0,+1.5\n+.25,2.75e+0\n0.625,-3.125E0\n", "IE", ""),
    "the energy first": ("IE,time\n1.5,0.0\n2.75,0.25\n-3.125,0.625\n", "IE", ""),
    "an index first": (",time,IE\n0,0,1.5\n1,.25,2.75\n2,.625,-3.125\n", "IE", ""),
    "words in an unused column": (
        "time,phase,IE\n0,load,1.5\n.25,flight,2.75\n.625,flight,-3.125\n",
        "IE",
        "",
    ),
    "gaps in an unused column": (
        "time,KE,IE\n0,,1.5\n.25,nan,2.75\n.625,7,-3.125\n",
        "IE",
        "",
    ),
    "gaps in an unused last column": (
        "time,IE,KE\n0,1.5,\n.25,2.75,3\n.625,-3.125,\n",
        "IE",
        "",
    ),
    "more names than values, th_to_csv": (
        '"time","INTERNAL ENERGY","KINETIC ENERGY","X","Y"\n0,1.5,9,8\n.25,2.75,9,8\n.625,-3.125,9,8\n',
        "INTERNAL ENERGY",
        "",
    ),
    "an internal energy among others": (
        "time,boxIE_J,boxKE_J\n0,1.5,9\n.25,2.75,9\n.625,-3.125,9\n",
        "boxIE_J",
        "",
    ),
    "equal times, the last counts": (
        "time,IE\n0,1.5\n.25,9\n.25,2.75\n.625,-3.125\n",
        "IE",
        "",
    ),
    "restart, the newer leg counts": (
        "time,IE\n0,1.5\n.25,9\n.5,9\n.25,2.75\n.625,-3.125\n",
        "IE",
        "",
    ),
}


@pytest.mark.parametrize("name", SCENARIOS)
def test_scenario(name: str) -> None:
    text, channel, unit = SCENARIOS[name]
    history = read_table(text)
    assert history.time.tolist() == TIMES
    assert history.energy.tolist() == ENERGIES
    assert (history.channel, history.time_unit, history.format) == (
        channel,
        unit,
        "csv",
    )
    assert history.complete


@pytest.mark.parametrize(
    ("text", "asked", "channel", "energy"),
    [
        (FOUR, ["boxIE_J"], "boxIE_J", [1, 2, 4]),
        (FOUR, ["boxie"], "boxIE_J", [1, 2, 4]),
        (FOUR, [" BOXIE_J "], "boxIE_J", [1, 2, 4]),
        (FOUR, ["3"], "stepIE_J", [10, 20, 40]),
        (FOUR, ["boxIE_J", "3"], "boxIE_J + stepIE_J", [11, 22, 44]),
        ("time,101,102\n0,1,10\n1,2,20\n", ["101"], "101", [1, 2]),
        ("time,m,M\n0,1,10\n1,2,20\n", ["M"], "M", [10, 20]),
        ("0,1,10\n1,2,20\n", ["3"], "column 3", [10, 20]),
        ("0 1 10\n1 2 20\n", ["2"], "column 2", [1, 2]),
        ("Nodal,IE\nTime,A1,B2,\n0,1,10,\n1,2,20,\n", ["b2"], "B2: IE", [10, 20]),
    ],
)
def test_columns_by_name_and_number(
    text: str, asked: list[str], channel: str, energy: list[float]
) -> None:
    history = read_table(text, *asked)
    assert history.channel == channel
    assert history.energy.tolist() == energy


def test_the_time_by_name_and_number() -> None:
    assert read_table("a,b,IE\n5,0,1\n4,1,2\n", time="b").time.tolist() == [0, 1]
    assert read_table(
        "Time,Y1,Time,Y2\n0,1,5,2\n1,3,6,4\n", "Y2", time="3"
    ).time.tolist() == [5, 6]


def test_curves_side_by_side_have_times_of_their_own() -> None:
    """T/HIS writes curves like this; a shorter curve ends in empty cells."""
    assert list_states(read_table(SIDE_BY_SIDE)) == [(0, 1), (1, 3), (2, 4), (3, 6)]
    assert list_states(read_table(SIDE_BY_SIDE, "KE")) == [(0, 5), (0.5, 6)]
    assert read_table(SIDE_BY_SIDE, "KE").time_precision == Precision(digits=1)
    assert list_states(read_table(SIDE_BY_SIDE, "IE", "HE")) == [
        (0, 8),
        (1, 11),
        (2, 13),
        (3, 16),
    ]
    without_names = SIDE_BY_SIDE.partition("\n")[2]
    assert list_states(read_table(without_names, "4", time="3")) == [(0, 5), (0.5, 6)]


@pytest.mark.parametrize(
    ("text", "asked", "reason"),
    [
        (
            SIDE_BY_SIDE,
            ["IE", "KE"],
            "the times of 'KE' differ from those of the first requested curve",
        ),
        (
            SIDE_BY_SIDE.replace("3,6,,,", "3,6,3,7,"),
            ["KE"],
            "table:5: a curve continues after empty cells",
        ),
        (SIDE_BY_SIDE.replace("3,6,,,", "3,6,,7,"), ["KE"], "table:5: 'Time' is ''"),
        (SIDE_BY_SIDE.replace("3,6,,,", "3,,,,"), ["IE"], "table:5: 'IE' is ''"),
        (
            SIDE_BY_SIDE.replace("IE", "IE_a").replace("KE", "IE_b"),
            [],
            "2 columns are named like an internal energy",
        ),
        (
            FOUR,
            [],
            "2 columns are named like an internal energy.*`energy`: 2 'boxIE_J', 3 'stepIE_J'",
        ),
        (
            "time,a,b\n0,1,2\n1,2,3\n",
            [],
            "no column is named like an internal energy.*2 'a', 3 'b'",
        ),
        (
            "time_s,reference_m,vz\n0,1,2\n1,2,3\n",
            [],
            "none of the columns is an energy by its name or unit: 2 'reference_m', 3 'vz'",
        ),
        (
            "time,a,b\ns,mm,mm\n0,1,2\n1,2,3\n",
            [],
            "none of the columns is an energy by its name or unit: 2 'a mm', 3 'b mm'",
        ),
        (
            "time,a,u_x_m\n0,1,2\n1,2,3\n",
            [],
            "choose with `energy`: 2 'a'$",
        ),
        ("0,1,2\n1,2,3\n", [], "2 'column 2', 3 'column 3'"),
        (
            FOUR,
            ["boxIEJ2"],
            r"no column 'boxIEJ2' \(did you mean 'boxIE_J'\?\); there are: 1 'time_s', 2",
        ),
        (FOUR, ["5"], "no column '5'"),
        (FOUR, ["0"], "no column '0'"),
        (FOUR, ["KE", "ke"], "given twice"),
        (FOUR, ["1"], "'1' is the time column; choose"),
        (SIDE_BY_SIDE, ["IE", "3"], "'3' is a time column; choose"),
        (
            "time,IE,ie\n0,1,2\n1,2,3\n",
            ["Ie"],
            "'Ie' may be any of these columns: 2 'IE', 3 'ie'",
        ),
        ("time,IE,IE\n0,1,2\n1,2,3\n", [], "2 columns are named"),
        ("time,3,2\n0,1,2\n1,2,3\n", ["2"], "may be any of these"),
        (
            "Time,Y1,Y2,Time\n0,1,5,2\n1,3,6,4\n",
            ["Y1"],
            "choose with `time`: 1 'Time', 4 'Time'",
        ),
        (
            '"time","INTERNAL ENERGY",A,B\n0,1,2\n1,2,3\n',
            ["A"],
            "4 names for 3 values .th_to_csv.*2 'INTERNAL ENERGY'",
        ),
        (
            '"time","INTERNAL ENERGY",A,B\n0,1,2\n1,2,3\n',
            ["3"],
            "only these may be used",
        ),
        (
            '"time",A,"INTERNAL ENERGY",B\n0,1,2\n1,2,3\n',
            [],
            "no column is named like an internal energy",
        ),
        ("index,time,IE,KE\n0,1,2\n1,2,3\n", [], "3 values below a header of 4 names"),
        ("time,IE\n0,5,1\n1,2,3\n", [], "3 values below a header of 2 names"),
        ("time,IE\n0,05,1,25\n1,05,2,35\n", [], "decimal commas between commas"),
        (
            "0,00,1,25\n0,05,1,35\n",
            ["2"],
            "table:1: '0,00,1,25' looks like decimal commas",
        ),
    ],
)
def test_columns_that_cannot_be_told(text: str, asked: list[str], reason: str) -> None:
    with pytest.raises(FormatError, match=reason):
        read_table(text, *asked)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (
            "time,IE\n0,1\n1,nan\n2,3\n",
            "table:3: 'IE' is 'nan', but a number was expected",
        ),
        ("time,IE,KE\n0,1,2\n1,,2\n2,3,4\n", "table:3: 'IE' is ''"),
        ("time,IE\n0,1\n1,1e999\n2,3\n", "table:3: 'IE' is '1e999'"),
        ("time,IE\n0,1\n1,1_0\n2,3\n", "table:3: 'IE' is '1_0'"),
        ("time,IE\n0,1\n\n1,*****\n2,3\n", r"table:4: 'IE' is '\*\*\*\*\*'"),
        ("time,IE\n0,1\n1\n2,3\n", "table:3: 1 value, but 2 were expected"),
        ("time,IE\n0,1\n1,2,3\n2,3\n", "table:3: 3 values, but 2 were expected"),
        ("time,IE\n0,1\nend\n1,2\n", "table:3: 1 value,"),
        ("time,IE\n0\n1,2\n2,3\n", "table:2: '0' differs from the rows below"),
        ("time,IE\n0,-\n1,2\n2,3\n", "table:2: 'IE' is '-', but a number was expected"),
        (
            "time;IE\n0,5;1.5\n0,6;1,5\n",
            "table:2: 'IE' is '1.5'|table:2: '0,5;1.5' differs",
        ),
        (
            "time,IE\n0,1\n1,2\n\n0,3\n1,4\n",
            "table:5: the time starts again after a gap",
        ),
        ("time,IE\n5,1\n3,2\n4,3\n1,4\n2,5\n", "table:3: time steps back from 5 to 3"),
        (
            "time,IE\n0,1\n1,2\n2,3\n\n# two\n0.5,4\n",
            "table:7: the time starts again after a gap",
        ),
        (
            "time,IE\n0,1\n1,2\n2,3\n0,4\n1,5\n2,6\n",
            "table:5: time steps back from 2 to 0",
        ),
        (
            "time,IE\n0,1\n1,2\n2,3\n1.5,4\n1.6,5\n1.7,6\n",
            "table:5: time steps back from 2 to 1.5",
        ),
        (
            "# run\ntime,IE\n0,1\n1,2\n\n2,3\n0.5,4\n1.5,5\n1,6\n",
            "table:7: time steps back from 2 to 0.5",
        ),
        (
            "time,IE\n0,1\n1,2\ntime,IE\n0,3\n1,4\n",
            "table:4: a second header, another curve begins here",
        ),
        (
            "time,ALLKE\n0,1\n1,2\n",
            r"'ALLKE', whose name is not an internal energy \(ALLKE\); write the internal energy too",
        ),
        (
            "Nodal History,Z-acceleration\nTime,A8,\n0,1,\n1,2,\n",
            "'A8: Z-acceleration', whose name",
        ),
        ("run,IE\na1,1\na2,2\n", "no rows of at least two numbers"),
        ("| a title |\n| a line |\n" * 9, "no rows of at least two numbers"),
        (
            "run,IE,KE\na1,1,2\na2,2,3\n",
            "no column has the name of a time; choose with `time`",
        ),
        ("time,IE\n", "table:1: 'time,IE' was found, and no rows"),
        ("time,IE\n0.0,1.5", "no states"),
    ],
)
def test_refused(text: str, reason: str) -> None:
    with pytest.raises(FormatError, match=reason):
        read_table(text)


@pytest.mark.parametrize(
    ("text", "asked", "note"),
    [
        (
            "x,y\n0,1\n1,2\n",
            [],
            "no column has the name of a time; 'x', the first, was used as the time",
        ),
        ("time,IE\n0,5\n0,1\n1,2\n", [], "same printed time"),
        ("time,IE\n0,1\n1,2\n2,3", [], "the last line has no line end and may be cut"),
        (
            "time,ALLKE\n0,1\n1,2\n",
            ["ALLKE"],
            "'ALLKE' is not an internal energy by its name",
        ),
    ],
)
def test_notes_say_what_was_assumed(text: str, asked: list[str], note: str) -> None:
    history = read_table(text, *asked)
    assert history.energy.tolist() == [1, 2]
    assert note in history.notes[0]


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("tables") / "table"


CELLS += ["\xa01.5", "1.5\x85", "\xb2"]  # blanks and a digit beyond ASCII
LINES = [
    *ROWS,
    *(f"{{}},{cell}" for cell in CELLS),
    "# comment",
    "# {},1",
    "",
    "  ",
    ",",
    "time,IE",
]


def in_pieces(data: bytes | OnDisk, size: int) -> object:
    """Return the states of a table read in pieces of this size, or its error."""
    try:
        sized = type("Sized", (Text,), {"piece": size, "large": size})
        table = csv_table.Table(sized(Source("table", data)), Selection())
        return table.time.tolist(), table.channel(table.energy_channel).tolist()
    except FormatError as error:
        return str(error)


@given(
    st.lists(st.sampled_from(LINES), max_size=8),
    st.sampled_from(
        [
            (",", "."),
            (";", "."),
            ("|", ","),
            ("\t", "."),
            ("\t", ","),
            (" ", "."),
            (" ", ","),
        ]
    ),
    st.sampled_from(["", ",7", ",", ",x"]),
    st.sampled_from(["utf-8", "latin-1", "utf-16"]),
)
@example(["{},1!5"], (";", ","), "", "utf-8")
@example(["", "0,3"], (",", "."), "", "utf-8")
@example(["", "0,3"], (" ", "."), "", "utf-8")
@example([" 2e-1\x0c,1", "{},1e+"], (",", "."), "", "utf-8")
def test_rows_read_piece_by_piece_or_from_the_disk_are_those_read_line_by_line(
    file: Path, lines: list[str], form: tuple[str, str], tail: str, encoding: str
) -> None:
    good = [
        "{0},{0}.5"
    ] * 3  # on both sides, because times that step back would hide the error of a cell
    numbered = [
        line.format(number) for number, line in enumerate([*good, *lines, *good])
    ]
    head = "time,IE" + ",other" * (tail not in ("", ","))
    content = "\n".join(
        [head, *(f"{line}{tail}" if line else line for line in numbered), ""]
    )
    data = content.translate(
        str.maketrans(dict(zip(",.~!", (*form, *",."), strict=True)))
    ).encode(encoding)
    one_by_one = data + '# "\n'.encode(encoding).removeprefix(
        b"\xff\xfe"
    )  # a quoted cell may contain a separator
    tables = [
        in_pieces(*arguments)
        for arguments in ((data, 8), (data, 1 << 17), (one_by_one, 1 << 17))
    ]
    assert tables[0] == tables[1] == tables[2]
    file.write_bytes(data)
    assert [in_pieces(open_on_disk(file), size) for size in (8, 1 << 17)] == tables[:2]


@given(st.lists(HARD, min_size=1, max_size=40))
def test_numbers_from_the_disk_are_those_of_python(
    file: Path, texts: list[str]
) -> None:
    file.write_text(
        "time,IE\n"
        + "".join(f"{number}.5,{text}\n" for number, text in enumerate(texts))
    )
    table = csv_table.Table(Text(Source("table", open_on_disk(file))), Selection())
    assert table.channel("IE").tolist() == [float(text) for text in texts]


def test_words_without_numbers_are_refused_by_the_first_lines() -> None:
    with pytest.raises(
        FormatError,
        match="'no table at all' was found, and no rows of at least two numbers in the first",
    ):
        read_table("no table at all\n" * 20_000)


@pytest.mark.parametrize(
    "text",
    [
        "1" * 30_000 + "\n1,2\n",
        "time,IE\n0,1\n1," + "1" * 30_000 + "x\n",
        "1" * 5000 + "\n0 1\n1 2\n",
        ",".join(map(str, range(5000))) + "\n",
    ],
)
def test_endless_digits_and_endless_rows_take_no_endless_time(text: str) -> None:
    with pytest.raises(FormatError) as error:
        read_table(text)
    assert len(str(error.value)) < 600


def test_thousands_of_columns_are_read() -> None:
    columns = 5000
    rows = [",".join([str(i), *(str(i + c) for c in range(columns))]) for i in range(3)]
    head = ",".join(["time", "IE", *(f"c{c}" for c in range(columns - 1))])
    assert read_table("\n".join([head, *rows, ""])).energy.tolist() == [0, 1, 2]


@pytest.mark.parametrize("energy", [1e150, 1e-307, -1e150])
def test_extreme_energies_are_read_without_a_warning(energy: float) -> None:
    text = "".join(f"{i / 10},{energy * (1 + i % 3 / 10)!r}\n" for i in range(20))
    assert read_table("time,IE\n" + text).energy[0] == energy


@pytest.mark.parametrize(
    ("rows", "time", "energy"),
    [
        (
            "0.001,1.25\n0.0025,1.5\n0.0041,2\n",
            Precision(digits=3),
            Precision(digits=3),
        ),
        (
            "0,1.00000e+00\n1.03,1.25000e+00\n3,1.5\n",
            Precision(digits=6),
            Precision(digits=6),
        ),
        (
            "0.00,1.234567\n0.13,1.5\n0.25,1\n",
            Precision(digits=7, decimals=2),
            Precision(digits=7),
        ),
        ("0.00,1.234567\n0.10,1.5\n0.20,1\n", Precision(digits=7), Precision(digits=7)),
        (
            "0,1.250\n0.13,12.125\n0.2,1.000\n",
            Precision(digits=5),
            Precision(digits=5, decimals=3),
        ),
        # Zeros within a number are digits like any other, but leading zeros are not significant.
        (
            "0.00,0.00100\n0.07,10.02030\n0.12,0.00004\n",
            Precision(digits=7, decimals=2),
            Precision(digits=7, decimals=5),
        ),
        ("0,0.333333333333333315\n0.13,12.125\n0.2,1.000\n", EXACT, EXACT),
    ],
)
def test_precision_is_read_off_the_text(
    rows: str, time: Precision, energy: Precision
) -> None:
    history = read_table(rows)
    assert (history.time_precision, history.energy_precision) == (time, energy)


finite = st.floats(
    -1e149, 1e149, allow_subnormal=False
)  # a history may not contain energies above 1e150


@given(
    st.lists(st.tuples(finite, finite), min_size=1, max_size=8),
    st.sampled_from(FORMS),
    st.sampled_from(["%r", "%.17g", "%.16e", "%.3f", "%+.5E", "%g"]),
    st.sampled_from(["\n", "\r\n"]),
    st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "latin-1"]),
)
def test_what_is_written_is_read_back_bit_for_bit(
    values: list[tuple[float, float]],
    form: tuple[str, str],
    style: str,
    end: str,
    encoding: str,
) -> None:
    separator, decimal = form
    rows = [(float(i), style % a, style % b) for i, (a, b) in enumerate(values)]
    lines = [separator.join(["time", "A", "B"])]
    lines += [separator.join([repr(t), a, b]).replace(".", decimal) for t, a, b in rows]
    history = read_table((end.join(lines) + end).encode(encoding), "B")
    assert history.time.tolist() == [t for t, _, _ in rows]
    assert history.energy.tolist() == [float(b) for _, _, b in rows]


@pytest.mark.slow
@given(
    st.lists(st.floats(-1e20, 1e20), min_size=1, max_size=4),
    st.sampled_from(["%r", "%.17g", "%.5e", "%.3f", "%g", "%d"]),
    st.sampled_from(["time,IE\n", "", "a,b\nTime,IE,\n", "time,IE,more\n"]),
    st.sampled_from(["", ",", ",7"]),
)
def test_a_table_cut_anywhere_never_yields_a_wrong_number(
    energies: list[float], style: str, header: str, tail: str
) -> None:
    rows = [(float(i), style % energy) for i, energy in enumerate(energies)]
    whole = header + "".join(f"{t},{energy}{tail}\n" for t, energy in rows)
    expected = [(t, float(energy)) for t, energy in rows]
    for cut in range(len(whole)):
        try:
            history = read_table(whole[:cut])
        except FormatError:
            continue
        states_read = list(
            zip(history.time.tolist(), history.energy.tolist(), strict=True)
        )
        assert states_read == expected[: len(states_read)]


@pytest.mark.parametrize(
    ("head", "row"),
    [
        ("", "0.5,12.25"),
        ("time,IE\n", "0.5,12.25"),
        ("IE,time\n", "12.25,0.5"),
        ("time,IE,KE\n", "0.5,12.25,3.5"),
        ("time,KE,IE\n", "0.5,3.5,12.25"),
        ("Zeit;Innere Energie\n", "0,5;12,25"),
        ("time IE\n", " 0.5 12.25"),
    ],
)
def test_a_table_cut_inside_its_first_row_has_that_row_or_none(
    head: str, row: str
) -> None:
    for cut in range(len(row) + 1):
        with contextlib.suppress(FormatError):
            history = read_table(head + row[:cut])
            assert (history.time.tolist(), history.energy.tolist()) in (
                ([0.5], [12.25]),
                ([], []),
            )
            assert history.complete or (
                history.time.size == 0 and any("cut" in note for note in history.notes)
            )
    assert read_table(f"{head}{row}\n").energy.tolist() == [12.25]


@pytest.mark.parametrize(
    ("rows", "states"),
    [
        ("0,1.00\n1,2.50\n2,3.75", 3),  # always two decimals, so the number is whole
        ("0,1.00\n1,2.50\n2,3.7", 2),
        ("0,1.25\n1,2.75\n2,3.75", 2),  # the format may be %g, and the value 3.751
        ("0,1.00e+00\n1,2.50e+00\n2,3.75e-01", 3),
        ("0,1.00e+00\n1,2.50e+00\n2,3.75e-1", 2),
        ("0,1.00e+00\n1,2.50e+00\n2,3.75e-10", 2),  # may be cut from e-100
        ("0,1\n1,2\n2,3", 2),
        ("0,1,\n1,2,\n2,3,", 3),
        ("time,IE,KE\n0,1,9\n1,2,9\n2,3,", 3),
        ("time,IE,KE\n0,1,9\n1,2,9\n2,3", 2),
    ],
)
def test_a_last_line_without_end_counts_when_it_is_whole_for_sure(
    rows: str, states: int
) -> None:
    history = read_table(rows)
    assert history.time.size == states
    assert history.complete is (states == 3)


@given(st.text(alphabet='01.,;eE+- \t\n"#ntimeI', max_size=120))
@example(";;")
@example("\t0\n")  # nothing in the only column that is read
def test_no_text_raises_anything_else(text: str) -> None:
    with contextlib.suppress(FormatError):
        read_table(text)
