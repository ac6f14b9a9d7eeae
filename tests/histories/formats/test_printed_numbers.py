"""Numbers in the fixed columns of Fortran."""

import numpy as np
from hypothesis import given, strategies as st

from d2rpick.histories.formats.printed_numbers import decode


@given(st.lists(st.floats(-1e308, 1e308), min_size=1, max_size=50), st.integers(1, 9))
def test_numbers_are_those_of_float_bit_for_bit(values: list[float], decimals: int) -> None:
    texts = [f"{value:.{decimals}E}" for value in values]
    fields = np.array([text.rjust(decimals + 10).encode() for text in texts])
    assert decode(fields, decimals).tobytes() == np.array([float(text) for text in texts]).tobytes()


@given(st.lists(st.text("0123456789+-.EeDd *Nna", min_size=14, max_size=14), min_size=1, max_size=20))
def test_odd_fields_are_float_or_nan(texts: list[str]) -> None:
    found = decode(np.array([text.encode() for text in texts]), 5)
    for text, value in zip(texts, found.tolist(), strict=True):
        plain = text.lower().replace("d", "e")
        try:
            expected = float(plain)
        except ValueError:
            continue
        if np.isfinite(value):
            assert value == expected
        else:
            assert not np.isfinite(expected) or text.endswith(" ")
