"""Numbers of the exact reader are used only if a reader that rounds agrees with them."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from d2rpick.histories.formats.plain_rows import read_exact_numbers
from d2rpick.histories.history import Samples

HARD = st.floats(-1e300, 1e300).map(repr) | st.from_regex(
    r"-?[0-9]{1,25}(\.[0-9]{0,25})?([eE][+-]?[0-9]{1,2})?",
    fullmatch=True,
    alphabet=st.characters(codec="ascii"),
)


def rounded(texts: list[list[str]]) -> Samples:
    """Return numbers as a reader that rounds would."""
    return np.array([[float(text) * (1 + 1e-12) for text in row] for row in texts])


@given(st.lists(st.tuples(HARD, HARD), min_size=1, max_size=40))
def test_numbers_are_those_of_python(rows: list[tuple[str, str]]) -> None:
    cells = [[*row] for row in rows]
    numbers = read_exact_numbers(
        "".join(",".join(row) + "\n" for row in rows).encode(), ",", rounded(cells)
    )
    assert numbers is not None
    assert numbers.tolist() == [[float(text) for text in row] for row in rows]


@pytest.mark.parametrize(
    "cell",
    ["1.5-003", "1d5", "1e", "2x", "1.2.3", "0x10", "1_0", "nan", "+1", "", " ", "1 2"],
)
@pytest.mark.parametrize("meant", [1.5e-3, 1e5, 7.0])
def test_a_number_that_only_begins_like_one_is_not_trusted(
    cell: str, meant: float
) -> None:
    """Scipy reads 1.5-003, as Fortran writes 0.0015, as 1.5."""
    assert (
        read_exact_numbers(
            f"0,1\n1,{cell}\n".encode(), ",", np.array([[0.0, 1.0], [1.0, meant]])
        )
        is None
    )


@pytest.mark.parametrize("rows", ["1,2\n3\n", "1,2\n3,4\n5,6\n", "1;2\n3;4\n"])
def test_rows_of_another_shape_are_not_read(rows: str) -> None:
    assert (
        read_exact_numbers(rows.encode(), ",", np.array([[1.0, 2.0], [3.0, 4.0]]))
        is None
    )
