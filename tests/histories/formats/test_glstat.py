"""Valid forms of glstat and refused ones; every cut gives an error or a true prefix."""

import re

import pytest
from hypothesis import given, strategies as st

from d2rpick.base.errors import FormatError
from d2rpick.histories.formats import glstat
from d2rpick.histories.history import History, Precision
from d2rpick.histories.opening import Selection
from tests.command import ROOT
from tests.faults import list_cuts
from tests.reading import list_states, open_contents, read_contents

HEAD = """\
 Internal energy of a time box, 1.0E+00
                    ls-dyna smp d R16 R16.1_180_d50332d date 07/09/2025


"""
CONTROLLERS = (
    "dt2ms     ",
    "load curve",
    "sph   1002285",
    "rigid node",
    "shell             11 of part         1",
    "DE sphere         24 of part        10",
)

STATES = ((0.0, 2e-20), (1.5e-3, 1.36945e-5), (2.75e-3, -8.05e2))
KILLED = "a leg that was killed, and its restart"
NO_NUMBER = (
    "glstat:32: 'internal energy' is '{}', but a number in its columns was expected"
)
NOT_ONCE = "glstat:29: 'internal energy' is missing, cut or doubled in the state that begins here"


def line(label: str, value: object, suffix: str = "") -> str:
    text = value if isinstance(value, str) else f"{value:.5E}"
    return f" {label:.<31}{text:>14}{suffix}\n"


def block(
    time: object, internal: object, *, controller: str = CONTROLLERS[0], gap: str = "\n"
) -> str:
    return (
        f" dt of cycle      24 is controlled by {controller}\n"
        + gap
        + line("time", time)
        + line("time step", 2.7e-7)
        + line("kinetic energy", 9.93442e-6)
        + ("" if internal is None else line("internal energy", internal))
        + line("stonewall energy", -1.0, " wall# 1")
        + line("stonewall energy", -2.0, " wall#    2")
        + line("hourglass energy ", 0.0)
        + line("eroded internal energy", 77.0)
        + line("dissipated internal energy", 78.0)
        + line("total energy / initial energy", 1.0)
        + line("energy ratio w/o eroded energy", 1.0)
        + line("time per zone cycle.(nanosec)", "4663")
        + "\n\n number of shell elements that  \n reached the minimum time step..    0\n\n\n"
        + line("added mass", "0.28468E-03")
        + "\n"
    )


WHOLE = HEAD + "".join(
    block(*state, controller=c) for state, c in zip(STATES, CONTROLLERS, strict=False)
)


def read_glstat(text: str | bytes, *energy: str) -> History:
    return read_contents(
        glstat, text, selection=Selection(energy=energy), name="glstat"
    )


SCENARIOS = {
    "as written": (WHOLE, STATES),
    "one state": (HEAD + block(0.0, 4.5), [(0.0, 4.5)]),
    "line ends of another system": (WHOLE.replace("\n", "\r\n"), STATES),
    "no blank line behind the controller": (
        HEAD + block(0.0, 1.0, gap="") + block(1.0, 2.0, gap=""),
        [(0, 1), (1, 2)],
    ),
    "blocks without blank lines between": (re.sub("\n+", "\n", WHOLE), STATES),
    "title in latin-1": (WHOLE.replace("box", "Stoßfänger"), STATES),
    "every controller": (
        HEAD
        + "".join(
            block(float(i), float(i), controller=c) for i, c in enumerate(CONTROLLERS)
        ),
        [(float(i), float(i)) for i in range(len(CONTROLLERS))],
    ),
    "Fortran's exponents": (
        HEAD
        + block("1.00000D-03", "1.23457-100")
        + block("2.00000D-03", "-4.94066-300")
        + block(".3E+00", "+1.0E+00"),
        [(1e-3, 1.23457e-100), (2e-3, -4.94066e-300), (0.3, 1.0)],
    ),
    "values before the first time line": (
        WHOLE[WHOLE.index(" time step") :],
        STATES[1:],
    ),
    "trailing blanks": (WHOLE.replace("\n", "  \n"), STATES),
    "a title like data": (
        WHOLE.replace(
            " Internal energy of a time box, 1.0E+00", line("time", 9.0)[:-1]
        ),
        STATES,
    ),
    "a line more in one state": (
        WHOLE.replace(
            line("eroded internal energy", 77.0), " body row1= 0.1 0.2 0.3\n", 1
        ),
        STATES,
    ),
    "a line more in the last state": (WHOLE + line("percentage increase", 1.0), STATES),
    "no hourglass line": (WHOLE.replace(line("hourglass energy ", 0.0), ""), STATES),
    KILLED: (
        HEAD
        + block(0.0, 1.0)
        + block(1.0, 9.0)[:500]
        + HEAD
        + block(1.0, 2.0)
        + block(2.0, 3.0),
        [(0, 1), (1, 2), (2, 3)],
    ),
    "equal times, the last counts": (
        HEAD + block(0.0, 1.0) + block(0.0, 2.0) + block(1.0, 3.0),
        [(0, 2), (1, 3)],
    ),
    "restart, the newer leg counts": (
        HEAD
        + "".join(
            block(float(t), e)
            for t, e in ((0, 1.0), (1, 2.0), (2, 3.0), (1, 5.0), (2, 6.0))
        ),
        [(0, 1), (1, 5), (2, 6)],
    ),
    "mass properties between": (
        WHOLE.replace(
            "\n\n\n added",
            "\n m a s s   p r o p e r t i e s   o f   b o d y\n      total mass of body  = 0.1E+01\n added",
        ),
        STATES,
    ),
}


@pytest.mark.parametrize("name", SCENARIOS)
def test_scenario(name: str) -> None:
    text, expected = SCENARIOS[name]
    history = read_glstat(text)
    assert list_states(history) == [tuple(map(float, state)) for state in expected]
    assert history.channel == "internal energy"
    assert history.format == "glstat"
    assert history.complete
    assert history.time_precision == history.energy_precision == Precision(digits=6)


def test_notes_say_what_was_left_out() -> None:
    assert read_glstat(WHOLE).notes == ()
    assert "no head" in read_glstat(WHOLE[WHOLE.index(" time step") :]).notes[0]
    assert (
        "same printed time"
        in read_glstat(HEAD + block(0.0, 1.0) + block(0.0, 2.0)).notes[0]
    )
    assert (
        "a restart segment of the run ends within the state of line 29"
        in read_glstat(SCENARIOS[KILLED][0]).notes[0]
    )
    assert "kinetic" in read_glstat(WHOLE, "kinetic energy").notes[0]


def test_a_head_alone_is_a_legal_file_without_states() -> None:
    run = open_contents(glstat, HEAD)
    assert run.databases[0].span is None
    assert run.databases[0].complete
    assert (
        run.databases[0].version
        == "ls-dyna smp d R16 R16.1_180_d50332d date 07/09/2025"
    )
    assert run.databases[0].title == "Internal energy of a time box, 1.0E+00"


@pytest.mark.parametrize(
    ("asked", "channel", "expected"),
    [
        (("Kinetic Energy",), "kinetic energy", 9.93442e-6),
        (("hourglass energy",), "hourglass energy", 0.0),
        (("stonewall energy wall# 2",), "stonewall energy wall# 2", -2.0),
        (("energy ratio w/o eroded energy",), "energy ratio w/o eroded energy", 1.0),
        (
            ("dissipated internal energy", "eroded internal energy"),
            "dissipated internal energy + eroded internal energy",
            155.0,
        ),
    ],
)
def test_other_labels(asked: list[str], channel: str, expected: float) -> None:
    history = read_glstat(WHOLE, *asked)
    assert history.channel == channel
    assert history.energy.tolist() == [expected] * 3


GOOD = line("internal energy", 1.36945e-5)  # in line 32, its state begins in line 29
REFUSED = {
    "no state": (HEAD, "no states"),
    "no state, one controller": (
        HEAD + " dt of cycle       1 is controlled by dt2ms\n",
        "no states",
    ),
    "a time that is none": (
        HEAD + block(0.0, 1.0) + block("Infinity", 1.0),
        "'time' is 'Infinity'",
    ),
    "a state without its time": (
        WHOLE.replace(line("time", 1.5e-3), ""),
        "'internal energy' is missing, cut or doubled",
    ),
    "no such line at all": (
        HEAD + block(0.0, None) + block(1.0, None),
        "no internal energy; choose with `energy`: time",
    ),
    "time at random": (
        HEAD + "".join(block(float(t), 1.0) for t in (5, 1, 4, 2, 3)),
        "glstat: time steps back",
    ),
    "line missing": (WHOLE.replace(GOOD, ""), NOT_ONCE),
    "line twice": (WHOLE.replace(GOOD, 2 * GOOD), NOT_ONCE),
    "wider than its column": (WHOLE.replace(GOOD, GOOD[:-1] + "1\n"), NOT_ONCE),
    "narrower than its column": (WHOLE.replace(GOOD, GOOD[:-2] + "\n"), NOT_ONCE),
    "shifted": (WHOLE.replace(GOOD, GOOD.replace("   1.", "  1.")), NOT_ONCE),
    **{
        text.strip() or "blank": (
            WHOLE.replace("   1.36945E-05", f"{text:>14}"),
            NO_NUMBER.format(re.escape(text.strip())),
        )
        for text in (
            "*" * 14,
            "NaN",
            "Infinity",
            "-1.#IND0E+00",
            "1.0_000E+00",
            "1.0E+999",
            "",
            "1.36945E-5 ",
        )
    },
}


@pytest.mark.parametrize("name", REFUSED)
def test_refused(name: str) -> None:
    text, reason = REFUSED[name]
    with pytest.raises(FormatError, match=reason):
        read_glstat(text)


@pytest.mark.parametrize(
    ("asked", "reason"),
    [
        (
            ("kinetik energy",),
            "did you mean 'kinetic energy'.*there are: time step, kinetic energy, internal energy",
        ),
        (
            ("stonewall energy",),
            "no 'stonewall energy' .did you mean 'stonewall energy wall# [12]'",
        ),
        (("internal energy", "Internal Energy"), "given twice"),
        (("time",), "no 'time'"),
    ],
)
def test_labels_that_cannot_be_taken(asked: list[str], reason: str) -> None:
    with pytest.raises(FormatError, match=reason):
        read_glstat(WHOLE, *asked)


def test_other_lines_of_a_damaged_state_are_still_good() -> None:
    assert (
        read_glstat(
            WHOLE.replace("   1.36945E-05", "           NaN"), "kinetic energy"
        ).time.size
        == 3
    )


@pytest.mark.parametrize("energy", ["internal energy", "added mass"])
def test_a_file_cut_anywhere_never_yields_a_wrong_number(energy: str) -> None:
    whole = WHOLE.encode()
    expected = list_states(read_glstat(whole, energy))
    outcomes: set[str | int] = set()
    for cut in list_cuts(whole):
        try:
            history = read_glstat(whole[:cut], energy)
        except FormatError:
            outcomes.add("error")
            continue
        states_read = list_states(history)
        assert states_read == expected[: len(states_read)]
        outcomes.add(len(states_read))
        # A file cut between two lines differs from a complete file only by the missing lines.
        assert not history.complete or whole[:cut].rstrip(b" ").endswith(b"\n")
        assert history.complete or history.notes
    assert outcomes == {"error", 1, 2, 3}


def test_a_last_state_counts_for_the_lines_that_are_there() -> None:
    cut = WHOLE[: WHOLE.rindex(" hourglass") + 40]
    assert list_states(read_glstat(cut)) == list(STATES)
    assert (
        read_glstat(cut).notes[-1]
        == "the file ends within its last state, after the lines that were needed"
    )
    assert read_glstat(cut, "stonewall energy wall# 2").time.size == 3
    assert read_glstat(cut, "hourglass energy").time.size == 2
    assert not read_glstat(cut).complete
    energy = line("internal energy", -8.05e2)
    at_its_end = WHOLE[: WHOLE.rindex(energy) + len(energy)]
    assert read_glstat(at_its_end).time.size == 2  # no line follows
    assert read_glstat(at_its_end + " ").time.size == 3
    assert (
        open_contents(glstat, cut, selection=Selection(energy=("no such line",)))
        .databases[0]
        .time.size
        == 2
    )


@pytest.mark.parametrize("damage", ["", " ", "0", "_", "*", "\n", "time"])
def test_a_byte_lost_or_put_between_the_columns_is_seen(damage: str) -> None:
    start = WHOLE.index(" internal energy", len(HEAD) + 1000)
    for position in range(start, start + 34):
        removed = WHOLE[:position] + damage + WHOLE[position + 1 :]
        try:
            states_read = list_states(read_glstat(removed))
        except FormatError:
            continue
        assert states_read == list(STATES)


@given(st.binary(max_size=400))
def test_no_bytes_raise_anything_else(data: bytes) -> None:
    glstat.recognises(data)
    try:
        read_glstat(HEAD.encode() + data + block(0.0, 1.0).encode() + data)
    except FormatError:
        return


@pytest.mark.parametrize(
    ("head", "expected"),
    [
        (HEAD, True),
        (WHOLE[:300], True),
        (block(0.0, 1.0), True),
        (HEAD + "{BEGIN LEGEND}\n Entity #        Title\n", False),
        (" ls-dyna time\n0,1\n", False),
        ("", False),
    ],
)
def test_recognised_by_content(head: str, expected: bool) -> None:
    assert glstat.recognises(head.encode()) is expected


def assert_numbers_of_float(data: bytes, name: str) -> None:
    """Return all numbers of a glstat as ``float`` reads them from its columns."""
    run = glstat.Glstat(data, name)
    written: dict[str, list[float]] = {}
    for text in data.decode("latin-1").split("\n"):
        if text[31:32] == ".":
            label = " ".join([text[1:32].rstrip(".").rstrip(), *text[46:].split()])
            written.setdefault(label, []).append(float(text[32:46]))
    assert run.time.tolist() == written.pop("time")
    assert {name: run.channel(name).tolist() for name in run.channels} == written


@pytest.mark.parametrize("name", ["energy.glstat", "rollover_box.glstat"])
def test_all_numbers_of_a_sample_are_those_of_float(name: str) -> None:
    assert_numbers_of_float((ROOT / "sample_data" / name).read_bytes(), name)
