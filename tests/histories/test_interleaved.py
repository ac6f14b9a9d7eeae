"""Tables with a row for each time and part are refused in any order; coarsely printed times are not."""

import numpy as np
import pytest

from d2rpick.base.errors import FormatError
from d2rpick.histories.formats import csv_table, hdf5_file
from d2rpick.histories.history import History
from d2rpick.histories.samples import count_rows_per_time
from tests.reading import read_contents

TIMES = np.linspace(0.0, 0.3, 31)
ENERGIES = {
    "cabin": 50 * (1 - np.cos(40 * TIMES)),
    "frame": 5 * (1 - np.cos(70 * TIMES)),
    "ground": 0 * TIMES,
}


def read_table(
    rows: list[str], head: str = "time,part_id,part_name,internal_energy"
) -> History:
    return read_contents(csv_table, "\n".join([head, *rows, ""]), name="table")


def rows_by_time(parts: int = 3) -> list[str]:
    energies = [*ENERGIES.items()][:parts]
    return [
        f"{time:.3f},{number},{name},{values[state]:.6g}"
        for state, time in enumerate(TIMES)
        for number, (name, values) in enumerate(energies, 1)
    ]


@pytest.mark.parametrize("parts", [2, 3])
def test_a_row_for_each_time_and_part_is_refused_with_the_column_that_tells(
    parts: int,
) -> None:
    with pytest.raises(FormatError) as error:
        read_table(rows_by_time(parts))
    reason = f"each time stands {parts} times with different energies, .*column 'part_id' tells the parts apart"
    assert error.match(reason)
    assert "sort" not in str(error.value)


def test_sorted_by_part_it_is_refused_without_the_advice_to_sort() -> None:
    rows = sorted(rows_by_time(), key=lambda row: row.split(",")[1])
    with pytest.raises(
        FormatError,
        match="another curve or part begins here: put each into its own file",
    ) as error:
        read_table(rows)
    assert "sort" not in str(error.value)


def test_without_a_column_that_tells_the_jumps_of_the_energy_do() -> None:
    rows = [",".join(row.split(",")[::3]) for row in rows_by_time()]
    with pytest.raises(
        FormatError, match="each time stands 3 times with different energies"
    ):
        read_table(rows, "time,internal_energy")


def test_parts_that_come_and_go_are_refused_too() -> None:
    rows = [
        row for row in rows_by_time() if not (row.startswith("0.2") and "frame" in row)
    ]
    with pytest.raises(FormatError, match="each time stands 3 times"):
        read_table(rows)


def test_the_rows_of_one_part_are_read() -> None:
    history = read_table([row for row in rows_by_time() if "cabin" in row])
    np.testing.assert_allclose(history.energy, ENERGIES["cabin"], atol=1e-3)


@pytest.mark.parametrize("noise", [0.0, 5.0])
@pytest.mark.parametrize("rows", [2, 5])
def test_coarsely_printed_times_of_one_energy_are_read(rows: int, noise: float) -> None:
    times = np.arange(40 * rows) / (100 * rows)
    energies = 50 * (1 - np.cos(40 * times)) + noise * np.random.default_rng(3).normal(
        size=times.size
    )
    printed = [
        f"{np.floor(time * 100) / 100:.2f},{energy:.6g}"
        for time, energy in zip(times, energies, strict=True)
    ]
    history = read_table(printed, "time,internal_energy")
    assert history.time.size == 40
    assert "have the same printed time" in " ".join(history.notes)


def test_rows_that_stand_twice_are_read() -> None:
    rows = [row for row in rows_by_time(1) for _ in range(2)]
    assert read_table(rows).time.size == TIMES.size


def test_hdf5_is_refused_in_the_same_way() -> None:
    columns = {
        "time": np.repeat(TIMES, 3),
        "part": np.tile([7, 8, 9], TIMES.size),
        "internal_energy": np.stack([*ENERGIES.values()], axis=1).ravel(),
    }
    with pytest.raises(
        FormatError, match=r"column 'part' tells the parts apart \(7, 8, 9\)"
    ):
        read_contents(hdf5_file, hdf5_file.write(columns))


def test_few_states_are_not_judged() -> None:
    assert count_rows_per_time(np.array([0.0, 0.0, 0.1, 0.1])) == 1
