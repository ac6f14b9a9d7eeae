"""HDF5 files of every layout give the numbers that were put in, or a refusal that lists the contents."""

import io
import os
import signal
import sys
from collections.abc import Callable, Mapping
from contextlib import nullcontext

import h5py
import numpy as np
import pytest
from hypothesis import given

from d2rpick.base.errors import FormatError
from d2rpick.histories.formats import hdf5_file
from d2rpick.histories.formats.hdf5_file import SavedBinout, check_file
from d2rpick.histories.history import History
from d2rpick.histories.opening import Selection
from d2rpick.histories.source import Source
from tests.computed import locate_stored, read_unpacked
from tests.faults import FAULTS, Fault, damage, make_settings
from tests.hdf5_files import (
    ENERGY,
    KINETIC,
    LAYOUTS,
    PARTS,
    TIME,
    lasso,
    plain,
    write_hdf5,
)
from tests.reading import read_contents

SMALL = {
    layout: write_hdf5(LAYOUTS[layout]).getvalue()
    for layout in ("plain", "compound", "lasso")
}


def read_hdf5(file: io.BytesIO, *energy: str, time: str | None = None) -> History:
    return read_contents(
        hdf5_file, file.getvalue(), selection=Selection(time, energy), name="run.h5"
    )


def open_saved_binout(file: io.BytesIO) -> SavedBinout:
    (leg,) = hdf5_file.open_legs([Source("run.h5", file.getvalue())], Selection())
    assert isinstance(leg, SavedBinout)
    return leg


def make_file(columns: Mapping[str, object]) -> io.BytesIO:
    """Return an HDF5 file with these columns by their paths."""

    def write(file: h5py.File) -> None:
        for name, values in columns.items():
            file[name] = values

    return write_hdf5(write)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_layout_gives_the_numbers_put_in(layout: str) -> None:
    file = write_hdf5(LAYOUTS[layout])
    assert hdf5_file.recognises(file.getvalue()[:520])
    history = read_hdf5(file)
    expected = ENERGY.astype("f4") if layout == "columns_upright" else ENERGY
    assert history.time.tolist() == TIME.tolist()
    assert history.energy.tolist() == expected.tolist()


@pytest.mark.parametrize("user_block", [0, 512])
@pytest.mark.parametrize("chunks", [None, True])
def test_columns_that_make_most_of_a_file_are_read_where_they_lie(
    user_block: int, chunks: bool | None
) -> None:
    content, rng = io.BytesIO(), np.random.default_rng(1)
    time, energy = np.arange(5000, dtype=">f8"), rng.random((5000, 1)).astype("f4")
    with h5py.File(content, "w", userblock_size=user_block) as file:
        file.create_dataset("time", data=time, chunks=chunks)
        file.create_dataset("internal_energy", data=energy, chunks=chunks)
    history = read_hdf5(content)
    assert history.time.tolist() == time.tolist()
    assert history.energy.tolist() == energy.ravel().tolist()
    assert (history.time.flags.writeable, history.energy.flags.writeable) == (
        False,
        False,
    )


def test_lasso_branches_have_each_their_own_time_and_parts_by_number() -> None:
    run = open_saved_binout(write_hdf5(lasso))
    assert (run.title, run.version) == ("Sphere", "smp s 365")
    assert run.channels == ("internal_energy", "kinetic_energy")
    assert run.channel("kinetic_energy").tolist() == KINETIC.tolist()
    assert run.time.tolist() == TIME.tolist()
    assert run.part_time.tolist() == (TIME + 1e-6).tolist()
    assert [(part.id, part.title) for part in run.parts] == [
        (1, "ground"),
        (101, "box"),
    ]
    assert (
        run.part_channel("internal_energy", [101, 1]).tolist()
        == PARTS[:, ::-1].tolist()
    )
    with pytest.raises(
        FormatError, match="matsum has not exactly one part 7; choose from 1, 101"
    ):
        run.part_channel("internal_energy", [7])


def test_a_single_part_or_state_may_lack_its_axis() -> None:
    run = open_saved_binout(
        make_file(
            {
                "matsum/time": TIME,
                "matsum/internal_energy": ENERGY,
                "matsum/ids": np.array([3]),
            }
        )
    )
    assert run.part_channel("internal_energy", [3])[:, 0].tolist() == ENERGY.tolist()
    with pytest.raises(FormatError, match="no glstat in this saved binout"):
        run.channel("internal_energy")


def test_matrix_of_another_shape_is_refused() -> None:
    def turned(file: h5py.File) -> None:
        lasso(file)
        del file["matsum/internal_energy"]
        file["matsum/internal_energy"] = PARTS.T

    with pytest.raises(
        FormatError, match=r"has shape \(2, 4\), but \(4, 2\) was expected"
    ):
        open_saved_binout(write_hdf5(turned)).part_channel("internal_energy", [1])


def test_several_candidates_are_listed() -> None:
    two = make_file(
        {
            "a/time": TIME,
            "a/internal_energy": ENERGY,
            "b/time": TIME[:3],
            "b/internal_energy": ENERGY[:3],
        }
    )
    with pytest.raises(
        FormatError,
        match=r"2 columns .* a/internal_energy \(4\), b/internal_energy \(3\)",
    ):
        read_hdf5(two)
    assert read_hdf5(two, "/b/internal_energy").time.tolist() == TIME[:3].tolist()


def test_explicit_paths_win() -> None:
    history = read_hdf5(
        write_hdf5(plain), "kinetic_energy", "internal_energy", time="/time"
    )
    assert history.energy.tolist() == (KINETIC + ENERGY).tolist()
    assert (
        read_hdf5(write_hdf5(lasso), "glstat/kinetic_energy").energy.tolist()
        == KINETIC.tolist()
    )
    with pytest.raises(
        FormatError,
        match=r"no column for 'kinetic'.*give its path: .*kinetic_energy \(4\)",
    ):
        read_hdf5(write_hdf5(plain), "kinetic")


def test_unnamed_columns_have_to_be_named_by_the_user() -> None:
    unnamed = make_file({"data": np.column_stack([TIME, ENERGY])})
    with pytest.raises(
        FormatError, match=r"no column .* data\[0\] \(4\), data\[1\] \(4\)"
    ):
        read_hdf5(unnamed)
    assert (
        read_hdf5(unnamed, "data[1]", time="data[0]").energy.tolist() == ENERGY.tolist()
    )


@pytest.mark.parametrize(
    ("energy", "message"),
    [
        (ENERGY[:3], "has 3 values, time has 4"),
        (np.array([1, np.nan, 2, 3]), "is nan at state 2"),
    ],
)
def test_what_makes_no_history_is_refused(energy: object, message: str) -> None:
    with pytest.raises(FormatError, match=message):
        read_hdf5(make_file({"time": TIME, "internal_energy": energy}))


@pytest.mark.parametrize(
    ("time", "refused"),
    [([0, 2, 1, 3], False), ([0, 3, 2, 1], True), ([0, 1, 0, 1], True)],
)
def test_times_that_step_back_are_those_of_one_restart(
    time: list[float], refused: bool
) -> None:
    with (
        pytest.raises(
            FormatError, match=r"steps back from .* one restart were expected"
        )
        if refused
        else nullcontext()
    ):
        read_hdf5(make_file({"time": np.array(time, float), "internal_energy": ENERGY}))


def test_links_into_other_files_are_not_followed() -> None:
    with pytest.raises(FormatError, match="no column for the internal energy"):
        read_hdf5(
            make_file(
                {
                    "time": TIME,
                    "internal_energy": h5py.ExternalLink(
                        "other.h5", "/internal_energy"
                    ),
                }
            )
        )


def test_shape_far_too_large_for_the_file_is_refused() -> None:
    def write(file: h5py.File) -> None:
        file["time"] = TIME
        file.create_dataset("internal_energy", (4,), "f8")
        file.create_dataset("t", (10**12,), "f8", chunks=(1000,))

    with pytest.raises(FormatError, match="is the file damaged"):
        read_hdf5(write_hdf5(write), "internal_energy", time="t")


def check(layout: str, faults: list[Fault]) -> None:
    """Assert that all numbers read from a damaged file are those that h5py finds at their paths."""
    data = damage(SMALL[layout], faults, [])
    group = {"plain": "/", "compound": "/", "lasso": "glstat"}[layout]
    try:
        (leg,) = hdf5_file.open_legs([Source("run.h5", data)], Selection())
        for name in leg.channels:
            values = leg.channel(name)
            with h5py.File(io.BytesIO(data)) as file:
                path, _, field = name.rpartition("/")
                stored = (
                    file[path][field] if layout == "compound" else file[group][name][()]
                )
            assert values.tolist() == np.ravel(stored).astype(float).tolist()
        if leg.parts:
            leg.part_channel("internal_energy", [part.id for part in leg.parts])
    except FormatError:
        return


@pytest.mark.slow
@make_settings(10)
@given(FAULTS)
def test_damaged_files(faults: list[Fault]) -> None:
    for layout in SMALL:
        check(layout, faults)


# Damage that the library does not report.


def chunked(file: h5py.File) -> None:
    file.create_dataset("time", data=np.arange(40.0), chunks=(8,))
    file.create_dataset(
        "internal_energy",
        data=np.arange(40.0) % 7,
        chunks=(8,),
        compression="gzip",
        fletcher32=True,
    )


def test_bytes_behind_the_end_are_refused() -> None:
    content = write_hdf5(plain).getvalue()
    with pytest.raises(
        FormatError,
        match=f"{len(content) + 4} bytes, {len(content)} by its own header; it is damaged",
    ):
        read_contents(hdf5_file, content + b"0000", name="run.h5")


def test_chunks_that_were_never_written_are_no_zeros() -> None:
    def unfinished(file: h5py.File) -> None:
        chunked(file)
        grown = file.create_dataset("later", (40,), chunks=(8,), dtype="f8")
        grown[:20] = np.arange(20.0)
        file.create_dataset("never", (40,), dtype="f8")

    assert (
        read_hdf5(write_hdf5(unfinished)).energy.tolist()
        == (np.arange(40.0) % 7).tolist()
    )
    with pytest.raises(FormatError, match="/later has 3 of 5 chunks of its data"):
        read_hdf5(write_hdf5(unfinished), "later")
    with pytest.raises(FormatError, match="/never was never written"):
        read_hdf5(write_hdf5(unfinished), "never")


def odd_float() -> h5py.h5t.TypeFloatID:
    """A double with another exponent bias, so that all its numbers are four times as large."""
    kind = h5py.h5t.IEEE_F64LE.copy()
    kind.set_ebias(1021)
    return kind


def odd_integer() -> h5py.h5t.TypeIntegerID:
    """A damaged integer type with only 24 significant bits."""
    kind = h5py.h5t.STD_I32LE.copy()
    kind.set_precision(24)
    return kind


@pytest.mark.parametrize("kind", [odd_float, odd_integer])
def test_numbers_of_no_standard_type_are_refused(
    kind: Callable[[], h5py.h5t.TypeID],
) -> None:
    pair = h5py.h5t.create(h5py.h5t.COMPOUND, 32)
    pair.insert(b"t", 0, h5py.h5t.IEEE_F64LE)
    pair.insert(b"ie", 16, kind())

    def write(file: h5py.File, name: bytes, of: h5py.h5t.TypeID) -> None:
        h5py.h5d.create(file.id, name, of, h5py.h5s.create_simple((TIME.size,)))
        file[name.decode()].write_direct(np.zeros(TIME.size, file[name.decode()].dtype))

    def alone(file: h5py.File) -> None:
        write(file, b"time", kind())
        file["internal_energy"] = ENERGY

    def together(file: h5py.File) -> None:
        write(file, b"run", pair)

    def saved_ids(file: h5py.File) -> None:
        lasso(file)
        del file["matsum/ids"]
        write(file["matsum"], b"ids", kind())

    for damaged in (alone, together, saved_ids):
        with pytest.raises(
            FormatError,
            match=r"numbers of [48] bytes that are no standard type of HDF5",
        ):
            read_hdf5(write_hdf5(damaged))


@pytest.mark.parametrize(
    "kind",
    [">f8", "<f4", ">f4", "<f2", "i1", ">i2", "<i4", ">i8", "u1", "<u2", ">u4", "<u8"],
)
def test_numbers_of_every_standard_type_are_read(kind: str) -> None:
    history = read_hdf5(
        make_file(
            {
                "time": np.arange(9).astype(kind),
                "internal_energy": (np.arange(9) % 5).astype(kind),
            }
        )
    )
    assert (history.time.tolist(), history.energy.tolist()) == (
        [*range(9)],
        [i % 5 for i in range(9)],
    )


def test_a_flipped_bit_in_data_with_a_checksum_is_refused() -> None:
    content = bytearray(write_hdf5(chunked).getvalue())
    with h5py.File(io.BytesIO(content)) as file:
        content[file["internal_energy"].id.get_chunk_info(2).byte_offset + 5] ^= 1
    with pytest.raises(FormatError, match="HDF5 cannot be read"):
        read_hdf5(io.BytesIO(bytes(content)))


class Fatal(io.BytesIO):
    """A damaged file on which the library crashes."""

    def readinto(self, _: object) -> int:
        os.kill(os.getpid(), signal.SIGSEGV)
        return 0


class Endless(io.BytesIO):
    """A damaged file whose reading by the library never ends."""

    def readinto(self, _: object) -> int:
        while True:
            pass


def test_a_crash_of_the_library_is_survived() -> None:
    with pytest.raises(
        FormatError, match=r"run\.h5: the HDF5 library crashed on it \(signal 11\)"
    ):
        check_file(Fatal(write_hdf5(plain).getvalue()), "run.h5")


@pytest.mark.slow
def test_a_library_that_comes_to_no_end_is_ended() -> None:
    with pytest.raises(
        FormatError,
        match=r"run\.h5: the HDF5 library did not finish reading it; the file is damaged",
    ):
        check_file(Endless(write_hdf5(plain).getvalue()), "run.h5", seconds=1)


@pytest.mark.parametrize("name", ["segfault", "bitflip_silent", "lost_chunk_zeros"])
def test_damaged_files_that_were_found_are_refused(name: str) -> None:
    with pytest.raises(FormatError, match="damaged"):
        read_hdf5(io.BytesIO(read_unpacked(locate_stored(f"faults/hdf5_{name}.h5.gz"))))


def test_a_line_end_in_a_name_does_not_break_the_message() -> None:
    with pytest.raises(FormatError, match=r"internal_energ\\n \(21\)"):
        read_hdf5(
            io.BytesIO(
                read_unpacked(locate_stored("faults/hdf5_newline_in_error.h5.gz"))
            ),
            "energy",
        )


def test_the_only_column_of_another_quantity_has_to_be_asked_for() -> None:
    kinetic_file = make_file({"time": TIME, "kinetic_energy": KINETIC})
    with pytest.raises(FormatError, match="whose name is not an internal energy"):
        read_hdf5(kinetic_file)
    assert read_hdf5(kinetic_file, "kinetic_energy").energy.tolist() == KINETIC.tolist()


def test_without_its_library_a_file_is_refused_with_what_to_do(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    content = write_hdf5(plain)
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(
        FormatError, match=r"run\.h5: HDF5 files need h5py; pip install h5py"
    ):
        read_hdf5(content)
