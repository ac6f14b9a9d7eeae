"""Small HDF5 files in the layouts that users write."""

import io
from collections.abc import Callable

import h5py
import numpy as np

TIME = np.array([0.0, 0.1, 0.25, 0.3])
ENERGY = np.array([2e-20, 1.5, -3.25, 7.0])
KINETIC = np.array([4.0, 3.0, 2.0, 1.0])
PARTS = np.array([[0.0, 1.0], [2.0, 3.0], [4.0, 5.0], [6.0, 7.0]])


def write_hdf5(write: Callable[[h5py.File], None]) -> io.BytesIO:
    memory = io.BytesIO()
    with h5py.File(memory, "w") as file:
        write(file)
    return memory


def plain(file: h5py.File) -> None:
    file["time"], file["internal_energy"], file["kinetic_energy"] = (
        TIME,
        ENERGY,
        KINETIC,
    )


def columns_upright(file: h5py.File) -> None:
    file["run/Time (ms)"], file["run/IE"] = TIME[:, None], ENERGY[:, None].astype("f4")


def matrix(file: h5py.File) -> None:
    file["history"] = np.column_stack([TIME, ENERGY, KINETIC])
    file["history"].attrs["columns"] = ["time", "internal_energy", "kinetic_energy"]


def matrix_across(file: h5py.File) -> None:
    file["history"] = np.stack([TIME, ENERGY])
    file["history"].attrs["columns"] = "time, internal_energy"


def compound(file: h5py.File) -> None:
    rows = np.zeros(4, [("time", "f8"), ("internal_energy", "f8"), ("note", "S3")])
    rows["time"], rows["internal_energy"] = TIME, ENERGY
    file["history"] = rows


def h5md(file: h5py.File) -> None:
    file["observables/internal_energy/time"] = TIME
    file["observables/internal_energy/value"] = ENERGY
    file["observables/internal_energy/step"] = np.arange(4)


def matlab(file: h5py.File) -> None:
    file["t"], file["E_int"] = TIME[None, :], ENERGY[None, :]
    file["#refs#/time"] = np.arange(3.0)


def pandas_values_block(file: h5py.File) -> None:
    """Write a pandas table without data columns: the column names are in a pickled attribute only."""
    rows = np.zeros(4, [("index", "f8"), ("values_block_0", "f8", (2,))])
    rows["index"], rows["values_block_0"] = TIME, np.column_stack([KINETIC, ENERGY])
    file["run/table"] = rows
    file["run"].attrs["pandas_type"] = np.bytes_(b"frame_table")
    file["run"].attrs["info"] = np.bytes_(
        b"(dp0\nI1\n(dp1\nsVindex\np6\n(dp7\nVindex_name\np8\nVtime\np9\nss."
    )
    names = b"(lp0\nVkinetic_energy\np1\naVinternal_energy\np2\na."
    file["run/table"].attrs["values_block_0_kind"] = np.bytes_(names)
    file["run/_i_table/index/sorted"] = np.arange(9.0)


def pandas_frame(file: h5py.File) -> None:
    """Write a pandas table in the "fixed" format: an index, and a block of columns for each type."""
    file.create_group("run")
    file["run"].attrs["pandas_type"], file["run"].attrs["nblocks"] = (
        np.bytes_(b"frame"),
        2,
    )
    file["run/axis1"] = TIME
    file["run/axis1"].attrs["name"] = np.bytes_(b"time")
    file["run/block0_items"] = np.array([b"kinetic_energy", b"internal_energy"])
    file["run/block0_values"] = np.column_stack([KINETIC, ENERGY])
    file["run/block1_items"], file["run/block1_values"] = (
        np.array([b"note"]),
        np.full((4, 1), b"x"),
    )


def pandas_series(file: h5py.File) -> None:
    file["internal_energy/index"], file["internal_energy/values"] = TIME, ENERGY
    file["internal_energy"].attrs["pandas_type"] = np.bytes_(b"series")
    file["internal_energy/index"].attrs["name"] = np.bytes_(b"time")


def lasso(file: h5py.File) -> None:
    (
        file["glstat/time"],
        file["glstat/internal_energy"],
        file["glstat/kinetic_energy"],
    ) = TIME, ENERGY, KINETIC
    file["glstat/title"] = np.array([b"Sphere      "])
    file["glstat/version"], file["glstat/revision"] = (
        np.array([b"smp s  "]),
        np.array([b"365"]),
    )
    file["matsum/time"], file["matsum/internal_energy"] = TIME + 1e-6, PARTS
    file["matsum/ids"], file["matsum/legend_ids"] = (
        np.array([1, 101]),
        np.array([101, 1, 7]),
    )
    file["matsum/legend"] = np.array(
        [b"box".ljust(80) + b"ground".ljust(80) + b"unseen".ljust(80)]
    )


LAYOUTS = {
    write.__name__: write
    for write in (
        plain, columns_upright, matrix, matrix_across, compound, h5md, matlab, pandas_values_block,
        pandas_frame, pandas_series, lasso,
    )
}  # fmt: skip
