"""Valid forms of matsum, and refused ones."""

import numpy as np
import pytest

from d2rpick.base.errors import FormatError
from d2rpick.histories.formats import matsum
from tests.faults import list_cuts
from tests.text_files import (
    HEAD,
    make_matsum_head,
    make_matsum_part,
    make_matsum_state,
    make_matsum_text,
)

TIMES = [0.0, 0.1, 0.25, 0.3]
IDS = [10, 1, 123456]
ENERGIES = np.array(
    [[0.0, 1.0, 2.0], [3.0, -4.5, 5.0], [6.0, 7.0, 1e-22], [9.0, 10.0, 11.0]]
)
TEXT = make_matsum_text(TIMES, IDS, ENERGIES)
MASS = (
    b"       Maximum mass increase in solid elements      =   0.2122E-07 ID=   36456\n"
)
LUMPED = make_matsum_part(0, 0.0, lines=3)
STATES = [
    make_matsum_state(time, IDS, row) for time, row in zip(TIMES, ENERGIES, strict=True)
]
LONG = 150  # states; from so many on, the reader remembers which bytes differ between blocks
BEHIND_HEAD = TEXT.index(b"{BEGIN")

SAME = {
    "four lines": TEXT,
    "three lines": make_matsum_text(TIMES, IDS, ENERGIES, lines=3),
    "CRLF": TEXT.replace(b"\n", b"\r\n"),
    "trailing blanks": TEXT.replace(b"\n", b" \n"),
    "no legend": HEAD + b"\n\n" + TEXT[TEXT.index(b" time =") :],
    "no head": TEXT[TEXT.index(b" time =") :],
    "legend in another order": TEXT.replace(
        make_matsum_head(IDS), make_matsum_head(IDS[::-1])
    ),
    "titles like data": TEXT.replace(b"Part 10 ", b"mat.#=   10  inten=   1.0000E+00 "),
    "mass increase lines": TEXT.replace(b" time =   2.5", MASS + b" time =   2.5"),
    "lumped masses": TEXT.replace(b" mat.#=   10", LUMPED + b" mat.#=   10"),
    "old, no eroded energies": TEXT.replace(
        b"     eroded_ie=   0.0000E+00     eroded_ke=   0.0000E+00", b""
    ),
    "added mass": TEXT.replace(
        b"hgeng=   0.0000E+00",
        b"hgeng=   0.0000E+00     +mass=   0.0000E+00     eroded_he=   0.0000E+00",
    ),
    "parts in another order in state 3": TEXT.replace(
        STATES[2], make_matsum_state(TIMES[2], IDS[::-1], ENERGIES[2][::-1])
    ),
}


def read_matsum(text: bytes) -> matsum.Matsum:
    return matsum.Matsum(text, "matsum")


def assert_as_written(run: matsum.Matsum) -> None:
    assert run.part_time.tolist() == TIMES
    assert run.part_channel("internal_energy", IDS).tolist() == ENERGIES.tolist()
    for column, id_ in enumerate(IDS):
        assert (
            run.part_channel("internal_energy", [id_])[:, 0].tolist()
            == ENERGIES[:, column].tolist()
        )


@pytest.mark.parametrize("text", SAME.values(), ids=SAME.keys())
def test_every_form_gives_the_same_numbers(text: bytes) -> None:
    run = read_matsum(text)
    assert_as_written(run)
    assert (run.complete, run.notes) == (True, ())
    assert [part.id for part in run.parts] == IDS


@pytest.mark.parametrize("order", [(2, 0, 1), (0, 2, 1)])
def test_parts_swapped_within_blocks_of_one_size_are_not_shifted(
    order: tuple[int, ...],
) -> None:
    """States have the same time lines and are alike at both ends; the difference shows only when a part is read."""
    ids, indices = [11, 12, 13, *range(20, 30)], [*order, *range(3, 13)]
    energies = np.arange(8 * 13.0).reshape(8, 13)
    states = [make_matsum_state(time, ids, row) for time, row in enumerate(energies)]
    states[4] = make_matsum_state(
        4, [ids[index] for index in indices], energies[4][indices]
    )
    for wanted_ids in ([12], [11, 12], ids):
        run = read_matsum(make_matsum_head(ids) + b"".join(states))
        expected = energies[:, [ids.index(id_) for id_ in wanted_ids]]
        assert (
            run.part_channel("internal_energy", wanted_ids).tolist()
            == expected.tolist()
        )


def test_part_that_comes_or_goes_is_refused_and_the_others_are_read() -> None:
    states = [
        *STATES[:2],
        *(
            make_matsum_state(t, IDS[1:], e[1:])
            for t, e in zip(TIMES[2:], ENERGIES[2:], strict=True)
        ),
    ]
    run = read_matsum(make_matsum_head(IDS) + b"".join(states))
    assert run.notes == ("only some states have part 10",)
    assert (
        run.part_channel("internal_energy", [1])[:, 0].tolist()
        == ENERGIES[:, 1].tolist()
    )
    with pytest.raises(
        FormatError, match="matsum:51: inten of part 10 is missing, cut or doubled"
    ):
        run.part_channel("internal_energy", [10])


def test_part_replaced_by_one_of_the_same_size_is_refused() -> None:
    states = [STATES[0].replace(b"=   10", b"=   20"), *STATES[1:]]
    run = read_matsum(make_matsum_head([*IDS, 20]) + b"".join(states))
    with pytest.raises(FormatError, match=r"inten of part .* is missing"):
        run.part_channel("internal_energy", [10])
    assert (
        run.part_channel("internal_energy", [1])[:, 0].tolist()
        == ENERGIES[:, 1].tolist()
    )


def test_part_of_the_legend_that_is_in_no_state() -> None:
    run = read_matsum(TEXT.replace(make_matsum_head(IDS), make_matsum_head([*IDS, 7])))
    assert_as_written(run)
    assert run.notes == ("no state has part 7 of the legend",)
    with pytest.raises(
        FormatError, match="matsum: no part 7; choose from 10, 1, 123456"
    ):
        run.part_channel("internal_energy", [7])


def test_id_that_overflows_is_the_one_of_the_legend() -> None:
    text = TEXT.replace(b"=  123456", b"=********").replace(
        b"   123456 ", b"123456789 "
    )
    run = read_matsum(text)
    assert (
        run.part_channel("internal_energy", [123456789])[:, 0].tolist()
        == ENERGIES[:, 2].tolist()
    )
    assert run.notes == ()


def test_two_ids_that_overflow_are_left_out() -> None:
    ids = [10, 123456, 223456]
    text = (
        make_matsum_text(TIMES, ids, ENERGIES)
        .replace(b"=  123456", b"=********")
        .replace(b"=  223456", b"=********")
    )
    text = text.replace(b"   123456 ", b"123456789 ").replace(
        b"   223456 ", b"223456789 "
    )
    run = read_matsum(text)
    assert [part.id for part in run.parts] == [10]
    assert (
        "parts whose number is damaged or too wide for its columns were left out"
        in run.notes
    )
    assert (
        run.part_channel("internal_energy", [10])[:, 0].tolist()
        == ENERGIES[:, 0].tolist()
    )


def test_id_that_pushes_its_line() -> None:
    run = read_matsum(TEXT.replace(b"=  123456", b"=1234567890"))
    assert (
        run.part_channel("internal_energy", [1234567890])[:, 0].tolist()
        == ENERGIES[:, 2].tolist()
    )


@pytest.mark.parametrize(
    "id_text",
    [b"=    1             i", b"=   10            i", b"=   1 0             i"],
)
def test_damaged_id_makes_no_other_part(id_text: bytes) -> None:
    """If a digit or a blank is lost or inserted, the columns do not fit any more."""
    damaged = STATES[2].replace(
        b"=   10             i", id_text.replace(b"    1 ", b"   1 ")
    )
    run = read_matsum(
        make_matsum_head(IDS) + b"".join([*STATES[:2], damaged, STATES[3]])
    )
    with pytest.raises(FormatError, match="inten of part 10 is missing"):
        run.part_channel("internal_energy", [10])
    assert (
        run.part_channel("internal_energy", [1])[:, 0].tolist()
        == ENERGIES[:, 1].tolist()
    )


@pytest.mark.parametrize("changed", [None, 1, 64, LONG - 2, LONG - 1])
@pytest.mark.parametrize("swapped", [False, True])
def test_numbers_that_are_the_same_in_most_states(
    changed: int | None, swapped: bool
) -> None:
    """Each state has its own number, whether the number changes in no state, in one or in all."""
    times, ids = np.arange(LONG) / 8, [11, 12, 13, 14]
    energies = np.tile([0.0, -0.0, 2.5, 0.0], (LONG, 1))
    energies[:, 3] = np.arange(LONG)
    if changed is not None:
        energies[changed, :3] = [1e-22, 3.0, -0.0]
    states = [
        make_matsum_state(time, ids, row)
        for time, row in zip(times, energies, strict=True)
    ]
    if swapped:
        states[100] = make_matsum_state(times[100], ids[::-1], energies[100, ::-1])
    run = read_matsum(make_matsum_head(ids) + b"".join(states))
    for _ in range(
        2
    ):  # at the second request at the latest, the whole file is compared
        for chosen in ([11], [12, 13], ids, ids[:3]):
            energies_of_chosen = run.part_channel("internal_energy", chosen)
            assert (
                energies_of_chosen.tobytes()
                == energies[:, [ids.index(id_) for id_ in chosen]].tobytes()
            )
        assert not run.part_channel("y_momentum", ids).any()


def test_what_is_no_number_in_all_states_is_refused_with_the_line_of_the_first() -> (
    None
):
    text = make_matsum_text(np.arange(LONG), [11, 12], np.zeros((LONG, 2)))
    text = text.replace(b"y-mom=   0.0000E+00", b"y-mom=" + b"*" * 13)
    run = read_matsum(text)
    assert run.part_channel("internal_energy", [11, 12]).shape == (LONG, 2)
    line = 1 + text[: text.index(b"y-mom=*")].count(b"\n")
    with pytest.raises(
        FormatError,
        match=rf"matsum:{line}: y-mom of part 11 is '\*+', but a number in its columns",
    ):
        run.part_channel("y_momentum", [11, 12])


@pytest.mark.parametrize(
    "field", [b"*************", b"          NaN", b"             ", b"   6.0000E+0 "]
)
def test_what_is_no_number_is_refused_with_its_line(field: bytes) -> None:
    run = read_matsum(TEXT.replace(b"   6.0000E+00", field))
    with pytest.raises(FormatError, match=r"^matsum:52: inten of part 10 is '"):
        run.part_channel("internal_energy", [1, 10])
    assert (
        run.part_channel("internal_energy", [1, 123456]).tolist()
        == ENERGIES[:, 1:].tolist()
    )


def test_quantity_that_was_not_written_is_refused() -> None:
    run = read_matsum(make_matsum_text(TIMES, IDS, ENERGIES, lines=3))
    with pytest.raises(FormatError, match="hgeng of part 1 is missing"):
        run.part_channel("hourglass_energy", [1])
    with pytest.raises(
        FormatError, match="no quantity 'mass' in a matsum, only internal_energy"
    ):
        run.part_channel("mass", [1])
    with pytest.raises(FormatError, match="a matsum has parts only"):
        run.channel("internal energy")


@pytest.mark.parametrize(
    "text", [b"", b"\n", b"time,energy\n0,1\n", bytes(5000)], ids=range(4)
)
def test_something_else_is_no_matsum(text: bytes) -> None:
    assert not matsum.recognises(text)
    with pytest.raises(FormatError, match="this is not a matsum"):
        read_matsum(text)


@pytest.mark.slow
@pytest.mark.parametrize(("lines", "legend"), [(3, True), (4, False)])
def test_cut_anywhere_gives_whole_states_only(lines: int, legend: bool) -> None:
    text = make_matsum_text(TIMES[:3], IDS, ENERGIES[:3], lines)
    first = text.index(b" time =")
    if not legend:
        text = HEAD + b"\n\n" + text[first:]
        first = text.index(b" time =")
    starts = [at for at in range(len(text)) if text.startswith(b" time =", at)]
    for end in (cut for cut in list_cuts(text) if cut >= len(HEAD)):
        run = read_matsum(text[:end])
        n = run.part_time.size
        assert run.part_time.tolist() == TIMES[:n]
        if n:
            assert (
                run.part_channel("internal_energy", IDS).tolist()
                == ENERGIES[:n].tolist()
            ), end
        begun = sum(start + 20 < end for start in starts)
        assert begun - 1 <= n <= begun, end
        assert run.complete == (
            n == begun and not text[:end].rpartition(b"\n")[2].strip()
        ), end
