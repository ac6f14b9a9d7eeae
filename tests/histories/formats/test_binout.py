"""binout: every real file against independent readings, and made files of every style."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import pytest

from d2rpick.errors import FormatError
from d2rpick.histories.database import Legs
from d2rpick.histories.formats import binout
from d2rpick.histories.formats.binout import Binout, recognises
from d2rpick.histories.opening import Run, Selection
from d2rpick.histories.source import Source
from tests.made_binout import GLSTAT, LsdaWriter, Style, values
from tests.made_binout import binout as made_binout
from tests.reading import run_of
from tests.shared import shared_bytes

if TYPE_CHECKING:
    from collections.abc import Sequence

HISTORIES = "real/histories/"
R7 = "lasso-python__sph_models-R7_1_2-binout"
R12 = "lasso-python__sph_models-R12_2_1-binout"
ANSYS = "ansys-example-data__result_files-binout-binout_glstat"
PLADE = "dyna_pladebuk__Plade_300_150_4-BB-binout"


def opened(*files: LsdaWriter | bytes) -> Binout:
    contents = [bytes(file.data) if isinstance(file, LsdaWriter) else file for file in files]
    return Binout([(f"binout{i:04d}", content) for i, content in enumerate(contents)])


def expected(name: str, states: Sequence[int]) -> list[float]:
    return [values(name, state) for state in states]


# file, states, and (channel, state from 0, number) as read by lasso-python 2.0.4
REAL = [
    (
        R7,
        88,
        [
            ("time", 29, 0.011556635610759258),
            ("time", 87, 0.03478036820888519),
            ("internal_energy", 29, 2.354290008544922),
            ("internal_energy", 87, 2.3515756130218506),
            ("kinetic_energy", 29, 0.05295228958129883),
            ("kinetic_energy", 87, 0.02301497384905815),
            ("total_energy", 29, 3.2359681129455566),
            ("total_energy", 87, 3.2033164501190186),
        ],
    ),
    (
        R12,
        88,
        [
            ("time", 29, 0.011546461842954159),
            ("time", 87, 0.03475764021277428),
            ("internal_energy", 29, 2.22947359085083),
            ("internal_energy", 87, 2.214017152786255),
            ("kinetic_energy", 29, 0.04136256128549576),
            ("kinetic_energy", 87, 0.028207609429955482),
            ("total_energy", 29, 3.2737159729003906),
            ("total_energy", 87, 3.2451043128967285),
        ],
    ),
    (
        ANSYS,
        251,
        [
            ("time", 250, 0.0004991799360141158),
            ("time", 83, 0.00016450893599539995),
            ("internal_energy", 250, 1540881.25),
            ("internal_energy", 83, 39879.37109375),
            ("kinetic_energy", 250, 22700.0),
            ("kinetic_energy", 83, 2176.817626953125),
            ("total_energy", 250, 1561572.125),
            ("total_energy", 83, 41657.37109375),
        ],
    ),
    (
        PLADE,
        1,
        [
            ("time", 0, 0.0),
            ("internal_energy", 0, 2e-20),
            ("kinetic_energy", 0, 0.0),
            ("total_energy", 0, 2e-20),
        ],
    ),
]
REAL_PARTS = [
    (
        R7,
        88,
        [
            ("internal_energy", 1, 44, 0.0),
            ("internal_energy", 101, 87, 2.3515756130218506),
            ("kinetic_energy", 1, 44, 0.0),
            ("kinetic_energy", 101, 87, 0.023007895797491074),
            ("z_momentum", 1, 44, 0.0),
            ("z_momentum", 101, 87, 0.0),
        ],
    ),
    (
        R12,
        88,
        [
            ("internal_energy", 1, 44, 0.0),
            ("internal_energy", 101, 87, 2.214017152786255),
            ("kinetic_energy", 1, 44, 0.0),
            ("kinetic_energy", 101, 87, 0.028207458555698395),
            ("z_momentum", 1, 44, 0.0),
            ("z_momentum", 101, 87, 0.0),
            ("total_kinetic_energy", 1, 44, 0.0),
            ("total_kinetic_energy", 101, 87, 0.028207458555698395),
        ],
    ),
    (
        PLADE,
        1,
        [
            ("internal_energy", 1, 0, 0.0),
            ("internal_energy", 2, 0, 0.0),
            ("internal_energy", 3, 0, 0.0),
            ("kinetic_energy", 1, 0, 0.0),
            ("kinetic_energy", 2, 0, 0.0),
            ("kinetic_energy", 3, 0, 0.0),
            ("z_momentum", 1, 0, 0.0),
            ("z_momentum", 2, 0, 0.0),
            ("z_momentum", 3, 0, 0.0),
            ("total_kinetic_energy", 1, 0, 0.0),
            ("total_kinetic_energy", 2, 0, 0.0),
            ("total_kinetic_energy", 3, 0, 0.0),
        ],
    ),
]


@pytest.mark.parametrize(("file", "states", "numbers"), REAL)
def test_real_glstat_has_the_numbers_of_lasso(file: str, states: int, numbers: list[tuple[str, int, float]]) -> None:
    run = opened(shared_bytes(HISTORIES + file))
    assert run.time.shape == (states,)
    assert run.complete
    assert not run.notes
    for name, state, number in numbers:
        column = run.time if name == "time" else run.channel(name)
        assert column[state] == number


@pytest.mark.parametrize(("file", "states", "numbers"), REAL_PARTS)
def test_real_matsum_has_the_numbers_of_lasso(
    file: str, states: int, numbers: list[tuple[str, int, int, float]]
) -> None:
    run = opened(shared_bytes(HISTORIES + file))
    assert run.part_time.shape == (states,)
    for name, id_, state, number in numbers:
        assert run.part_channel(name, [id_])[state, 0] == number


@pytest.mark.parametrize("file", [R7, R12, ANSYS])
def test_real_glstat_prints_as_the_solvers_own_converter_printed_it(file: str) -> None:
    text = shared_bytes(f"{HISTORIES}{file}.l2a-glstat").decode("latin-1")
    run = opened(shared_bytes(HISTORIES + file))
    for label, column in (("time..", run.time), ("internal energy..", run.channel("internal_energy"))):
        lines = [line for line in text.splitlines() if line.startswith(f" {label}")]
        np.testing.assert_allclose(column, [float(line[32:46]) for line in lines], rtol=6e-6)


def test_titles_belong_to_ids_not_to_places() -> None:
    """R7 lists legend_ids 101, 1 beside ids 1, 101; only part 1 has a title (l2a, d3hsp)."""
    run = opened(shared_bytes(HISTORIES + R7))
    assert [(part.id, part.title) for part in run.parts] == [(1, "null shells for visualization"), (101, "")]


def test_a_real_file_without_energies_is_refused_with_what_there_is() -> None:
    with pytest.raises(FormatError, match="no glstat or matsum in it, but swforc;"):
        opened(shared_bytes(HISTORIES + "qd-cae-python__test-binout"))


def test_a_branch_that_is_missing_is_named_with_those_there_are() -> None:
    run = opened(shared_bytes(HISTORIES + ANSYS))
    with pytest.raises(FormatError, match="no matsum in it, but glstat, rwforc;"):
        _ = run.part_time


def test_half_a_real_file_keeps_the_states_of_that_half() -> None:
    whole = shared_bytes(HISTORIES + R7)
    half = opened(whole[: len(whole) // 2])
    assert half.time.tolist() == opened(whole).time[:44].tolist()
    assert not half.complete


STYLES = [
    Style(order, length, offset, command, type_id, real)
    for order, (length, offset, command, type_id), real in product(
        "<>", [(8, 8, 1, 1), (4, 4, 1, 1), (8, 4, 2, 4), (4, 8, 8, 2), (2, 4, 1, 1)], ("f4", "f8")
    )
]


@pytest.mark.parametrize("style", STYLES, ids=str)
@pytest.mark.parametrize("relative", [False, True])
@pytest.mark.parametrize("matsum_every", [1, 2, 3])
def test_any_style_gives_the_numbers_that_were_written(style: Style, relative: bool, matsum_every: int) -> None:
    states = range(1, 301)
    # 2-byte lengths cannot hold a symbol table of both branches.
    run = opened(
        made_binout(states, style=style, relative=relative, matsum_every=matsum_every, tables=style.length > 2)
    )
    assert run.complete
    assert not run.notes
    assert run.digits == {"f4": 7, "f8": 17}[style.real]
    assert run.time.tolist() == expected("time", states)
    assert run.channels == tuple(GLSTAT[1:])
    for name in run.channels:
        assert run.channel(name).tolist() == expected(name, states)
    late = [state for state in states if state % matsum_every == 0]
    assert run.part_time.tolist() == expected("time", late)
    energies = run.part_channel("internal_energy", [3, 7])
    assert energies.tolist() == [[values("internal_energy", state, id_) for id_ in (3, 7)] for state in late]


def test_metadata() -> None:
    run = opened(made_binout([1], parts=(7, 3), titles={3: "box", 9: "unused", 7: "step"}))
    assert [(part.id, part.title) for part in run.parts] == [(7, "step"), (3, "box")]
    assert (run.title, run.version) == ("made for tests", "smp s R12")


def test_numbers_of_more_digits_go_on_after_999_999() -> None:
    states = range(999_990, 1_000_010)
    made = LsdaWriter()
    for state in states:
        made.cd(f"/glstat/d{state:0{6 if state < 1_000_000 else 8}d}")
        made.put("time", [state / 4], "f8")
    assert opened(made).time.tolist() == [state / 4 for state in states]


def test_a_number_left_out_inside_a_file_says_that_records_are_lost() -> None:
    """What then seems to be one state may be made of two."""
    run = opened(made_binout([1, 2, 3, 5, 6]))
    assert not run.complete
    with pytest.raises(FormatError, match="glstat goes from state 3 to 5; records are lost or out of place"):
        run.channel("internal_energy")


def test_states_written_again_by_a_restart_replace_the_older_leg() -> None:
    run = run_of(binout, bytes(made_binout([1, 2, 3, 4, 5, 3, 4]).data))
    assert run.databases[0].time.tolist() == expected("time", [1, 2, 3, 4])
    assert "time steps back once (restart); where legs overlap the newer one counts" in run.notes[0]
    assert run.history(Selection()).energy.tolist() == expected("internal_energy", [1, 2, 3, 4])


@pytest.mark.parametrize("again", [4, 3])
def test_a_restart_that_numbers_its_states_anew_goes_on_in_time(again: int) -> None:
    """Its first state is the one after, or the same as, the last one of the leg before."""
    first, second = made_binout([1, 2, 3]), made_binout([1, 2, 3], shift=again - 1)
    (leg,) = binout.open_legs(
        [Source("binout0001", bytes(second.data)), Source("binout0000", bytes(first.data))], Selection()
    )
    run = Run(("binout*",), (Legs([leg]),))
    assert run.databases[0].complete
    assert run.history(Selection()).time.tolist() == expected("time", range(1, again + 3))
    assert run.part_energies(run.parts)[:, 1].tolist() == [
        values("internal_energy", state, 3) for state in range(1, again + 3)
    ]


def test_a_family_is_one_run() -> None:
    first, second = made_binout(range(1, 21)), made_binout(range(21, 31))
    run = opened(second, first)
    assert run.complete
    assert run.time.tolist() == expected("time", range(1, 31))
    assert run.part_channel("x_momentum", [3])[25, 0] == values("x_momentum", 26, 3)


def test_branches_may_lie_in_the_files_of_different_ranks() -> None:
    both = made_binout(range(1, 11))
    parts = made_binout(range(1, 11), glstat=False)
    run = opened(parts, b"".join([bytes(both.data)]).replace(b"matsum", b"nodout"))
    assert run.time.size == run.part_time.size == 10


def test_a_missing_member_of_a_family_is_noted() -> None:
    run = opened(made_binout(range(1, 11)), made_binout(range(21, 31)))
    assert not run.complete
    assert any("lacks the states 11 to 20" in note for note in run.notes)


def test_parts_that_change_are_read_by_id_or_refused() -> None:
    run = opened(made_binout(range(1, 13), parts_of=lambda state: (7, 3) if state < 5 else (3, 9, 7)))
    assert [part.id for part in run.parts] == [7, 3, 9]
    energies = run.part_channel("internal_energy", [3, 7])
    assert energies.tolist() == [[values("internal_energy", s, id_) for id_ in (3, 7)] for s in range(1, 13)]
    with pytest.raises(FormatError, match="part 9 is listed 0 times, not once; it is there in some states only"):
        run.part_channel("internal_energy", [9])
    with pytest.raises(FormatError, match="part 5 is listed 0 times, not once; there are 7, 3, 9"):
        run.part_channel("internal_energy", [5])


def test_another_order_of_parts_of_the_same_count_is_followed() -> None:
    run = opened(made_binout(range(1, 41), parts_of=lambda state: (7, 3) if state % 3 else (3, 7)))
    assert run.part_channel("x_momentum", [7])[:, 0].tolist() == [values("x_momentum", s, 7) for s in range(1, 41)]


def test_a_new_list_of_ids_in_the_metadata_holds_for_the_states_after_it() -> None:
    made = LsdaWriter()
    for begin, ids in ((1, (7, 3)), (4, (3, 7, 9))):
        made.cd("/matsum/metadata")
        made.put("ids", ids, "i8")
        for state in range(begin, begin + 3):
            made.cd(f"/matsum/d{state:06d}")
            made.put("time", [state], "f8")
            made.put("internal_energy", [100 * state + id_ for id_ in ids], "f8")
    run = opened(made)
    assert run.part_channel("internal_energy", [7])[:, 0].tolist() == [100 * s + 7 for s in range(1, 7)]


def test_values_that_do_not_fit_the_ids_are_refused() -> None:
    made = LsdaWriter()
    made.cd("/matsum/metadata")
    made.put("ids", [1, 2], "i4")
    for state, count in ((1, 2), (2, 3)):
        made.cd(f"/matsum/d{state:06d}")
        made.put("time", [state], "f4")
        made.put("internal_energy", range(count), "f4")
    made.table()
    with pytest.raises(FormatError, match="state 2: 3 values of internal_energy where 1, 2 would fit"):
        opened(made).part_channel("internal_energy", [1])


def test_a_variable_that_appears_late_is_no_channel() -> None:
    made = LsdaWriter()
    for state in range(1, 6):
        made.cd(f"/glstat/d{state:06d}")
        made.put("time", [state], "f4")
        made.put("internal_energy", [state * 2], "f4")
        if state > 3:
            made.put("added_mass", [state], "f4")
    made.table()
    run = opened(made)
    assert run.channels == ("internal_energy",)
    assert run.channel("internal_energy").tolist() == [2, 4, 6, 8, 10]
    assert any("added_mass in some states only" in note for note in run.notes)
    with pytest.raises(FormatError, match="state 1: no added_mass, only time, internal_energy"):
        run.channel("added_mass")


def test_no_states_is_a_legal_file() -> None:
    run = opened(made_binout([]))
    assert run.time.size == run.part_time.size == 0
    assert any("holds no state yet" in note for note in run.notes)


@pytest.mark.parametrize("head", [b"", b"\x08", b"$ LS-DYNA", bytes([8, 8, 8, 1, 1, 1, 3, 0])])
def test_something_else_is_not_recognised_and_refused(head: bytes) -> None:
    assert not recognises(head)
    with pytest.raises(FormatError, match="the header of a binout was expected"):
        opened(head)
