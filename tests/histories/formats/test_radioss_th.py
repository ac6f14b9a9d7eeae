"""Radioss T01, binary and text: computed runs compared with other readers, made-up files of every age, damaged text."""

from collections.abc import Callable

import numpy as np
import pytest

from d2rpick.base.errors import D2RPickError, FormatError
from d2rpick.histories.formats import csv_table, radioss_th
from d2rpick.histories.formats.radioss_th import TimeHistory, recognises
from d2rpick.histories.opening import Selection
from d2rpick.histories.source import Source
from tests.command import BOX, ROLLOVER
from tests.computed import locate_stored, read_unpacked
from tests.damaged_files import FILES, printed
from tests.energies import require
from tests.made_t01 import (
    MadePart,
    T01TextWriter,
    T01Writer,
    make_t01,
    make_value,
    pack_numbers,
    write_head,
)
from tests.reading import open_contents

SMALL = FILES["T01 as text"]
FORMS: dict[str, Callable[[], T01Writer]] = {
    "binary": T01Writer,
    "text": T01TextWriter,
    "text of another system": lambda: T01TextWriter(line_end=b"\r\n"),
}

CODED = "runT01\n00000318a title\nWed Apr 10 13:20:15 2024 RADIOSS Open\n0000000A0000000MZZZZZEOR\n"


def open_history(source: T01Writer | bytes) -> TimeHistory:
    return TimeHistory(
        bytes(source.data) if isinstance(source, T01Writer) else source, "runT01"
    )


@pytest.mark.parametrize("globals_", [0, 12, 16, 22, 25])
@pytest.mark.parametrize(
    ("code", "title"), [(3040, 40), (3041, 80), (3050, 80), (4021, 100)]
)
@pytest.mark.parametrize("into", FORMS.values(), ids=FORMS.keys())
def test_any_age_and_form_of_the_format(
    into: Callable[[], T01Writer], code: int, title: int, globals_: int
) -> None:
    parts = [
        MadePart(3, "box", material=123456),
        MadePart(12, "step"),
        MadePart(3, "half a box", is_group=True),
    ]
    writer = make_t01(
        5, parts, globals_=globals_, code=code, title=title, writer=into()
    )
    written = printed if isinstance(writer, T01TextWriter) else float
    assert recognises(bytes(writer.data)[:300])
    run = open_history(writer)
    assert (run.complete, run.notes) == (True, ())
    assert run.time.tolist() == [state / 8 for state in range(5)]
    assert (run.title, run.version) == (
        "made for tests",
        "Fri Nov 20 23:34:18 2026 RADIOSS OpenRadioss, linuxa64 gf",
    )
    assert [(part.id, part.title) for part in run.parts] == [(3, "box"), (12, "step")]
    assert len(run.channels) == globals_
    for number, name in enumerate(run.channels, start=1):
        assert run.channel(name).tolist() == [
            written(make_value(state, 0, number)) for state in range(5)
        ]
    for number, name in (
        (1, "internal_energy"),
        (5, "z_momentum"),
        (7, "hourglass_energy"),
    ):
        expected = [
            [written(make_value(s, id_, number)) for id_ in (12, 3)] for s in range(5)
        ]
        assert run.part_channel(name, [12, 3]).tolist() == expected


@pytest.mark.parametrize("into", FORMS.values(), ids=FORMS.keys())
def test_control_bytes_in_titles_are_blanks(into: Callable[[], T01Writer]) -> None:
    data = bytes(make_t01(1, [MadePart(1, "part 7")], writer=into()).data).replace(
        b"part 7", b"p\nrt\x007"
    )
    assert open_history(data).parts[0].title == "p rt 7"


@pytest.mark.parametrize(
    "path",
    [
        BOX,
        locate_stored("rollover_r100_T02.gz"),
        locate_stored("chain_referenceT01.gz"),
    ],
)
def test_energies_of_the_parts_add_up_to_that_of_the_model(path: str) -> None:
    run = open_history(read_unpacked(path))
    total = run.part_channel("internal_energy", [part.id for part in run.parts]).sum(
        axis=1
    )
    np.testing.assert_allclose(
        total, run.channel("internal_energy"), atol=1e-6 * total.max()
    )


def test_the_rollover_agrees_with_the_table_of_its_makers() -> None:
    """rollover_ref.csv was made independently of these files: seven digits of energies, parts box and step."""
    run = open_history(read_unpacked(BOX))
    table = np.genfromtxt(ROLLOVER, delimiter=",", names=True)
    at = np.searchsorted(run.time, table["time_s"] - 1e-7)
    box = run.part_channel("internal_energy", [1])[at, 0]
    close = np.abs(run.time[at] - table["time_s"]) < 2e-6
    assert close.sum() > 500
    np.testing.assert_allclose(
        box[close], table["boxIE_J"][close], rtol=1e-4, atol=1e-3
    )


def test_legs_follow_one_another() -> None:
    legs = [
        open_history(read_unpacked(locate_stored(f"rollover_r100_T0{leg}.gz")))
        for leg in (1, 2, 3)
    ]
    assert [leg.time.size for leg in legs] == [201, 541, 161]
    assert (np.diff(np.concatenate([leg.time for leg in legs])) > 0).all()


def write_moving_nodes(first: int, states: int, writer: T01Writer) -> bytes:
    """Return a history of nodes 5 to 7: six values each, three of them displacements."""
    write_head([MadePart(3, "box")], globals_=22, writer=writer)
    for state in range(first, first + states):
        moved = [state + value / 32 for value in range(18)]
        writer.state(state / 8, [0.0] * 22, [0.0] * 8, nodes=moved)
    return bytes(writer.data)


@pytest.mark.parametrize("into", FORMS.values(), ids=FORMS.keys())
def test_displacements_of_nodes_are_read_by_their_numbers_in_all_legs(
    into: Callable[[], T01Writer],
) -> None:
    legs = [write_moving_nodes(first, 3, into()) for first in (0, 3)]
    run = open_contents(radioss_th, *legs)
    motion = require(run.displacements((7, 9, 5)))
    assert motion.time.tolist() == [state / 8 for state in range(6)]
    assert motion.ids == (5, 7)
    for state in range(6):
        expected = [
            [state + value / 32 for value in at] for at in ((0, 1, 2), (12, 13, 14))
        ]
        assert motion.displacements[state].tolist() == expected
    assert run.displacements((9,)) is None


def test_nodes_that_a_leg_lacks_are_not_read() -> None:
    with_nodes = write_moving_nodes(0, 3, T01Writer())
    without = with_nodes.replace(
        pack_numbers("i", [5]) + b"corner", pack_numbers("i", [4]) + b"corner"
    )
    later = write_moving_nodes(3, 3, T01Writer())
    run = open_contents(radioss_th, without, later)
    assert require(run.displacements((4, 5, 6))).ids == (6,)


def test_a_group_of_elements_is_no_part_and_its_energy_not_counted_twice() -> None:
    run = open_history(
        make_t01(2, [MadePart(1, "box"), MadePart(1, "half of the box", is_group=True)])
    )
    assert [(part.id, part.title) for part in run.parts] == [(1, "box")]
    assert run.part_channel("internal_energy", [1])[:, 0].tolist() == [
        make_value(s, 1, 1) for s in range(2)
    ]


def test_a_part_without_variables_is_noted_and_refused() -> None:
    run = open_history(make_t01(2, [MadePart(1, "box"), MadePart(2, "step", codes=())]))
    assert [part.id for part in run.parts] == [1]
    assert any("no variables of part 2 in the file" in note for note in run.notes)
    with pytest.raises(
        FormatError, match="no internal_energy of part 2, parts with variables: 1;"
    ):
        run.part_channel("internal_energy", [2])


def test_a_variable_that_was_not_asked_for_is_refused() -> None:
    run = open_history(make_t01(2, [MadePart(1, "box", codes=(1, 2))]))
    with pytest.raises(
        FormatError,
        match="no x_momentum of part 1, only internal_energy, kinetic_energy;",
    ):
        run.part_channel("x_momentum", [1])
    with pytest.raises(FormatError, match="no global heat, there are internal_energy"):
        run.channel("heat")


def test_no_states_is_a_legal_file() -> None:
    run = open_history(make_t01(0))
    assert run.time.shape == (0,)
    assert run.complete


@pytest.mark.parametrize("head", [b"", b"\0\0\0T", b"time,internal energy\n0,0\n"])
def test_something_else_is_not_recognised_and_refused(head: bytes) -> None:
    assert not recognises(head)
    with pytest.raises(
        FormatError, match="was expected in the head of the time history"
    ):
        open_history(head)


# Return the same time history as text.


def test_numbers_of_a_record_that_five_columns_do_not_count() -> None:
    parts = [MadePart(id_, "piece", tuple(range(1, 501))) for id_ in range(1, 202)]
    run = open_history(make_t01(1, parts, writer=T01TextWriter()))
    assert run.part_channel("internal_energy", [201]).tolist() == [
        [printed(make_value(0, 201, 1))]
    ]


@pytest.mark.parametrize("number", [-1.5e-120, 2.25e117, 0.0, -0.125])
def test_an_exponent_of_three_digits_stands_without_its_letter(number: float) -> None:
    writer = make_t01(2, writer=T01TextWriter())
    writer.state(0.5, [number] * 22, [0.0] * 16)
    assert open_history(writer).channel("mass").tolist()[-1] == number


@pytest.mark.parametrize(("single", "digits"), [(True, 7), (False, 9)])
def test_numbers_have_the_digits_in_which_the_solver_computed(
    single: bool, digits: int
) -> None:
    writer = make_t01(0, writer=T01TextWriter())
    for time in np.arange(4) / 7:
        writer.state(
            float(np.float32(time)) if single else float(time), [0.0] * 22, [0.0] * 16
        )
    run = open_history(writer)
    assert [precision.digits for precision in run.precisions(["mass"])] == [
        digits,
        digits,
    ]


def test_legs_may_be_text_and_binary() -> None:
    text, binary = make_t01(4, start=2, writer=T01TextWriter()), make_t01(4)
    run = open_contents(radioss_th, bytes(text.data), bytes(binary.data))
    assert run.history(Selection()).time.tolist() == [state / 8 for state in range(6)]
    assert "the newer restart segment is used where they overlap" in run.notes[0]


@pytest.mark.parametrize(
    ("line", "damaged"),
    [
        (b"ZZZZZEOR    6I", b"ZZZZZEOR" + b"9" * 5000 + b"I"),
        (b"ZZZZZEOR    6I", b"ZZZZZEOR99999I"),
        (b"ZZZZZEOR    6I", b"ZZZZZEOR    6C"),
        (b"         7part 7", b"**********part 7"),
        (b"         7part 7", b"9999999999part 7"),
        (b"         7part 7", b"       1 7part 7"),
    ],
)
def test_a_head_that_does_not_hold_what_it_says_is_refused(
    line: bytes, damaged: bytes
) -> None:
    with pytest.raises(
        FormatError, match="was expected in the head of the time history near byte"
    ):
        open_history(SMALL.data.replace(line, damaged))


@pytest.mark.parametrize(
    "text", [CODED, "ZZZZZEOR      84\n      3041a title\nZZZZZEOR      80\n"]
)
def test_other_forms_of_text_are_refused_with_what_to_do(text: str) -> None:
    assert recognises(text.encode())
    with pytest.raises(
        FormatError,
        match=r"runT01: .* as text, but not as /TFILE/3 writes it .*; let the run",
    ):
        open_history(text.encode())


def test_as_a_table_it_is_refused() -> None:
    with pytest.raises(FormatError):
        open_contents(csv_table, SMALL.data).history(Selection())


@pytest.mark.parametrize(
    ("number", "damaged"),
    [
        ("  7.00000000E+00", " 7.00000000E+00 "),
        ("  7.00000000E+00", "   7.00000000E+0"),
        ("  7.00000000E+00", "   .00000000E+00"),
        ("  7.00000000E+00", "  7.0000 000E+00"),
        ("  7.00000000E+00", "             NaN"),
        ("  7.00000000E+00", "****************"),
    ],
)
def test_a_number_out_of_its_columns_is_none(number: str, damaged: str) -> None:
    writer = make_t01(2, writer=T01TextWriter())
    writer.state(0.25, [7.0] * 22, [0.0] * 16)
    data = bytes(writer.data).decode()
    end = data.rindex(number * 2) + len(number)
    run = open_history((data[:end] + damaged + data[end + len(number) :]).encode())
    assert sum(bool(np.isnan(run.channel(name)).any()) for name in run.channels) == 1


def test_a_number_that_is_none_is_refused() -> None:
    writer = make_t01(2, writer=T01TextWriter())
    writer.state(0.25, [float("nan")] * 22, [0.0] * 16)
    with pytest.raises(
        D2RPickError, match="energy of state 3 is nan, but a finite number"
    ):
        open_contents(radioss_th, bytes(writer.data)).history(Selection())


def test_an_additional_history_without_global_values_is_no_leg() -> None:
    whole, additional = (
        bytes(make_t01(5, [MadePart(3, "box")], globals_=count).data)
        for count in (12, 0)
    )
    for order in (("RUNT01", "RUNT01a"), ("RUNT01a", "RUNT01")):
        contents = {"RUNT01": whole, "RUNT01a": additional}
        legs = radioss_th.open_legs(
            [Source(name, contents[name]) for name in order], Selection()
        )
        assert [leg.source for leg in legs] == ["RUNT01"]
        assert (
            "RUNT01a was left out: without global values it is no engine run"
            in legs[0].notes[-1]
        )
    assert radioss_th.open_legs([Source("RUNT01a", additional)], Selection())[0].parts
