"""Where a curve crosses a level or turns, and its outline with fewer points."""

from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, strategies as st

from d2rpick.histories.samples import (
    draw_outline,
    find_crossings,
    find_first_above,
    find_turns,
    halve_brackets,
    narrow_brackets,
)

# small integers hit every coincidence: samples on the level, plateaus, touching
levels = st.integers(-3, 3)
energies = st.lists(levels, min_size=1, max_size=12)
CONVENTIONS = {
    "between two samples": ([0, 4], 1, [(0.25, True)]),
    "on a sample": ([2, 1, 0], 1, [(1.0, False)]),
    "a plateau counts once, at its first sample": ([0, 1, 1, 1, 2], 1, [(1.0, True)]),
    "touching from below": ([0, 1, 0], 1, []),
    "touching from above, on a plateau": ([2, 1, 1, 2], 1, []),
    "the record begins on the level": ([1, 2, 3], 1, [(0.0, True)]),
    "the record begins with a plateau on the level": ([1, 1, 0], 1, [(0.0, False)]),
    "the record ends on the level": ([3, 2, 1], 1, [(2.0, False)]),
    "the record ends with a plateau on the level": ([0, 1, 1], 1, [(1.0, True)]),
    "always on the level": ([1, 1, 1], 1, []),
    "never on the level": ([2, 3, 2], 1, []),
    "one sample": ([1], 1, []),
    "up and down": ([0, 2, 0], 1, [(0.5, True), (1.5, False)]),
}

ROOTS = st.lists(st.floats(0.01, 0.99), min_size=1, max_size=8).map(np.array)


def crossings(energy: list[int], level: float) -> list[tuple[float, bool]]:
    times, rising = find_crossings(
        np.arange(len(energy), dtype=float), np.array(energy, dtype=float), level
    )
    return list(zip(times.tolist(), rising.tolist(), strict=True))


@pytest.mark.parametrize("name", CONVENTIONS)
def test_conventions(name: str) -> None:
    energy, level, expected = CONVENTIONS[name]
    assert crossings(energy, level) == expected


def walk(energy: list[int], level: int) -> list[tuple[Fraction, bool]]:
    """Crossings by a walk in rational arithmetic: the same conventions with another method."""
    passages: list[tuple[Fraction, bool]] = []
    side, arrived = 0, Fraction(0)
    for i, value in enumerate(energy):
        now = (value > level) - (value < level)
        if now == 0:
            if i == 0 or energy[i - 1] != level:
                arrived = Fraction(i)
            continue
        if i and energy[i - 1] == level:
            if side != now:
                passages.append((arrived, now > 0))
        elif side and side != now:
            previous = energy[i - 1]
            passages.append(
                (i - 1 + Fraction(level - previous, value - previous), now > 0)
            )
        side = now
    if side and energy[-1] == level:
        passages.append((arrived, side < 0))
    return passages


@given(energies, levels)
def test_exact_on_piecewise_linear_data(energy: list[int], level: int) -> None:
    passages, expected = crossings(energy, level), walk(energy, level)
    assert [rising for _, rising in passages] == [rising for _, rising in expected]
    assert [time for time, _ in passages] == pytest.approx(
        [float(time) for time, _ in expected], rel=1e-15, abs=0
    )


@given(
    energies,
    levels,
    st.integers(-5, 5),
    st.sampled_from([0.25, 2.0, 1024.0]),
    st.sampled_from([0.5, 4.0]),
)
def test_shifting_and_scaling_shift_and_scale_the_answer(
    energy: list[int], level: int, shift: int, stretch: float, gain: float
) -> None:
    time, values = np.arange(len(energy), dtype=float), np.array(energy, dtype=float)
    plain, rising = find_crossings(time, values, level)
    moved, still_rising = find_crossings(
        stretch * (time + shift), gain * (values + shift), gain * (level + shift)
    )
    assert still_rising.tolist() == rising.tolist()
    assert moved.tolist() == pytest.approx(
        (stretch * (plain + shift)).tolist(), rel=1e-14, abs=1e-14
    )


@given(energies, levels)
def test_crossings_alternate_and_mirror(energy: list[int], level: int) -> None:
    passages = crossings(energy, level)
    assert all(a[1] != b[1] for a, b in pairwise(passages))
    assert [
        (t, not up) for t, up in crossings([-e for e in energy], -level)
    ] == passages


@given(energies)
def test_extrema_are_where_the_slope_changes_sign(energy: list[int]) -> None:
    values = np.array(energy, dtype=float)
    at, peaks = find_turns(values)
    for i, peak in zip(at.tolist(), peaks.tolist(), strict=True):
        previous = next((v for v in values[:i][::-1] if v != values[i]), values[i])
        following = next((v for v in values[i:] if v != values[i]), values[i])
        assert (
            (previous < values[i] > following)
            if peak
            else (previous > values[i] < following)
        )
    assert (peaks[1:] != peaks[:-1]).all()
    monotone = np.all(np.diff(values) >= 0) or np.all(np.diff(values) <= 0)
    assert (not at.size) == bool(monotone)


@given(st.integers(3, 3000), st.integers(0, 100), st.integers(1, 200))
def test_an_outline_keeps_ends_and_extremes_and_stays_small(
    states: int, seed: int, stretches: int
) -> None:
    energy = np.random.default_rng(seed).standard_normal(states)
    time, drawn = draw_outline(np.arange(states, dtype=float), energy, stretches)
    assert time.size <= min(states, 2 * stretches + 2)
    assert (drawn.min(), drawn.max()) == (energy.min(), energy.max())
    assert (time[0], time[-1]) == (0, states - 1)
    assert np.all(np.diff(time) > 0)
    assert np.all(energy[time.astype(int)] == drawn)


@given(st.integers(10, 3000), st.integers(0, 100))
def test_of_each_stretch_the_extremes_stay(states: int, seed: int) -> None:
    energy = np.random.default_rng(seed).standard_normal(states)
    time, _ = draw_outline(np.arange(states, dtype=float), energy, 4)
    for piece in np.array_split(np.arange(states), 4):
        assert {
            piece[0] + energy[piece].argmin(),
            piece[0] + energy[piece].argmax(),
        } <= {*time.astype(int).tolist()}


@given(ROOTS)
def test_every_bracket_narrows_on_its_root(roots: np.ndarray) -> None:
    narrowed = narrow_brackets(
        lambda t: (roots**3 - t**3, -3 * t**2),
        np.zeros(roots.size),
        np.ones(roots.size),
        steps=64,
    )
    np.testing.assert_allclose(narrowed.at, roots, rtol=1e-12)
    assert np.all(narrowed.within <= narrowed.at)
    assert np.all(narrowed.at <= narrowed.beyond)


@given(ROOTS)
def test_what_is_within_stays_within_either_way_round(roots: np.ndarray) -> None:
    upwards = halve_brackets(
        lambda t: t < roots, np.zeros(roots.size), np.ones(roots.size), 64
    )
    downwards = halve_brackets(
        lambda t: t >= roots, np.ones(roots.size), np.zeros(roots.size), 64
    )
    assert np.all(upwards < roots)
    assert np.all(downwards >= roots)
    np.testing.assert_allclose(upwards, roots, rtol=1e-12)
    np.testing.assert_allclose(upwards, downwards, atol=1e-12)


@given(st.integers(1, 3), st.integers(1, 23), st.integers(0, 999))
def test_halvings_tested_together_find_what_single_ones_find(
    copies: int, halvings: int, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    within = np.tile(rng.normal(size=(20, 2)), (copies, 1))  # 120 ends are many
    beyond = within + rng.normal(size=within.shape)

    def passes(time: np.ndarray) -> np.ndarray:
        return np.asarray(np.sin(40 * time) > np.cos(3 * time))

    expected, other = within, beyond
    for _ in range(halvings):
        middle = (expected + other) / 2
        is_within = passes(middle)
        expected, other = (
            np.where(is_within, middle, expected),
            np.where(is_within, other, middle),
        )
    found = halve_brackets(passes, within, beyond, halvings)
    np.testing.assert_array_equal(found, expected)


@given(ROOTS)
def test_a_root_is_the_same_to_the_last_digit_alone_and_beside_others(
    roots: np.ndarray,
) -> None:
    def found(some: np.ndarray) -> list[float]:
        ends = np.zeros(some.size), np.ones(some.size)
        return [
            *map(
                float,
                narrow_brackets(lambda t: (some**3 - t**3, -3 * t**2), *ends).at,
            )
        ]

    assert found(roots) == [found(roots[i : i + 1])[0] for i in range(roots.size)]


@given(
    st.lists(levels, min_size=1, max_size=80),
    st.lists(st.tuples(st.integers(0, 80), levels), min_size=1, max_size=9),
)
def test_the_first_value_above_a_limit_is_the_one_that_a_walk_meets(
    values: list[int], asked: list[tuple[int, int]]
) -> None:
    start, limit = (np.array(column) for column in zip(*asked, strict=True))
    start = np.minimum(start, len(values))
    indices = find_first_above(
        np.array(values, dtype=float), start, limit.astype(float)
    )
    for at, above, index in zip(
        start.tolist(), limit.tolist(), indices.tolist(), strict=True
    ):
        assert index == next(
            (i for i in range(at, len(values)) if values[i] > above), len(values)
        )
