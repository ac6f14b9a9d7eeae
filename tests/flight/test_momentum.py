"""Flights found from momenta, for motions in known pieces and for runs computed by a solver."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import pytest
from hypothesis import example, given, strategies as st

import d2rpick as d2
from d2rpick.base.errors import FormatError
from d2rpick.choice.answers import suggest_in_run
from d2rpick.choice.pair.grades import DO_NOT_USE
from d2rpick.choice.question import Settings
from d2rpick.flight.momentum import (
    _refine_attached_parts,
    find_all_flights,
    find_flight_around,
    find_flight_of,
    find_flying_parts,
    list_deformable_parts,
    replace_words_by_part_ids,
)
from d2rpick.flight.window import FreeFlight
from d2rpick.histories.history import EXACT, Momenta, Precision, Samples
from d2rpick.histories.names import Part
from d2rpick.histories.opening import OpenedRun, Selection, open_run
from tests.command import BOX, ENERGY, GLSTAT, read_refusal, run, run_json
from tests.computed import locate_stored
from tests.energies import require
from tests.reading import read, read_solved
from tests.records import round_as_printed
from tests.written_runs import Written, as_momenta, as_momenta_alone, as_t01

PARTS = (Part(1, "box"), Part(2, "step"), Part(3, "sled"))
MASSES = np.array([300.0, 78.0])
SPEED = 7.0
END = 0.4
TD = 0.25


class Piece(NamedTuple):
    """External ``force`` (3,) on both bodies together from ``begin`` on, besides weight and damping."""

    begin: float
    force: tuple[float, float, float]


def compute_total_momentum(
    time: Samples, pieces: Sequence[Piece], alpha: float, gravity: float
) -> Samples:
    """Return the momentum of both bodies, (n, 3), by p' = f + m g - alpha p with f constant in each piece, exactly."""
    mass = MASSES.sum()
    p = np.zeros((time.size, 3))
    momentum = np.array([mass * SPEED, 0.0, 0.0])
    ends = [piece.begin for piece in pieces[1:]] + [np.inf]
    for piece, end in zip(pieces, ends, strict=True):
        rate = (
            np.array(piece.force)
            - np.array([0.0, 0.0, mass * gravity])
            - alpha * momentum
        )
        inside = (time >= piece.begin) & (time < end)
        p[inside] = (
            momentum + _integrate_decay(time[inside] - piece.begin, alpha) * rate
        )
        momentum = (
            momentum
            + (
                _integrate_decay(np.array([end - piece.begin]), alpha)[0]
                if np.isfinite(end)
                else 0.0
            )
            * rate
        )
    return p


def _integrate_decay(span: Samples, alpha: float) -> Samples:
    """Return the integral of exp(-alpha t) over ``span``, shape (n, 1)."""
    return np.asarray(span if alpha == 0 else -np.expm1(-alpha * span) / alpha)[
        :, np.newaxis
    ]


def make_momenta_in_flight(
    pieces: Sequence[Piece], *, alpha: float = 0.0, gravity: float = 9.81, states: int = 1000, frequency: float = 60.0,
    share: float = 0.1, digits: int = 17, sled: float = 0.0,
) -> Momenta:  # fmt: skip
    """Return momenta of a box and a step vibrating against each other, and of a sled that stops at 0.08 (if ``sled``).

    ``share`` is the amplitude of the momentum they exchange, relative to their total; ``sled`` is its initial momentum.
    """
    time = np.linspace(0, END, states)
    p = (
        compute_total_momentum(time, pieces, alpha, gravity)[:, np.newaxis]
        * (MASSES / MASSES.sum())[:, np.newaxis]
    )
    phases = 2 * np.pi * frequency * time[:, np.newaxis] + np.array([0.3, 1.9, 4.0])
    exchanged = (
        share
        * MASSES.sum()
        * SPEED
        * np.exp(-alpha / 2 * time)[:, np.newaxis]
        * np.cos(phases)
    )
    p[:, 0] += exchanged
    p[:, 1] -= exchanged
    if sled:
        driven = np.zeros((states, 1, 3))
        driven[:, 0, 0] = sled * np.maximum(0, 1 - time / 0.08)
        p = np.concatenate([p, driven], axis=1)
    if digits < EXACT.digits:
        p = round_as_printed(p.ravel(), digits).reshape(p.shape)
    masses = np.array([*MASSES, 50.0])[: p.shape[1]]
    return Momenta(
        time, p, PARTS[: p.shape[1]], Precision(digits), chosen=(0,), masses=masses
    )


def list_trip_pieces(start: float = 0.08, end: float = 0.33) -> list[Piece]:
    """Return a load until ``start``, flight, and a contact from ``end`` on."""
    weight = MASSES.sum() * 9.81
    load = MASSES.sum() * SPEED / start
    return [
        Piece(0.0, (-0.4 * load, 0.1 * load, 0.3 * load)),
        Piece(start, (0, 0, 0)),
        Piece(end, (-weight, 0, 3 * weight)),
    ]


def list_pulse_pieces(begin: float, end: float, force: float) -> list[Piece]:
    """Return a force in x and z that changes four times and ends; a constant force would look like gravity."""
    levels = np.array([1.0, 2.0, 1.5, 0.7])
    times = np.linspace(begin, end, 5)
    return [
        Piece(t, (f, 0.0, f))
        for t, f in zip(times.tolist(), [*(force * levels).tolist(), 0.0], strict=True)
    ]


def keep_box_alone(momenta: Momenta) -> Momenta:
    """Return the same run with the box only."""
    assert momenta.parts
    return replace(
        momenta,
        values=momenta.values[:, :1],
        parts=momenta.parts[:1],
        masses=MASSES[:1],
    )


def smooth(seed: int, waves: int, digits: int) -> Momenta:
    """Return a load that never ends: the momentum of one body as a sum of random waves."""
    random = np.random.default_rng(seed)
    time = np.linspace(0, 1, 1000)
    turns = np.arange(1, waves + 1) * random.uniform(0.7, 1, waves)
    phases = 2 * np.pi * np.outer(time, turns) + random.uniform(0, 2 * np.pi, waves)
    values = np.zeros((1000, 1, 3))
    values[:, 0, 0] = round_as_printed(
        np.sin(phases) @ random.normal(size=waves), digits
    )
    return Momenta(time, values, None, Precision(digits), chosen=(0,))


# Motions made up of pieces.


@pytest.mark.parametrize("speed", [3.0, 30.0])
def test_a_fall_is_found_if_its_times_have_as_few_digits_as_its_momenta(
    speed: float,
) -> None:
    # In milliseconds: the load ends at 20, and an interval of 0.13 is printed as 0.1 or 0.2 after 100.
    mass, gravity, load_end = 1000.0, 9.81e-6, 20.0
    time = np.linspace(0.0, 240.0, 1866)
    push = 1e-3 * speed * np.minimum(time / load_end, 1.0) ** 2
    velocity = np.stack([push, np.full(time.shape, 4e-3), -gravity * time], axis=1)
    momenta = Momenta(
        round_as_printed(time, 4),
        round_as_printed(mass * velocity.ravel(), 4).reshape(-1, 1, 3),
        None,
        Precision(4),
        chosen=(0,),
        masses=np.array([mass]),
    )
    flight = require(find_flight_around(momenta, 150.0))
    assert flight.start == pytest.approx(load_end, abs=0.5)
    assert flight.end == momenta.time[-1]
    assert flight.gravity == pytest.approx(gravity, rel=2e-3)


@pytest.mark.slow
@given(
    start=st.floats(0.04, 0.16),
    end=st.floats(0.26, 0.36),
    td=st.floats(0.17, 0.25),
    alpha=st.one_of(st.just(0.0), st.floats(0.1, 40.0)),
    frequency=st.floats(15.0, 300.0),
    share=st.floats(0.02, 0.5),
    states=st.integers(300, 3000),
    digits=st.sampled_from([5, 9, 17]),
)
@example(
    start=0.14011739398298903,
    end=0.2931144208152928,
    td=0.1875,
    alpha=0.125,
    frequency=15.0,
    share=0.5,
    states=387,
    digits=9,
)  # the first state of the contact is exactly within the tolerance
def test_the_flight_of_two_bodies_is_found_to_a_few_states_whatever_they_exchange(
    *,
    start: float,
    end: float,
    td: float,
    alpha: float,
    frequency: float,
    share: float,
    states: int,
    digits: int,
) -> None:
    momenta = make_momenta_in_flight(
        list_trip_pieces(start, end), alpha=alpha, frequency=frequency, share=share, states=states, digits=digits
    )  # fmt: skip
    flight = require(find_flight_around(momenta, td))
    assert flight.parts == PARTS[:2]
    # In these times, the forces change the momentum by 0.2 % of its range.
    load, contact = 5e-3 * start, 5e-4
    tolerance = 3 * END / (states - 1)
    assert flight.start == pytest.approx(start, abs=tolerance + load)
    assert flight.end == pytest.approx(end, abs=tolerance + contact)
    assert flight.end_seen


@given(
    td=st.floats(0.1, 0.32),
    frequency=st.floats(20.0, 300.0),
    share=st.floats(0.05, 0.5),
    digits=st.sampled_from([5, 17]),
)
def test_a_part_alone_does_not_fly_while_another_is_attached(
    td: float, frequency: float, share: float, digits: int
) -> None:
    momenta = make_momenta_in_flight(
        list_trip_pieces(), frequency=frequency, share=share, digits=digits, alpha=1.0
    )
    assert find_flight_of(momenta, (0,), td) is None
    assert find_flight_around(keep_box_alone(momenta), td) is None


@pytest.mark.slow
def test_a_load_that_never_ends_has_hardly_ever_a_moment_that_passes_for_flight() -> (
    None
):
    tried = [
        find_flight_around(smooth(seed, waves, digits), td)
        for waves in (1, 2, 3, 5, 10)
        for seed in range(4)
        for digits in (5, 17)
        for td in np.linspace(0.05, 0.95, 10)
    ]
    assert sum(flight is not None for flight in tried) <= 0.01 * len(tried)


@pytest.mark.parametrize("sled", [1e3, 1e5])
def test_a_driven_sled_that_stops_is_not_counted_with_the_parts_that_fly(
    sled: float,
) -> None:
    momenta = make_momenta_in_flight(list_trip_pieces(), sled=sled)
    assert find_flight_around(momenta, TD) == find_flight_around(
        make_momenta_in_flight(list_trip_pieces()), TD
    )


def test_the_set_that_flies_together_can_be_named() -> None:
    momenta_of_set = replace(
        make_momenta_in_flight(list_trip_pieces(), sled=1e3), flying=(0, 1)
    )
    flight = require(find_flight_around(momenta_of_set, TD))
    assert flight.parts == PARTS[:2]
    assert find_flight_around(replace(momenta_of_set, flying=(0,)), TD) is None
    assert (
        find_flight_around(replace(momenta_of_set, flying=(0, 1, 2)), TD) is None
    )  # a body at rest does not fall with the others


def test_attached_parts_are_found_among_many() -> None:
    pair = make_momenta_in_flight(list_trip_pieces(), share=0.2)
    other_parts = np.zeros((pair.time.size, 30, 3))
    other_parts[:, :, 1] = np.cumsum(
        np.random.default_rng(3).normal(size=(pair.time.size, 30)), axis=0
    )
    values = np.concatenate(
        [other_parts[:, :15], pair.values, other_parts[:, 15:]], axis=1
    )
    parts = tuple(Part(number, f"part {number}") for number in range(1, 33))
    masses = np.array([*np.ones(15), *MASSES, *np.ones(15)])
    flight = require(
        find_flight_around(
            Momenta(pair.time, values, parts, EXACT, chosen=(15,), masses=masses), TD
        )
    )
    assert flight.parts == (parts[15], parts[16])


def test_a_part_of_next_to_no_mass_is_not_put_in_and_out_for_ever() -> None:
    """Rounding decides whether such a part makes a sum smaller."""
    for seed in range(100):
        rests = np.random.default_rng(seed).normal(size=(3, 150)) * [
            [1.0],
            [1e-20],
            [0.0],
        ]
        rests[2] = -rests[1]
        assert 0 not in _refine_attached_parts(rests, {0}, [0], [0, 1, 2])


def test_all_flights_of_a_run_are_listed_and_the_one_around_td_is_taken() -> None:
    momenta = make_momenta_in_flight(
        [
            *list_pulse_pieces(0.0, 0.06, -4e3),
            *list_pulse_pieces(0.18, 0.20, 9e4),
            *list_pulse_pieces(0.30, 0.33, 4e4),
        ]
    )
    flights = find_all_flights(momenta)
    expected = [(0.06, 0.18), (0.20, 0.30), (0.33, END)]
    np.testing.assert_allclose(
        [(f.start, f.end) for f in flights], expected, atol=1.5e-3
    )
    assert [f.end_seen for f in flights] == [True, True, False]
    assert all(
        earlier_flight.end <= next_one.start
        for earlier_flight, next_one in pairwise(flights)
    )
    for flight in flights:
        around = require(find_flight_around(momenta, (flight.start + flight.end) / 2))
        assert (around.start, around.end) == pytest.approx(
            (flight.start, flight.end), abs=1e-3
        )


RESTING = replace(
    make_momenta_in_flight(list_trip_pieces()),
    values=0 * make_momenta_in_flight(list_trip_pieces()).values,
)
BEFORE_AND_AFTER = make_momenta_in_flight(
    [*list_pulse_pieces(0.0, 0.06, -2e4), *list_pulse_pieces(0.33, 0.37, 5e4)]
)


@pytest.mark.parametrize(
    ("momenta", "td"),
    [
        *(
            (BEFORE_AND_AFTER, td) for td in (0.03, 0.35)
        ),  # before the end of the load, and in the contact
        *(
            (make_momenta_in_flight(list_trip_pieces()), td) for td in (-0.1, END + 0.1)
        ),  # outside the record
        (RESTING, TD),
    ],
)
def test_there_is_no_flight_around_a_td_under_force_outside_the_record_or_at_rest(
    momenta: Momenta, td: float
) -> None:
    assert find_flight_around(momenta, td) is None


@pytest.mark.parametrize("digits", [5, 17])
def test_a_momentum_that_never_changes_tells_of_flight_throughout(digits: int) -> None:
    free = make_momenta_in_flight([Piece(0.0, (0, 0, 0))], gravity=0.0, digits=digits)
    assert find_flight_around(free, TD) == FreeFlight(
        0.0, END, PARTS[:2], end_seen=False
    )


def test_a_body_that_was_braked_to_rest_does_not_fly() -> None:
    """Its momentum is constant but zero."""
    light = make_momenta_in_flight(list_trip_pieces())
    braked = np.zeros((light.time.size, 1, 3))
    braked[:, 0, 0] = np.where(
        light.time < 0.1, 50 + 50 * np.cos(np.pi * light.time / 0.1), 0.0
    )
    momenta = Momenta(
        light.time,
        round_as_printed(braked.ravel(), 5).reshape(braked.shape),
        PARTS[:1],
        Precision(5),
        (0,),
    )
    assert find_flight_around(momenta, TD) is None
    assert find_flight_around(replace(momenta, values=momenta.values + 5.0), TD)


def test_a_load_may_hide_behind_the_coarse_digits_of_a_heavy_part() -> None:
    light = make_momenta_in_flight(list_trip_pieces(), digits=5)
    train = np.broadcast_to([1.2345e9, 0.0, 0.0], (light.time.size, 1, 3))
    values, masses = (
        np.concatenate([light.values, train], axis=1),
        np.array([*MASSES, 1e8]),
    )
    heavy = replace(light, values=values, parts=PARTS, flying=(0, 1, 2), masses=masses)
    assert find_flight_around(heavy, TD) is None


def test_digits_that_do_not_resolve_a_thousandth_of_the_change_tell_nothing() -> None:
    pieces = [
        Piece(0.0, (-2e3, 0, 0)),
        Piece(0.08, (0, 0, 0)),
        Piece(0.33, (2e3, 0, 0)),
    ]
    assert find_flight_around(
        make_momenta_in_flight(pieces, gravity=0.0, digits=17), TD
    )
    assert (
        find_flight_around(make_momenta_in_flight(pieces, gravity=0.0, digits=4), TD)
        is None
    )


# Runs that a solver computed.


def test_on_the_rollover_the_box_alone_does_not_fly() -> None:
    run = read([BOX]).run
    (momenta,) = (
        momenta_of_run
        for momenta_of_run in run.momenta(run.parts[:1], None)
        if momenta_of_run.parts
    )
    assert [find_flight_of(momenta, (0,), td) for td in np.linspace(0.1, 0.38, 15)] == [
        None
    ] * 15


def test_masses_that_are_no_parts_fly_by_the_momentum_of_the_whole_model() -> None:
    suggestion = run_json(
        "suggest",
        "--td",
        "0.238",
        "--part",
        "1-2",
        locate_stored("chain_referenceT01.gz"),
    )
    assert suggestion["flight"] == {
        "start": 0.0,
        "end": None,
        "source": "momentum",
        "certain": True,
        "parts": None,
    }


@pytest.mark.parametrize(("run", "start"), [("L1", 0.0200), ("L3", 0.0235)])
def test_a_flight_after_a_computed_load_begins_when_the_load_is_over(
    run: str, start: float
) -> None:
    table = np.genfromtxt(
        locate_stored(f"load_{run}_ref.csv.gz"), delimiter=",", names=True
    )
    values = np.zeros((table.size, 1, 3))
    values[:, 0, 0] = table["momentum_x_solver"]
    flight = require(
        find_flight_around(
            Momenta(table["time_s"], values, None, Precision(7), chosen=(0,)), 0.1
        )
    )
    assert flight.start == pytest.approx(start, abs=1e-4)
    assert not flight.end_seen


def list_titles(run_with_momenta: OpenedRun, *, flying: bool) -> set[str]:
    return {
        part.title
        for part in (
            find_flying_parts(run_with_momenta)
            if flying
            else list_deformable_parts(run_with_momenta)
        )
    }


def test_the_box_and_the_step_on_it_fly_and_the_sled_does_not() -> None:
    assert list_titles(read([BOX]).run, flying=True) == {"box", "step"}
    suggestion = run_json("suggest", "--part", "flying", "--td", "0.37", BOX)
    assert (
        suggestion["history"]["parts"]
        == run_json("suggest", "--part", "1,2", "--td", "0.37", BOX)["history"]["parts"]
    )
    assert (
        suggestion["recommended"]
        == run_json("suggest", "--part", "1,2", "--td", "0.37", BOX)["recommended"]
    )


def test_all_parts_of_the_car_fly_but_the_ground() -> None:
    car = read_solved("carT01.gz").run
    everything = list_titles(car, flying=False)
    assert "ground" not in everything
    assert len(everything) == 17
    assert list_titles(car, flying=True) == everything


def test_words_may_stand_beside_numbers_and_are_read_once() -> None:
    selection = replace_words_by_part_ids(
        read([BOX]).run, Selection(parts=("box", "FLYING"))
    )
    assert selection.parts == ("box", "1", "2")


@pytest.mark.parametrize("word", ["flying", "all"])
def test_files_without_parts_say_so(word: str) -> None:
    for name in (ENERGY, GLSTAT):
        assert "parts" in read_refusal("suggest", "--part", word, "--td", "0.06", name)


def test_a_table_has_no_parts_that_could_fly() -> None:
    table = pd.DataFrame({"time": [0.0, 1.0, 2.0], "internal_energy": [0.0, 4.0, 1.0]})
    with pytest.raises(FormatError, match="no parts"):
        find_flying_parts(d2.from_frame(table).files)


@pytest.mark.usefixtures("by_level")
def test_every_command_takes_the_words() -> None:
    for command in (("info",), ("plan",), ("verify", "--tr", "0.1", "--td", "0.37")):
        assert run(*command, "-q", "--part", "flying", BOX).exit_code in (0, 1)
    assert (
        "part_2"
        in run(
            "extract", "-q", "--part", "all", BOX, "--write-as", "csv", "-o", "-"
        ).stdout
    )


def make_car_on_curb() -> Written:
    """Return a body of 280 that flies for 20 % of the record; two wheels of 15 fly twice as long, then slide."""
    time = np.linspace(0.0, 1.0, 501)
    masses = np.array([100.0, 60.0, 40.0, 80.0, 15.0, 15.0])
    lifted = np.where(
        time < 0.55,
        12 + 8 * np.sin(70 * time) * np.minimum(1, (0.55 - time) / 0.02),
        0.0,
    )
    struck = np.where(time > 0.75, 107 * np.sin(np.pi * (time - 0.75) / 0.3), 0.0)
    momentum = np.zeros((time.size, 6, 2))
    impulse = np.concatenate([[0.0], np.cumsum((lifted + struck)[1:] - 9.81) * time[1]])
    momentum[:, :4, 1] = masses[:4] * impulse[:, np.newaxis]
    ringing = 30 * np.sin(300 * time) * np.exp(-20 * np.abs(time - 0.55))
    momentum[:, :4, 1] += ringing[:, np.newaxis] * np.array([1.0, -0.5, -0.8, 0.3])
    momentum[:, :4, 0] = 8 * masses[:4]
    for wheel, (start, end) in ((4, (60.0, 333.0)), (5, (46.0, 267.0))):
        pushed = start * np.minimum(time, 0.1) + end * np.maximum(time - 0.5, 0.0)
        momentum[:, wheel] = masses[wheel] * np.stack(
            [0 * time + 9, pushed - 9.81 * time], axis=1
        )
    energy = (momentum**2).sum(axis=2) / (2 * masses)
    return Written(
        time,
        momentum,
        energy,
        1 + ringing[:, np.newaxis] ** 2 * np.ones(6),
        0 * time,
        masses,
        0 * time,
    )


def test_the_body_that_matters_is_named_where_loose_wheels_fly_longer(
    tmp_path: Path,
) -> None:
    momenta_of_car = make_car_on_curb()
    assert [
        part.id
        for part in find_flying_parts(
            open_run([as_t01(momenta_of_car, tmp_path)], Selection())
        )
    ] == [1, 2, 3, 4]


@pytest.mark.parametrize("write", [as_momenta, as_momenta_alone])
@pytest.mark.parametrize("kinetic", [True, False])
def test_the_momentum_of_body_and_wheels_together_shows_no_flight_while_wheels_are_pushed(
    tmp_path: Path, write: Callable[..., str], kinetic: bool
) -> None:
    """The wheels are pushed throughout; the body without them flies from 0.55 to 0.75."""
    momenta_of_car = make_car_on_curb()
    body = momenta_of_car._replace(
        momentum=momenta_of_car.momentum[:, :4],
        kinetic=momenta_of_car.kinetic[:, :4],
        internal=momenta_of_car.internal[:, :4],
        masses=momenta_of_car.masses[:4],
    )
    for car, flies in ((momenta_of_car, False), (body, True)):
        reference = read([write(car, tmp_path, kinetic=kinetic)])
        (momenta,) = reference.history.momenta
        flight = find_flight_around(momenta, 0.65, reference.history.balance)
        if flies:
            assert flight
        else:  # without mass and kinetic energy, gravity cannot be told from a push
            assert flight is None or np.isnan(flight.gravity)
        for td in np.linspace(0.15, 0.95, 9).tolist():
            if not flies:
                decision = suggest_in_run(reference, td, Settings()).decision
                assert decision is None or decision.verdict == DO_NOT_USE
