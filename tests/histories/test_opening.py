"""Recognition by content, where the bytes come from, and the errors of both."""

import gzip
import io
import lzma
import re
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from d2rpick.base.errors import FormatError
from d2rpick.histories.formats import READERS
from d2rpick.histories.opening import Selection
from tests.command import put
from tests.reading import read_history

CSV = b"time,internal_energy\n0.0,1.0\n0.1,2.0\n0.2,1.5\n"
GLSTAT = (
    b" title\n                         ls-dyna smp.123264 s           date 01/12/2018\n\n\n"
    b" dt of cycle       1 is controlled by dt2ms     \n\n"
    b" time...........................   0.00000E+00\n"
    b" internal energy................   2.00000E-20\n"
    b" total energy...................   2.00000E-20\n"
)


Write = Callable[..., str]


@pytest.fixture
def file(tmp_path: Path) -> Write:
    def write(data: bytes, name: str = "history") -> str:
        path = put(tmp_path / name, data)
        return str(path)

    return write


def test_the_order_is_a_signature_first_and_what_is_written_seldom_last() -> None:
    assert list(READERS) == ["binout", "radioss-th", "glstat", "matsum", "hdf5", "csv", "d3thdt", "d3plot"]


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
    with pytest.raises(FormatError, match="this is a deck, an energy history was expected"):
        read_history([file(head + b"1,2\n")])


@pytest.mark.parametrize("head", [b"# RADIOSS\n", b"#\n", b"$ only a comment\n", b"// BEGIN\n"])
def test_comments_of_a_table_make_no_deck_of_it(file: Write, head: bytes) -> None:
    assert read_history([file(head + CSV)]).energy.tolist() == [1.0, 2.0, 1.5]


def test_what_is_no_number_in_a_column_beside_it_does_not_keep_the_energy_from_being_read(file: Write) -> None:
    table = b"time,internal_energy,kinetic_energy\n0.0,1.0,n/a\n0.1,2.0,x\n0.2,1.5,3.0\n"
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
    with pytest.raises(FormatError, match=r"d3 family, .*; name the glstat, matsum, d3plot or binout"):
        read_history([str(tmp_path / "d3dump01")])


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"", "empty"),
        (b"\n\n", "no rows of at least two numbers"),
        (bytes(range(256)), "binary data of no known format"),
        (b"\x89HDF\r\n\x1a\n\x00\x00", "HDF5 cannot be read"),
        (b"Once upon a time\nthere was a beam\n", "no rows of at least two numbers"),
        (b"metric,value,unit\nmass,12.5,kg\nenergy,88.1,J\n", "no rows of at least two numbers"),
        (b"Curveplot\ntitle\nTime\nEnergy\nComponent\n", "no curve was found"),
        (gzip.compress(CSV, mtime=0)[:10] + b"\xff" * 20, "gzip"),
        (gzip.compress(b"", mtime=0), "empty"),
        (zipped("[Content_Types].xml", "xl/workbook.xml"), "an Excel workbook, .*; save the sheet as csv"),
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(99), "an Excel workbook"),
        (zipped("glstat"), "a zip archive, .*; unpack it"),
        (lzma.compress(CSV), "a packed file, .*; unpack it"),
        (b"PAR1" + bytes(99), "a parquet file, .*to_csv"),
    ],
)
def test_what_is_no_history_is_refused_in_one_line(file: Write, data: bytes, reason: str) -> None:
    with pytest.raises(FormatError, match=reason) as caught:
        read_history([file(data)])
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith(file(data))


def test_missing_files_and_folders_are_named(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match=re.escape(str(tmp_path / "none")) + ": no such file"):
        read_history([str(tmp_path / "none")])
    with pytest.raises(FormatError, match="folder"):
        read_history([str(tmp_path)])
    with pytest.raises(FormatError, match="cannot be read"):
        read_history(["a\0b"])
    with pytest.raises(FormatError, match="cannot be read"):
        read_history([str(tmp_path / ("x" * 5000))])


def test_the_selection_reaches_the_reader(file: Write) -> None:
    assert read_history([file(CSV)], Selection(time="2", energy=("1",))).time.tolist() == [1.0, 1.5]
    np.testing.assert_array_equal(read_history([file(GLSTAT)], Selection(energy=("Internal Energy",))).energy, [2e-20])
