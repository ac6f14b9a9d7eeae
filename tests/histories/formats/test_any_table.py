"""Tables as users, spreadsheets and postprocessors write them, compared with pandas with the right options."""

import io
from collections.abc import Iterator, Sequence

import numpy as np
import pytest

from d2rpick.base.errors import FormatError
from d2rpick.histories.formats import csv_table
from d2rpick.histories.history import History, Samples
from d2rpick.histories.opening import Selection
from tests.reading import read_contents

STATES = 40
TIME = np.arange(STATES) * 0.25
ENERGY = np.round(
    1200 * (1 - np.cos(TIME)) + 0.5, 3
)  # values up to 2400, so that there are thousands separators
KINETIC = np.round(5000 - ENERGY, 3)

EXTREMES = "\n         Minimum     0.5     2600.\n            At X     0.      3.1\n         Maximum  2400.  5000.\n\n"
RULE = "+------+------+"
GLOBALS = (
    "time",
    *(
        "INTERNAL ENERGY",
        "KINETIC ENERGY",
        "X-MOMENTUM",
        "Y-MOMENTUM",
        "Z-MOMENTUM",
        "MASS",
        "TIME STEP",
    ),
    *(
        "ROTATION ENERGY",
        "EXTERNAL WORK",
        "SPRING ENERGY",
        "CONTACT ENERGY",
        "HOURGLASS ENERGY",
    ),
)
BEHIND = ("PLASTIC WORK", "box IE", "box KE")


def format_number(value: float, decimal: str = ".", thousands: str = "") -> str:
    return (
        f"{value:,.3f}".replace(",", "\0")
        .replace(".", decimal)
        .replace("\0", thousands)
    )


def write_table(
    head: str,
    separator: str = ",",
    decimal: str = ".",
    thousands: str = "",
    *,
    quote: str = "",
    kinetic: bool = True,
) -> str:
    columns = [TIME, ENERGY, KINETIC] if kinetic else [TIME, ENERGY]
    rows = zip(*columns, strict=True)
    lines = [
        separator.join(
            f"{quote}{format_number(v, decimal, thousands)}{quote}" for v in row
        )
        for row in rows
    ]
    return "\n".join([head, *lines, ""])


def lines(head: str, form: str) -> str:
    """Rows in a given form, with t, e, k and the number i of the state."""
    rows = (
        form.format(t=format_number(t), e=format_number(e), k=format_number(k), i=i)
        for i, (t, e, k) in enumerate(zip(TIME, ENERGY, KINETIC, strict=True))
    )
    return "\n".join([head, *rows, ""]) if head else "\n".join([*rows, ""])


REPORT = lines(
    "\n            X               ALLIE           ALLKE     \n",
    "      {t}      {e}      {k}",
)

TABLES: dict[str, str | bytes] = {
    "a column of errors": lines(
        "Time (ms),Internal energy (mJ),ratio", "{t},{e},#DIV/0!"
    ),
    "German errors": lines("Zeit;Innere Energie;Quotient", "{t};{e};#NV").replace(
        ".", ","
    ),
    "not available": lines("time,IE,x", "{t},{e},#N/A"),
    "errors in front": lines("ratio,time,IE", "#DIV/0!,{t},{e}"),
    "an empty column": lines("time,,IE", "{t},,{e}"),
    "empty columns behind": lines("time,IE,,", "{t},{e},,"),
    "dashes": lines("time,IE,note", "{t},{e},-"),
    "too wide": lines("time,IE,x", "{t},{e},########"),
    "overflow": lines("time,IE,x", "{t},{e},*******"),
    "not a number": lines("time,IE,sensor", "{t},{e},NaN"),
    "None": lines("time,IE,sensor", "{t},{e},None"),
    "dates in front": lines("stamp,time,IE", "2026-01-01 10:00:{i:02d},{t},{e}"),
    "clock times": lines("time,IE,clock", "{t},{e},10:00:{i:02d}"),
    "shares": lines("time,IE,share", "{t},{e},{i}%"),
    "truth": lines("time,IE,contact", "{t},{e},True"),
    "remarks in quotes": lines("time,IE,remark", '{t},{e},"a, b"'),
    "quoted decimal commas": write_table(
        "Time (ms),Internal energy (mJ)", ",", ",", quote='"', kinetic=False
    ),
    "three quoted columns": write_table(
        "Time (ms),Internal energy (mJ),KE (mJ)", ",", ",", quote='"'
    ),
    "quoted points": write_table("time,IE,KE", quote='"'),
    "quoted thousands": write_table("time,IE,KE", thousands=",", quote='"'),
    "German thousands": write_table(
        "Zeit;Innere Energie;Kinetische Energie", ";", ",", "."
    ),
    "French thousands": write_table(
        "temps;énergie interne;énergie cinétique", ";", ",", "\N{NARROW NO-BREAK SPACE}"
    ),
    "no-break thousands": write_table(
        "temps;énergie interne;énergie cinétique", ";", ",", "\N{NO-BREAK SPACE}"
    ),
    "blanks for thousands": write_table(
        "Zeit;Innere Energie;Kinetische Energie", ";", ",", " "
    ),
    "Swiss thousands": write_table(
        "Zeit;Innere Energie;Kinetische Energie", ";", ".", "'"
    ),
    "thousands between tabs": write_table("time\tIE\tKE", "\t", ".", ","),
    "two rows of heads": write_table(
        ";Lauf 12;;\n;Innere Energie;Kinetische Energie;\nt in ms;in mJ;in mJ;",
        ";",
        ",",
    ),
    "merged heads": write_table("Time,Energy,\n,internal,kinetic"),
    "levels": write_table("Time,Energy,Energy\n,internal,kinetic"),
    "a level of models": write_table(",Model,Model\ntime,IE,KE"),
    "units below": write_table("time,internal energy,kinetic energy\nms,mJ,mJ"),
    "units above": write_table("ms,mJ,mJ\ntime,internal energy,kinetic energy"),
    "words above": write_table(
        "Report of run 12\nAuthor: me, date: today\n\ntime,IE,KE"
    ),
    "many words above": write_table("some text about the run\n" * 150 + "time,IE,KE"),
    "keys and values above": write_table(
        "Key;value 7\n" * 12 + "Zeit [ms];Innere Energie [mJ]", ";", ",", kinetic=False
    ),
    "numbers of rows": lines(",time,IE", "{i},{t},{e}"),
    "numbers of rows before X": lines(",X,ALLIE", "{i},{t},{e}"),
    "named numbers of rows": lines("index,X,ALLIE", "{i},{t},{e}"),
    "words in front": lines("state,time,IE", "S{i},{t},{e}"),
    "words before X": lines("run,X,ALLIE", "job-1,{t},{e}"),
    "words without a head": lines("", "job,{t},{e}"),
    "a word and blanks": lines("", "step {t} {e}"),
    "a total below": write_table("time,IE,KE") + "Total,123.0,456.0\n",
    "words below": write_table("time,IE,KE")
    + "\nExported by a tool, version 3.2\nEnd\n",
    "a report of Abaqus": REPORT,
    "a report with its extremes": REPORT + EXTREMES,
    "a report twice": (REPORT + EXTREMES) * 2,
    "a report three times": REPORT * 3,
    "names in a comment": write_table("# time IE KE", " "),
    "Markdown": lines("| time | internal energy |\n|------|------|", "| {t} | {e} |"),
    "psql": lines(" time | internal energy \n------+-----------------", " {t} | {e} "),
    "a box": lines(f"{RULE}\n| time | IE |\n{RULE}", "| {t} | {e} |") + f"{RULE}\n",
    "rules of blanks": lines("====== ======\ntime   IE\n====== ======", "{t} {e}")
    + "====== ======\n",
    "fixed width": lines(f"{'time':>10}{'internal energy':>20}", "{t:>10}{e:>20}"),
    "UTF-16": write_table("time\tIE\tKE", "\t").encode("utf-16"),
    "cp1252": write_table(
        "Zeit [ms];Innere Energie Türe [mJ]", ";", ",", kinetic=False
    ).encode("cp1252"),
    "old line ends": write_table("time,IE,KE").replace("\n", "\r"),
    "blank lines between": write_table("time,IE,KE").replace("\n", "\r\n\r\n"),
    "exponents of Fortran": lines("time IE", "{t}D+00 {e}D+00"),
    "plus signs": lines("time,IE", "+{t},+{e}"),
    "a minus of typesetters": lines("time,IE,z", "{t},{e},\N{MINUS SIGN}1.5"),
    "the energy first": lines("internal energy;time", "{e};{t}"),
    "a separator at the end of rows": lines("time;IE", "{t};{e};"),
    "a separator at the end of names": lines("time;IE;", "{t};{e}"),
    "holes in another column": lines("time,IE,KE", "{t},{e},{k}").replace(
        f",{format_number(KINETIC[7])}", ","
    ),
}


def read_table(text: str | bytes, *energy: str) -> History:
    data = text if isinstance(text, bytes) else text.encode()
    return read_contents(
        csv_table, data, selection=Selection(energy=energy), name="table"
    )


@pytest.mark.parametrize("name", TABLES)
def test_it_is_read(name: str) -> None:
    history = read_table(TABLES[name])
    np.testing.assert_allclose(history.time, TIME, atol=1e-9)
    np.testing.assert_allclose(history.energy, ENERGY, atol=1e-9)


def read_notes(text: str) -> str:
    return " ".join(read_table(text).notes)


def test_columns_without_numbers_are_left_out_with_a_note() -> None:
    text = lines("time,IE,ratio,", "{t},{e},#DIV/0!,")
    assert (
        "column 3 'ratio' holds no numbers ('#DIV/0!') and was left out"
        in read_notes(text)
    )
    assert "holds no numbers" not in read_notes(
        lines("time,,IE", "{t},,{e}")
    )  # an empty cell


@pytest.mark.parametrize("hole", ["#NV", "", "n/a", "-"])
def test_a_quantity_with_a_hole_is_left_out_with_its_line(hole: str) -> None:
    text = lines("time,IE,KE", "{t},{e},{k}").replace(format_number(KINETIC[20]), hole)
    history = read_table(text)
    np.testing.assert_array_equal(history.energy, ENERGY)
    assert history.balance is None or history.balance.kinetic is None
    assert f"'KE' was left out: line 22: 'KE' is {hole!r}" in " ".join(history.notes)
    with pytest.raises(FormatError, match="table:22: 'KE' is"):
        read_table(text, "KE")


def test_a_hole_in_the_energy_is_refused_with_its_line() -> None:
    with pytest.raises(
        FormatError, match="table:22: 'IE' is '#NV', but a number was expected"
    ):
        read_table(
            lines("time,IE,KE", "{t},{e},{k}").replace(format_number(ENERGY[20]), "#NV")
        )


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (
            "time;IE\n0,001;1.234\n0,002;1.235\n0,003;1.236\n",
            "1.234",
        ),  # a thousands separator or a decimal sign, which cannot be decided
        ("time;IE\n1.001;12,5\n1.002;12,6\n1.003;12,7\n", "1.001|12,5"),
        (
            "time,IE\n0.0 ms,0.5 mJ\n0.1 ms,0.6 mJ\n",
            "table:2: '0.0 ms,0.5 mJ' was found, and no rows",
        ),
        ("IE,KE\n0.5,1\n0.6,2\n", "no column has the name of a time"),
    ],
)
def test_what_cannot_be_told_for_sure_is_refused(text: str, reason: str) -> None:
    with pytest.raises(FormatError, match=reason):
        read_table(text)


def test_another_table_below_is_refused_with_both_lines() -> None:
    other_report = REPORT.replace(format_number(ENERGY[20]), "7")
    with pytest.raises(
        FormatError,
        match=r"table:72: another table begins here, after line 45 \('Minimum",
    ):
        read_table(REPORT + EXTREMES + "\n" + other_report.lstrip("\n"))


def test_a_damaged_row_is_refused_though_it_begins_with_a_word() -> None:
    text = lines("time,IE,KE", "{t},{e},{k}").replace("\n5.000,", "\nx.000,")
    with pytest.raises(
        FormatError, match=r"table:22: 'time' is 'x\.000', but a number was expected"
    ):
        read_table(text)


def test_what_stands_below_is_named() -> None:
    assert (
        "line 42 ('Total,1.0,2.0') and the lines after it are below the table"
        in read_notes(write_table("time,IE,KE") + "Total,1.0,2.0\n")
    )
    again = " ".join(read_table((REPORT + EXTREMES) * 2).notes)
    assert "the same table is repeated from line 52 on; they were left out" in again


def th_to_csv(names: Sequence[str], columns: int) -> str:
    head = ",".join(f'"{name}"' for name in names)
    rows: Iterator[Samples] = (np.array([t, *range(1, columns)]) + 0.0 for t in TIME)
    return "\n".join(
        [head, *(",".join(f"{value:e}" for value in row) for row in rows), ""]
    )


@pytest.mark.parametrize("columns", [15, 17])
def test_the_globals_of_th_to_csv_are_sure_below_a_name_too_many_or_too_few(
    columns: int,
) -> None:
    history = read_table(th_to_csv([*GLOBALS, *BEHIND], columns))
    assert (history.energy[0], history.channel) == (1.0, "INTERNAL ENERGY")
    assert history.balance is not None
    assert history.balance.kinetic is not None
    assert (
        history.balance.kinetic[0] == 2.0 + 8.0
    )  # kinetic energy with the rotation energy
    assert [momenta.values[0, 0].tolist() for momenta in history.momenta] == [
        [3.0, 4.0, 5.0]
    ]
    assert f"16 names for {columns} values" in " ".join(history.notes)
    assert "only the first 13 columns are sure" in " ".join(history.notes)
    with pytest.raises(FormatError, match="the name of column 15 is not sure"):
        read_table(th_to_csv([*GLOBALS, *BEHIND], columns), "15")


def test_too_few_names_of_another_program_are_refused() -> None:
    with pytest.raises(FormatError, match="3 values below a header of 2 names"):
        read_table(lines("time,IE", "{t},{e},{k}"))


def test_a_large_table_in_quotes_is_read_in_one_piece_as_line_by_line() -> None:
    rows = [f'"{i / 8}","{i % 7},5"'.replace(".", ",") for i in range(20_000)]
    history = read_table("\n".join(['"time","IE"', *rows, ""]))
    assert history.time.tolist() == [i / 8 for i in range(20_000)]
    assert history.energy.tolist() == [i % 7 + 0.5 for i in range(20_000)]


def test_pandas_agrees_where_it_needs_no_options() -> None:
    import pandas as pd

    frame = pd.read_csv(io.StringIO(write_table("time,IE,KE")))
    np.testing.assert_array_equal(
        frame["IE"], read_table(write_table("time,IE,KE")).energy
    )
