"""Times as a user reads and types them."""

from hypothesis import example, given, strategies as st

from d2rpick.histories.digits import (
    format_beyond_limit,
    format_distinctly,
    format_window,
    round_as_read,
    round_down_as_read,
    round_up_as_read,
)

TIMES = st.floats(-1e9, 1e9).filter(lambda time: not 0 < abs(time) < 1e-290)


@given(TIMES)
@example(0.0)
@example(0.999999999)
@example(-0.999999999)
@example(99999.95)
def test_a_time_that_is_rounded_is_the_nearest_of_six_digits_on_its_side(
    time: float,
) -> None:
    below, above = round_down_as_read(time), round_up_as_read(time)
    assert below <= time <= above
    assert round_as_read(below) == below
    assert round_as_read(above) == above
    assert round_as_read(time) in (below, above)
    assert (below == above) == (round_as_read(time) == time)


@given(TIMES, st.floats(0, 1e3))
def test_a_window_that_is_read_lies_in_the_window(start: float, length: float) -> None:
    low, high = map(float, format_window(start, start + length).split(" to "))
    assert start <= low <= high <= start + length


@given(st.floats(0, 1e3), st.floats(1e-12, 1.0))
def test_what_is_above_a_limit_reads_as_above_it(limit: float, more: float) -> None:
    value = limit + more
    assert value == limit or limit < float(
        format_beyond_limit(value, limit)
    ) <= value * (1 + 5e-3)


@given(st.lists(TIMES.map(abs), min_size=2, max_size=4), st.floats(0, 1e-6))
def test_numbers_that_differ_read_apart(numbers: list[float], off: float) -> None:
    numbers = [*numbers, numbers[0] * (1 + off)]
    assert len({*format_distinctly(numbers)}) == len({*numbers})
