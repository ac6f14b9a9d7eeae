"""Formats are recognised by content; sources of bytes; errors of both."""

import gzip
import io
import lzma
import re
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from d2rpick.base.errors import FormatError
from d2rpick.histories.formats import READERS
from d2rpick.histories.opening import Selection, open_run
from tests.command import put
from tests.made_t01 import MadePart, make_t01
from tests.reading import read_history
from tests.text_files import make_glstat_text

CSV = b"time,internal_energy\n0.0,1.0\n0.1,2.0\n0.2,1.5\n"
GLSTAT = (
    b" title\n                         ls-dyna smp.123264 s           date 01/12/2018\n\n\n"
    b" dt of cycle       1 is controlled by dt2ms     \n\n"
    b" time...........................   0.00000E+00\n"
    b" internal energy................   2.00000E-20\n"
    b" total energy...................   2.00000E-20\n"
)


Write = Callable[..., str]

DYNA_HEAD = b" one shell\n                         ls-dyna smp.123456 s           date 02/02/2020\n\n"
LEGEND = b"{BEGIN LEGEND}\n Entity #        Title\n        1     contact one\n{END LEGEND}\n\n"
STATES = (
    b" time =   0.0000E+00\n mat.#=    1             inten=   0.0000E+00     kinen=   1.0000E+00\n"
    b" time =   1.0000E-01\n mat.#=    1             inten=   1.0000E+00     kinen=   0.0000E+00\n"
)


@pytest.fixture
def file(tmp_path: Path) -> Write:
    def write(data: bytes, name: str = "history") -> str:
        path = put(tmp_path / name, data)
        return str(path)

    return write


def test_the_order_is_a_signature_first_and_what_is_written_seldom_last() -> None:
    assert list(READERS) == [
        "binout",
        "radioss-th",
        "glstat",
        "matsum",
        "hdf5",
        "csv",
        "d3thdt",
        "d3plot",
    ]


@pytest.mark.parametrize(("data", "name"), [(CSV, "glstat"), (GLSTAT, "energy.csv")])
def test_content_decides_and_not_the_name(file: Write, data: bytes, name: str) -> None:
    history = read_history([file(data, name)])
    assert history.format == ("csv" if data is CSV else "glstat")
    assert history.source == (str(Path(history.source[0]).parent / name),)


@pytest.mark.parametrize(
    "head",
    [
        b"*KEYWORD\n",
        b"\xef\xbb\xbf$ roof\r\n \t\n  $\n*NODE",
        b"#RADIOSS STARTER\n",
        b"$ d\n/BEGIN\n",
        b"*DEFINE_CURVE\n",
    ],
)
def test_a_deck_is_told_behind_comments(file: Write, head: bytes) -> None:
    with pytest.raises(
        FormatError, match="this is a deck, but an energy history was expected"
    ):
        read_history([file(head + b"1,2\n")])


@pytest.mark.parametrize(
    "head", [b"# RADIOSS\n", b"#\n", b"$ only a comment\n", b"// BEGIN\n"]
)
def test_comments_of_a_table_make_no_deck_of_it(file: Write, head: bytes) -> None:
    assert read_history([file(head + CSV)]).energy.tolist() == [1.0, 2.0, 1.5]


def test_what_is_no_number_in_a_column_beside_it_does_not_keep_the_energy_from_being_read(
    file: Write,
) -> None:
    table = (
        b"time,internal_energy,kinetic_energy\n0.0,1.0,n/a\n0.1,2.0,x\n0.2,1.5,3.0\n"
    )
    history = read_history([file(table)])
    assert history.energy.tolist() == [1.0, 2.0, 1.5]
    assert history.balance is None or history.balance.kinetic is None


def test_a_given_format_is_not_second_guessed(file: Write) -> None:
    assert read_history([file(CSV)], input_format="csv").format == "csv"
    with pytest.raises(FormatError, match="this is not a glstat"):
        read_history([file(CSV)], input_format="glstat")
    with pytest.raises(FormatError, match="binary"):
        read_history([file(b"\x00\x01\x02" * 99)], input_format="csv")


def zipped(*names: str) -> bytes:
    """An archive of files."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for name in names:
            archive.writestr(name, CSV)
    return packed.getvalue()


def test_what_ls_dyna_draws_is_no_history(tmp_path: Path) -> None:
    (tmp_path / "d3dump01").write_bytes(bytes(range(256)))
    with pytest.raises(
        FormatError, match=r"d3 family, .*; name the glstat, matsum, d3plot or binout"
    ):
        read_history([str(tmp_path / "d3dump01")])


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"", "empty"),
        (b"\n\n", "no rows of at least two numbers"),
        (bytes(range(256)), "binary data of no known format"),
        (b"\x89HDF\r\n\x1a\n\x00\x00", "HDF5 cannot be read"),
        (b"Once upon a time\nthere was a beam\n", "no rows of at least two numbers"),
        (
            b"metric,value,unit\nmass,12.5,kg\nenergy,88.1,J\n",
            "no rows of at least two numbers",
        ),
        (b"Curveplot\ntitle\nTime\nEnergy\nComponent\n", "no curve was found"),
        (gzip.compress(CSV, mtime=0)[:10] + b"\xff" * 20, "gzip"),
        (gzip.compress(b"", mtime=0), "empty"),
        (
            zipped("[Content_Types].xml", "xl/workbook.xml"),
            "an Excel workbook, .*; save the sheet as csv",
        ),
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(99), "an Excel workbook"),
        (zipped("glstat"), "a zip archive, .*; unpack it"),
        (lzma.compress(CSV), "a packed file, .*; unpack it"),
        (b"PAR1" + bytes(99), "a parquet file, .*to_csv"),
    ],
)
def test_what_is_no_history_is_refused_in_one_line(
    file: Write, data: bytes, reason: str
) -> None:
    with pytest.raises(FormatError, match=reason) as caught:
        read_history([file(data)])
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith(file(data))


def test_missing_files_and_folders_are_named(tmp_path: Path) -> None:
    with pytest.raises(
        FormatError, match=re.escape(str(tmp_path / "none")) + ": no such file"
    ):
        read_history([str(tmp_path / "none")])
    with pytest.raises(FormatError, match="folder"):
        read_history([str(tmp_path)])
    with pytest.raises(FormatError, match="cannot be read"):
        read_history(["a\0b"])
    with pytest.raises(FormatError, match="cannot be read"):
        read_history([str(tmp_path / ("x" * 5000))])


def test_the_selection_reaches_the_reader(file: Write) -> None:
    assert read_history(
        [file(b"first,second\n0.0,1.0\n0.1,1.5\n")], Selection(time="2", energy=("1",))
    ).time.tolist() == [1.0, 1.5]
    np.testing.assert_array_equal(
        read_history([file(GLSTAT)], Selection(energy=("Internal Energy",))).energy,
        [2e-20],
    )


@pytest.mark.parametrize(
    ("data", "name", "reason"),
    [
        (
            DYNA_HEAD + LEGEND + b" slave         1 time 0.0E+00  x 0.0 y 0.0 z 0.0\n",
            "a",
            "rcforc.* of LS-DYNA, which has",
        ),
        (
            DYNA_HEAD
            + LEGEND
            + b"\n\n contact interface energy output at time 0.0\n 1 0.0 0.0\n",
            "a",
            "this is the sleout",
        ),
        (
            DYNA_HEAD
            + LEGEND
            + b" n o d a l   p r i n t   o u t   f o r\n 1 0.0 0.0\n",
            "a",
            "this is the nodout",
        ),
        (
            DYNA_HEAD + LEGEND + b" something new\n 1 0.0 0.0\n",
            "run/NCFORC",
            "this is the ncforc of LS-DYNA",
        ),
        (
            DYNA_HEAD + b"\n something new\n 1 0.0 0.0\n",
            "a",
            "this is an ASCII database of LS-DYNA, .*; name the glstat",
        ),
        (
            b"    -1\n    58\nNONE\n  1 2 3\n  4 5 6\n",
            "h.unv",
            r"this is a universal file \(UNV\)",
        ),
        (
            b"Test object number          :1\nName of the channel :internal energy\n0.0\n",
            "a.001",
            "ISO-MME",
        ),
        (
            b"  Abaqus/Explicit 2024\n STEP 1\n INCREMENT TIME\n 0 0.0 1.0\n 1 0.1 1.0\n",
            "a.sta",
            "status file of Abaqus",
        ),
        (b' {"time": [0.0, 0.1], "ie": [1, 2]}', "a.json", "a JSON document"),
        (b"[[0.0, 1.0],\n [0.1, 2.0]]", "a.json", "a JSON document"),
        (b"<?xml version='1.0'?><a/>", "a.xml", "an XML or HTML document"),
        (
            zipped("energy.npy"),
            "a.npz",
            r"an archive of numpy arrays \(npz\), .*from_frame",
        ),
        (b"\x93NUMPY\x01\0v\0", "a.npy", "a numpy array"),
        (b"HKSRD0  " + bytes(99), "a.odb", r"\(odb\), .*XY report"),
        (b"ARROW1\0\0" + bytes(99), "a.arrow", "an arrow file, .*from_frame"),
        (b"SQLite format 3\0" + bytes(99), "a.db", "an SQLite database"),
        (b"/RUN/BOX/2\n0.02\n/TFILE/4\n0.001 0.1\n", "BOX_0002.rad", "this is a deck"),
        (
            b" " + b"*" * 72 + b"\n **  OpenRadioss Engine\n 0.0 1.0\n 0.1 2.0\n",
            "BOX_0001.out",
            "a listing of Radioss",
        ),
        (
            b"\n  CYCLE    TIME      TIME-STEP  I-ENERGY\n 0 0.0 1E-6 0.0\n 1 0.1 1E-6 1.0\n",
            "BOX_0001.out",
            "a listing",
        ),
        (
            b" Date: 1\n | LS-DYNA, A Program for Nonlinear Dynamic |\n 0 1\n 1 2\n",
            "d3hsp",
            "a listing of LS-DYNA",
        ),
    ],
)
def test_a_file_beside_the_histories_is_named_for_what_it_is(
    file: Write, data: bytes, name: str, reason: str
) -> None:
    with pytest.raises(FormatError, match=reason) as error:
        read_history([file(data, Path(name).name)])
    assert "\n" not in str(error.value)
    assert "; " in str(error.value)  # the remedy


def test_a_matsum_is_told_by_its_parts_behind_any_legend(file: Write) -> None:
    states = b" time =   0.0000E+00\n mat.#=    1             inten=   0.0000E+00     kinen=   0.0000E+00\n"
    entries = b"".join(b"%9d     a part\n" % number for number in range(1, 2000))
    long_legend = (
        b"{BEGIN LEGEND}\n Entity #        Title\n" + entries + b"{END LEGEND}\n\n"
    )
    for text in (
        DYNA_HEAD + LEGEND,
        DYNA_HEAD + LEGEND + states,
        DYNA_HEAD + long_legend + states,
    ):
        assert open_run([file(text)]).databases[0].format == "matsum"
    with pytest.raises(FormatError, match="this is the rcforc"):
        open_run(
            [
                file(
                    DYNA_HEAD
                    + long_legend
                    + b" slave         1 time 0.0E+00  x 0.0 y 0.0 z 0.0\n"
                )
            ]
        )


def test_words_about_a_solver_in_a_table_make_no_listing_of_it(file: Write) -> None:
    head = b"# written by OpenRadioss engine, LS-DYNA and Abaqus/Explicit\n"
    assert read_history([file(head + CSV)]).energy.tolist() == [1.0, 2.0, 1.5]


def test_a_pattern_gives_what_the_folder_gives_and_names_what_it_leaves_out(
    tmp_path: Path,
) -> None:
    for name, data in {
        "matsum": DYNA_HEAD + b"\n" + STATES,
        "nodout": DYNA_HEAD + b" n o d a l   p r i n t   o u t\n 1 0.0 0.0\n",
        "a_deck.k": b"*KEYWORD\n*END\n",
        "energy.csv": CSV,
        "remarks.txt": b"only words\n",
    }.items():
        put(tmp_path / name, data)
    by_folder, by_pattern = (
        open_run([str(name)]) for name in (tmp_path, tmp_path / "*")
    )
    assert by_pattern.sources == by_folder.sources == (str(tmp_path / "matsum"),)
    notes = " ".join(by_pattern.notes)
    assert (
        "nodout was left out: this is the nodout of LS-DYNA, which has no internal energy"
        in notes
    )
    assert "a_deck.k was left out: this is a deck" in notes
    assert (
        "energy.csv was left out: a table next to databases of the solver; name it to use it"
        in notes
    )
    assert "remarks.txt was left out" in notes
    table_note = f"{tmp_path / 'energy.csv'} was left out: a table next to databases of the solver; name it to use it"
    assert by_folder.notes == (table_note,)


def test_a_file_of_a_folder_that_is_named_like_a_database_is_not_left_out_unseen(
    tmp_path: Path,
) -> None:
    """A folder gives the files that the solver names; a file of a restart that the user renamed is not among them."""
    for name in ("matsum", "matsum01", "matsum.png", "matsum_plan.k", "d3hsp"):
        put(tmp_path / name, DYNA_HEAD + b"\n" + STATES)
    (tmp_path / "binout_files").mkdir()
    run = open_run([str(tmp_path)])
    assert run.sources == (str(tmp_path / "matsum"),)
    renamed = str(tmp_path / "matsum01")
    (note,) = run.notes
    assert note == (
        f"{renamed} was not read, because the solver gives no file this name; if it belongs to the run, give all "
        "files by name"
    )
    put(tmp_path / "old.glstat", STATES)
    (note,) = open_run([str(tmp_path)]).notes
    assert note.startswith(f"{renamed}, {tmp_path / 'old.glstat'} were not read")
    assert not open_run([str(tmp_path / "matsum")]).notes


def test_what_is_named_beside_a_pattern_is_not_left_out(tmp_path: Path) -> None:
    put(
        tmp_path / "nodout", DYNA_HEAD + b" n o d a l   p r i n t   o u t\n 1 0.0 0.0\n"
    )
    with pytest.raises(FormatError, match="this is the nodout"):
        open_run(
            [
                str(put(tmp_path / "matsum", DYNA_HEAD + b"\n" + STATES)),
                str(tmp_path / "nodout"),
            ]
        )
    with pytest.raises(FormatError, match="this is the nodout"):
        open_run([str(tmp_path / "nod*")])


@pytest.mark.parametrize("order", [("runT01", "runT02"), ("runT02", "runT01")])
def test_legs_that_start_together_are_ordered_by_name(
    order: tuple[str, str], tmp_path: Path
) -> None:
    """One file is an earlier copy of the other, written while the run was going on."""
    for name in order:
        write_table(tmp_path / name, [i / 10 for i in range(int(name[-1]) + 4)])
    run = open_run([str(tmp_path / name) for name in order])
    assert run.databases[0].source == f"{tmp_path / 'runT01'}, {tmp_path / 'runT02'}"


def write_table(path: Path, times: Sequence[float]) -> str:
    """Write a table of energies that depend on the time alone, and return its path."""
    rows = "".join(f"{time},{10 * time}\n" for time in times)
    return str(put(path, f"time,internal_energy\n{rows}"))


@pytest.mark.parametrize("packed", [False, True])
def test_the_same_file_twice_is_read_once(packed: bool, tmp_path: Path) -> None:
    original = write_table(tmp_path / "runT01", [0, 1, 2, 3])
    copy = tmp_path / ("runT01.gz" if packed else "copyT01")
    content = Path(original).read_bytes()
    copy.write_bytes(gzip.compress(content) if packed else content)
    run = open_run([original, str(copy)])
    assert run.databases[0].source == original
    note = f"{copy} has the same content as {original} and was left out"
    assert run.history(Selection()).notes == (note,)


@pytest.mark.parametrize("start", [0.0, 5.0])
def test_runs_that_begin_at_the_same_time_are_not_joined(
    start: float, tmp_path: Path
) -> None:
    """Their energies agree at the start, where nothing is deformed, and they have no other time in common."""
    first = write_table(tmp_path / "aT01", [start, start + 1, start + 2])
    second = write_table(tmp_path / "bT01", [start, start + 0.9, start + 1.9])
    with pytest.raises(
        FormatError, match=f"both begin at {start:g}, but have different times"
    ):
        open_run([first, second])


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_files_without_a_common_part_are_not_joined(
    order: tuple[int, int], tmp_path: Path
) -> None:
    """A later file would replace the first one, although it belongs to another model."""
    names = [str(tmp_path / f"{name}T01") for name in "ab"]
    for name, part, start in zip(names, (1, 2), (0, 2), strict=True):
        content = make_t01(4, [MadePart(part, "box")], start=start)
        Path(name).write_bytes(content.data)
    with pytest.raises(
        FormatError, match="have no part in common, but restart segments"
    ):
        open_run([names[i] for i in order])


def test_a_restart_that_adds_a_part_is_joined(tmp_path: Path) -> None:
    names = [str(tmp_path / f"runT0{leg}") for leg in (1, 2)]
    parts = [MadePart(1, "box"), MadePart(2, "step")]
    for name, count, start in zip(names, (1, 2), (0, 3), strict=True):
        Path(name).write_bytes(make_t01(3, parts[:count], start=start).data)
    assert [part.id for part in open_run(names).parts] == [1]


def test_files_of_different_solvers_are_not_one_run(tmp_path: Path) -> None:
    radioss, ls_dyna = str(tmp_path / "runT01"), str(tmp_path / "glstat")
    Path(radioss).write_bytes(make_t01(8, [MadePart(1, "box")]).data)
    Path(ls_dyna).write_bytes(make_glstat_text(range(8), range(8)))
    with pytest.raises(
        FormatError,
        match=f"{ls_dyna} by LS-DYNA and {radioss} by Radioss were written by different solvers",
    ):
        open_run([radioss, ls_dyna])
