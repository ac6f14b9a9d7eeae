"""binout: made-up files in every form of the format."""

from collections.abc import Sequence
from itertools import product
from pathlib import Path

import pytest

from d2rpick.base.errors import FormatError
from d2rpick.histories.database import Legs
from d2rpick.histories.formats import binout
from d2rpick.histories.formats.binout import Binout, recognises
from d2rpick.histories.opening import OpenedRun, Selection, open_run
from d2rpick.histories.source import Source
from tests.made_binout import (
    GLSTAT,
    LsdaWriter,
    Style,
    compute_value,
    make_binout as made_binout,
)
from tests.reading import open_contents

STYLES = [
    Style(order, length, offset, command, type_id, real)
    for order, (length, offset, command, type_id), real in product(
        "<>",
        [(8, 8, 1, 1), (4, 4, 1, 1), (8, 4, 2, 4), (4, 8, 8, 2), (2, 4, 1, 1)],
        ("f4", "f8"),
    )
]


def open_binout(*files: LsdaWriter | bytes) -> Binout:
    contents = [
        bytes(file.data) if isinstance(file, LsdaWriter) else file for file in files
    ]
    return Binout([(f"binout{i:04d}", content) for i, content in enumerate(contents)])


def expected(name: str, states: Sequence[int]) -> list[float]:
    return [compute_value(name, state) for state in states]


@pytest.mark.parametrize("style", STYLES, ids=str)
@pytest.mark.parametrize("relative", [False, True])
@pytest.mark.parametrize("matsum_every", [1, 3])
def test_any_style_gives_the_numbers_that_were_written(
    style: Style, relative: bool, matsum_every: int
) -> None:
    states = range(1, 13)
    # 2-byte lengths cannot hold a symbol table of both branches.
    run = open_binout(
        made_binout(
            states,
            style=style,
            relative=relative,
            matsum_every=matsum_every,
            tables=style.length > 2,
        )
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
    assert energies.tolist() == [
        [compute_value("internal_energy", state, id_) for id_ in (3, 7)]
        for state in late
    ]


def test_a_branch_that_is_written_seldom_keeps_its_states() -> None:
    """Between two states of one branch, states of the other branch repeat."""
    run = open_binout(made_binout(range(1, 301), matsum_every=100))
    assert run.time.tolist() == expected("time", range(1, 301))
    assert run.part_time.tolist() == expected("time", (100, 200, 300))


def test_metadata() -> None:
    run = open_binout(
        made_binout([1], parts=(7, 3), titles={3: "box", 9: "unused", 7: "step"})
    )
    assert [(part.id, part.title) for part in run.parts] == [(7, "step"), (3, "box")]
    assert (run.title, run.version) == ("made for tests", "smp s R12")


def test_numbers_of_more_digits_go_on_after_999_999() -> None:
    states = range(999_990, 1_000_010)
    writer = LsdaWriter()
    for state in states:
        writer.cd(f"/glstat/d{state:0{6 if state < 1_000_000 else 8}d}")
        writer.put("time", [state / 4], "f8")
    assert open_binout(writer).time.tolist() == [state / 4 for state in states]


def test_a_number_left_out_inside_a_file_says_that_records_are_lost() -> None:
    """What looks like one state may then consist of two."""
    run = open_binout(made_binout([1, 2, 3, 5, 6]))
    assert not run.complete
    with pytest.raises(
        FormatError,
        match="glstat goes from state 3 to 5; records are lost or out of place",
    ):
        run.channel("internal_energy")


def test_states_written_again_by_a_restart_replace_the_older_leg() -> None:
    run = open_contents(binout, bytes(made_binout([1, 2, 3, 4, 5, 3, 4]).data))
    assert run.databases[0].time.tolist() == expected("time", [1, 2, 3, 4])
    assert (
        "time steps back once, from 0.625 to 0.375 (restart); the newer restart segment is used where they overlap"
        in run.notes[0]
    )
    assert run.history(Selection()).energy.tolist() == expected(
        "internal_energy", [1, 2, 3, 4]
    )


@pytest.mark.parametrize("again", [4, 3])
def test_a_restart_that_numbers_its_states_anew_goes_on_in_time(again: int) -> None:
    """The first state of a leg is the last state of the previous leg, or the one after it."""
    first, second = made_binout([1, 2, 3]), made_binout([1, 2, 3], shift=again - 1)
    (leg,) = binout.open_legs(
        [
            Source("binout0001", bytes(second.data)),
            Source("binout0000", bytes(first.data)),
        ],
        Selection(),
    )
    run = OpenedRun(("binout*",), (Legs([leg]),))
    assert run.databases[0].complete
    assert run.history(Selection()).time.tolist() == expected(
        "time", range(1, again + 3)
    )
    assert run.part_energies(run.parts)[:, 1].tolist() == [
        compute_value("internal_energy", state, 3) for state in range(1, again + 3)
    ]


def test_a_family_is_one_run() -> None:
    first, second = made_binout(range(1, 21)), made_binout(range(21, 31))
    run = open_binout(second, first)
    assert run.complete
    assert run.time.tolist() == expected("time", range(1, 31))
    assert run.part_channel("x_momentum", [3])[25, 0] == compute_value(
        "x_momentum", 26, 3
    )


def test_branches_that_the_ranks_of_an_mpp_run_write_apart_are_one_run(
    tmp_path: Path,
) -> None:
    states = range(1, 21)
    whole_only = made_binout(states, matsum_every=1000)
    parts_only = made_binout(states, glstat=False)
    (tmp_path / "binout0000").write_bytes(whole_only.data)
    (tmp_path / "binout0003").write_bytes(parts_only.data)
    run = open_run([str(tmp_path)])
    assert run.history(Selection()).energy.tolist() == expected(
        "internal_energy", states
    )
    assert [part.id for part in run.parts] == [7, 3]
    assert run.part_energies(run.parts)[:, 0].tolist() == [
        compute_value("internal_energy", state, 7) for state in states
    ]


def test_a_missing_member_of_a_family_is_noted() -> None:
    run = open_binout(made_binout(range(1, 11)), made_binout(range(21, 31)))
    assert not run.complete
    assert any("lacks the states 11 to 20" in note for note in run.notes)


def test_parts_that_change_are_read_by_id_or_refused() -> None:
    run = open_binout(
        made_binout(
            range(1, 13), parts_of=lambda state: (7, 3) if state < 5 else (3, 9, 7)
        )
    )
    assert [part.id for part in run.parts] == [7, 3, 9]
    energies = run.part_channel("internal_energy", [3, 7])
    assert energies.tolist() == [
        [compute_value("internal_energy", s, id_) for id_ in (3, 7)]
        for s in range(1, 13)
    ]
    with pytest.raises(
        FormatError,
        match="part 9 is listed 0 times, not once; it is there in some states only",
    ):
        run.part_channel("internal_energy", [9])
    with pytest.raises(
        FormatError, match="part 5 is listed 0 times, not once; there are 7, 3, 9"
    ):
        run.part_channel("internal_energy", [5])


def test_another_order_of_parts_of_the_same_count_is_followed() -> None:
    run = open_binout(
        made_binout(
            range(1, 41), parts_of=lambda state: (7, 3) if state % 3 else (3, 7)
        )
    )
    assert run.part_channel("x_momentum", [7])[:, 0].tolist() == [
        compute_value("x_momentum", s, 7) for s in range(1, 41)
    ]


def test_a_new_list_of_ids_in_the_metadata_holds_for_the_states_after_it() -> None:
    writer = LsdaWriter()
    for begin, ids in ((1, (7, 3)), (4, (3, 7, 9))):
        writer.cd("/matsum/metadata")
        writer.put("ids", ids, "i8")
        for state in range(begin, begin + 3):
            writer.cd(f"/matsum/d{state:06d}")
            writer.put("time", [state], "f8")
            writer.put("internal_energy", [100 * state + id_ for id_ in ids], "f8")
    run = open_binout(writer)
    assert run.part_channel("internal_energy", [7])[:, 0].tolist() == [
        100 * s + 7 for s in range(1, 7)
    ]


def test_values_that_do_not_fit_the_ids_are_refused() -> None:
    writer = LsdaWriter()
    writer.cd("/matsum/metadata")
    writer.put("ids", [1, 2], "i4")
    for state, count in ((1, 2), (2, 3)):
        writer.cd(f"/matsum/d{state:06d}")
        writer.put("time", [state], "f4")
        writer.put("internal_energy", range(count), "f4")
    writer.table()
    with pytest.raises(
        FormatError, match="state 2: 3 values of internal_energy where 1, 2 would fit"
    ):
        open_binout(writer).part_channel("internal_energy", [1])


def test_a_variable_that_appears_late_is_no_channel() -> None:
    writer = LsdaWriter()
    for state in range(1, 6):
        writer.cd(f"/glstat/d{state:06d}")
        writer.put("time", [state], "f4")
        writer.put("internal_energy", [state * 2], "f4")
        if state > 3:
            writer.put("added_mass", [state], "f4")
    writer.table()
    run = open_binout(writer)
    assert run.channels == ("internal_energy",)
    assert run.channel("internal_energy").tolist() == [2, 4, 6, 8, 10]
    assert any("added_mass in some states only" in note for note in run.notes)
    with pytest.raises(
        FormatError, match="state 1: no added_mass, only time, internal_energy"
    ):
        run.channel("added_mass")


@pytest.mark.parametrize("code", [1, 2, 3, 5, 6, 7])  # integers of up to four bytes
def test_times_of_another_type_are_refused(code: int) -> None:
    data = bytes(made_binout(range(1, 4)).data)
    whole = b"\x09\x04time"  # type, length of the name, name
    assert whole in data
    run = open_binout(data.replace(whole, bytes([code]) + whole[1:]))
    with pytest.raises(FormatError, match=r"time is stored as u?int"):
        run.branch("glstat").channel("time")


def test_no_states_is_a_legal_file() -> None:
    run = open_binout(made_binout([]))
    assert run.time.size == run.part_time.size == 0
    assert any("has no state yet" in note for note in run.notes)


@pytest.mark.parametrize(
    "head", [b"", b"\x08", b"$ LS-DYNA", bytes([8, 8, 8, 1, 1, 1, 3, 0])]
)
def test_something_else_is_not_recognised_and_refused(head: bytes) -> None:
    assert not recognises(head)
    with pytest.raises(FormatError, match="this is not a binout"):
        open_binout(head)
