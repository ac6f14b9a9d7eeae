"""Several files as one run: families, legs, companion files, and which of their energies is used."""

from __future__ import annotations

import gzip
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from d2rpick.base.errors import FormatError
from d2rpick.choice.overview import describe_run
from d2rpick.histories.database import Legs
from d2rpick.histories.formats import (
    READERS,
    binout,
    csv_table,
    glstat,
    matsum,
    radioss_th,
)
from d2rpick.histories.history import Samples
from d2rpick.histories.opening import (
    OpenedRun,
    Selection,
    check_companions,
    load_reader,
    open_run,
)
from d2rpick.histories.source import Source
from tests.command import put
from tests.computed import locate_stored
from tests.made_binout import compute_value, make_binout as made_binout
from tests.made_t01 import MadePart, make_t01, make_value
from tests.reading import list_states, open_contents, read_contents, read_history
from tests.text_files import (
    HEAD,
    make_glstat_text,
    make_matsum_head,
    make_matsum_part,
    make_matsum_text,
)

SAMPLES = Path(__file__).parents[2] / "sample_data"
TIMES = np.arange(1, 9) / 8
GLSTAT = make_glstat_text(TIMES, 10 * TIMES)
MATSUM = make_matsum_text(TIMES, [7, 3], np.stack([TIMES, 0 * TIMES], axis=1))

ZERO = "   0.0000E+00"


def open_companions(
    files: Mapping[str, bytes], selection: Selection | None = None
) -> OpenedRun:
    """Open files of different formats; the files of one format are legs."""
    legs = {
        kind: [
            Source(name, data) for name, data in files.items() if name.startswith(kind)
        ]
        for kind in READERS
        if any(name.startswith(kind) for name in files)
    }
    databases = tuple(
        Legs(load_reader(kind).open_legs(sources, selection or Selection()))
        for kind, sources in legs.items()
    )
    check_companions(databases)
    return OpenedRun(tuple(files), databases)


# Families of binouts.


def test_the_files_of_one_folder_are_a_family_and_those_of_several_are_legs() -> None:
    """Branches are in files of different MPI ranks, and one continues in %001; the restart has its own folder."""
    whole, parts = made_binout(range(1, 6)), made_binout(range(1, 6), glstat=False)
    globals_only = bytes(whole.data).replace(b"matsum", b"nodout")
    files = {
        "a/binout0004": bytes(parts.data),
        "b/binout0000": bytes(made_binout(range(1, 4), shift=4).data),
        "a/binout0000": globals_only,
    }
    run = OpenedRun(
        tuple(files),
        (
            Legs(
                binout.open_legs([Source(*file) for file in files.items()], Selection())
            ),
        ),
    )
    assert run.history(Selection()).energy.tolist() == [
        compute_value("internal_energy", state) for state in range(1, 8)
    ]
    assert run.part_energies(run.parts).tolist() == [
        [compute_value("internal_energy", state, id_) for id_ in (7, 3)]
        for state in range(1, 8)
    ]
    assert run.notes == (
        "1 state has the same printed time as the next one; the last of equal times is used",
    )


def test_a_missing_branch_is_named_with_what_there_is() -> None:
    data = bytes(made_binout([1, 2]).data)
    no_parts, no_globals = (
        open_contents(binout, data.replace(b"matsum", b"nodout")),
        open_contents(binout, data.replace(b"glstat", b"nodout")),
    )
    with pytest.raises(
        FormatError,
        match="no matsum in it, but glstat, nodout; name the binout of the run that contains it",
    ):
        no_parts.history(Selection(parts=("3",)))
    with pytest.raises(FormatError, match="no glstat in it, but matsum, nodout"):
        no_globals.history(Selection(energy=("internal_energy",)))
    assert no_globals.history(Selection()).channel == "internal energy of all parts"


# Legs.


def test_legs_are_ordered_by_their_start_and_the_newer_one_wins() -> None:
    legs = [
        make_glstat_text([3, 4, 5], [30, 40, 50]),
        make_glstat_text([1, 2, 3, 4], [1, 2, 3, 4]),
        make_glstat_text([5.5], [55]),
    ]
    history = read_contents(glstat, *legs)
    assert list_states(history) == [
        (1, 1),
        (2, 2),
        (3, 30),
        (4, 40),
        (5, 50),
        (5.5, 55),
    ]
    assert (
        "time steps back once, from 4 to 3 (restart); the newer restart segment is used where they overlap"
        in history.notes[0]
    )


def test_a_leg_that_gives_no_state_is_named() -> None:
    """Two files that start at the same time are probably not legs of one run."""
    history = read_contents(
        glstat, make_glstat_text([1, 2], [1, 2]), make_glstat_text([1, 2], [3, 4])
    )
    assert list_states(history) == [(1, 3), (2, 4)]
    assert (
        "run1 was not used: a newer restart segment begins at or before its first time"
        in history.notes
    )


def test_a_leg_without_states_does_not_hide_the_others() -> None:
    history = read_contents(glstat, HEAD, GLSTAT)
    assert history.time.tolist() == TIMES.tolist()
    with pytest.raises(FormatError, match="no states; did the run"):
        read_contents(glstat, HEAD)


def test_a_part_that_only_some_legs_have_is_left_out_and_named() -> None:
    first, second = (
        make_t01(3, [MadePart(1, "box"), MadePart(2, "step")]),
        make_t01(3, [MadePart(1, "box")], start=3),
    )
    run = open_contents(radioss_th, bytes(first.data), bytes(second.data))
    assert [part.id for part in run.parts] == [1]
    assert "only some restart segments have part 2, which was left out" in run.notes[0]
    with pytest.raises(
        FormatError,
        match=r"no part 2 \(expected part ids, not set ids\); there are: 1 'box'",
    ):
        run.history(Selection(parts=("2",)))


def test_a_column_that_a_leg_lacks_is_refused() -> None:
    with pytest.raises(FormatError, match="run2: no column 'IE', only heat"):
        read_contents(
            csv_table, "time,IE,x\n0,1,2\n1,2,3\n", "time,heat,x\n2,1,2\n3,2,3\n"
        )


# Companions.


def test_companions_of_other_times_are_doubted() -> None:
    assert open_companions({"glstat": GLSTAT, "matsum": MATSUM}).notes == ()
    coarse = make_matsum_text(TIMES[::2], [7, 3], np.ones((4, 2)))
    assert open_companions({"glstat": GLSTAT, "matsum": coarse}).notes == ()
    shifted = make_matsum_text(TIMES + 0.01, [7, 3], np.ones((8, 2)))
    (note,) = open_companions({"glstat": GLSTAT, "matsum": shifted}).notes
    assert (
        note
        == "glstat and matsum have only 0 of 7 states at the same times; are they from the same run?"
    )
    longer = np.arange(30) * (TIMES[1] - TIMES[0]) + TIMES[0]
    (note,) = open_companions(
        {"glstat": GLSTAT, "matsum": make_matsum_text(longer, [7, 3], np.ones((30, 2)))}
    ).notes
    assert note.startswith(
        f"glstat ends at {TIMES[-1]:.6g} and matsum at {longer[-1]:.6g}; are they from the same run"
    )
    with pytest.raises(
        FormatError,
        match="glstat and matsum have no time in common, but files of one run were expected",
    ):
        open_companions(
            {
                "glstat": GLSTAT,
                "matsum": make_matsum_text(TIMES + 5, [7], np.ones((8, 1))),
            }
        )


def test_companions_have_legs_of_their_own() -> None:
    run = open_companions(
        {
            "glstat1": make_glstat_text([1, 2], [1, 2]),
            "matsum": make_matsum_text([1, 2, 3], [7], [[0.5], [6.0], [7.0]]),
            "glstat2": make_glstat_text([2, 3], [20, 30]),
        }
    )
    assert run.history(Selection()).energy.tolist() == [1, 20, 30]
    assert run.history(Selection(parts=("7",))).energy.tolist() == [0.5, 6, 7]


@pytest.mark.parametrize(
    ("parts", "refused"),
    [
        ([[1, 9], [10, 10], [5, 4]], False),  # the parts are the whole model
        ([[1, 2], [3, 4], [5, 2]], False),  # the other parts are not written
        (
            [[1, 9.9], [10, 10], [5, 4]],
            False,
        ),  # a difference within the rounding of solvers
        ([[1, 2], [9, 15], [5, 4]], True),
    ],
)
def test_parts_with_more_energy_than_the_model_are_of_another_run(
    parts: list[list[float]], refused: bool
) -> None:
    run = open_companions(
        {
            "glstat": make_glstat_text([1, 2, 3], [10, 20, 9]),
            "matsum": make_matsum_text([1, 2, 3], [7, 3], parts),
        }
    )
    if refused:
        with pytest.raises(
            FormatError,
            match=r"at 2 the parts of matsum have an energy of 24, .*glstat has 20",
        ):
            run.history(Selection(parts=("7", "3")))
    else:
        assert run.history(Selection(parts=("7", "3"))).energy.tolist() == [
            sum(row) for row in parts
        ]


def test_round_off_of_a_free_fall_is_no_energy_of_another_run() -> None:
    """A falling box has some 1e-18 J in its parts, and a different 1e-18 J as a whole."""
    table = b"time,internal_energy,kinetic_energy\n1,1e-18,5\n2,0,6\n3,0,7\n"
    run = open_companions(
        {
            "csv": table,
            "matsum": make_matsum_text([1, 2, 3], [7], [[2e-18], [3e-18], [0.0]]),
        }
    )
    assert run.history(Selection(parts=("7",))).energy.size == 3


# The energy that is used.


def test_the_energy_of_the_whole_model_is_the_default_and_binary_files_are_preferred() -> (
    None
):
    data = bytes(made_binout(range(1, 9)).data)
    run = open_companions({"glstat": GLSTAT, "binout": data, "matsum": MATSUM})
    assert run.history(Selection()).energy[0] == compute_value("internal_energy", 1)
    assert (
        run.history(Selection(energy=("internal energy",))).channel == "internal_energy"
    )
    assert run.history(Selection(energy=("time step",))).channel == "time_step"


def test_without_it_all_parts_are_added_with_a_note() -> None:
    history = read_contents(matsum, MATSUM)
    assert (history.channel, history.parts) == ("internal energy of all parts", None)
    assert history.energy.tolist() == TIMES.tolist()
    assert history.notes == (
        "without any internal energy: part 3 'Part 3'; rigid, or without elements?",
        "the energies of all parts were added, including parts that stay deformable; choose with `parts`",
    )


def test_chosen_parts_are_added_and_named() -> None:
    history = read_contents(matsum, MATSUM, selection=Selection(parts=("part 7",)))
    assert (history.channel, history.notes) == ("internal energy of Part 7", ())
    assert [part.id for part in history.parts or ()] == [7]
    idle = read_contents(matsum, MATSUM, selection=Selection(parts=("3,7",)))
    assert idle.energy.tolist() == TIMES.tolist()
    assert idle.notes == (
        "without any internal energy: part 3 'Part 3'; rigid, or without elements?",
    )


@pytest.mark.parametrize(
    ("files", "selection", "reason"),
    [
        (
            {"glstat": GLSTAT},
            Selection(parts=("7",)),
            "glstat: a glstat has no parts; add the matsum of the run",
        ),
        (
            {"matsum": MATSUM},
            Selection(energy=("internal energy",)),
            "a matsum has parts only; choose with `parts`",
        ),
        (
            {"csv": b"time,IE\n0,1\n"},
            Selection(parts=("7",)),
            "csv: this table has no parts; give the matsum",
        ),
        (
            {"radioss-th": bytes(make_t01(2, []).data)},
            Selection(parts=("7",)),
            "no parts with histories of their own",
        ),
        (
            {"glstat": GLSTAT, "matsum": MATSUM},
            Selection(energy=("inernal energy",)),
            "did you mean 'internal energy'",
        ),
        (
            {"glstat": GLSTAT},
            Selection(energy=("time step", "Time Step")),
            "an energy is given twice",
        ),
        (
            {"glstat": GLSTAT.replace(b" internal energy", b" infernal energy")},
            Selection(),
            "glstat: no internal energy; choose with `energy`: time step",
        ),
    ],
)
def test_what_is_not_there_is_refused_with_what_there_is(
    files: Mapping[str, bytes], selection: Selection, reason: str
) -> None:
    with pytest.raises(FormatError, match=reason):
        open_companions(files, selection).history(selection)


def test_times_at_random_are_refused_in_every_format(tmp_path: Path) -> None:
    file = tmp_path / "history"
    for content in (
        make_glstat_text([5, 1, 4, 2, 3], np.ones(5)),
        make_matsum_text([5, 1, 4, 2, 3], [7], np.ones((5, 1))),
    ):
        file.write_bytes(content)
        with pytest.raises(FormatError, match="time steps back at 2 of 4 states"):
            open_run([str(file)]).history(Selection())


def test_a_time_column_is_no_choice_where_there_is_one_only(tmp_path: Path) -> None:
    file = put(tmp_path / "history", GLSTAT)
    assert (
        open_run([str(file)], Selection(time="Time")).history(Selection()).time.tolist()
        == TIMES.tolist()
    )
    with pytest.raises(
        FormatError,
        match="no time 'cycle' in glstat, the time is 'time'; leave `time` out",
    ):
        open_run([str(file)], Selection(time="cycle"))


def test_what_is_in_the_files_is_told_where_no_energy_can_be_chosen() -> None:
    """A file without states, and curves none of which is the required one."""
    empty = describe_run(open_contents(glstat, HEAD), Selection())
    assert (empty.states, empty.time_start, empty.sampling, empty.notes) == (
        0,
        None,
        None,
        (),
    )
    begun = describe_run(
        open_contents(radioss_th, bytes(make_t01(0).data)), Selection()
    )
    assert (begun.states, begun.time_start, begun.flights, begun.health) == (
        0,
        None,
        (),
        None,
    )
    curves = describe_run(
        open_contents(csv_table, "2\n1 'a IE'\n0,1\n1,2\n2 'b IE'\n0,1\n2,3\n3,4\n"),
        Selection(),
    )
    assert (curves.states, curves.channels) == (None, ("a IE", "b IE"))
    assert (
        "2 curves are named like an internal energy; choose with `energy`: 1 'a IE', 2 'b IE'"
        in curves.notes[0]
    )
    doubtful = open_companions(
        {
            "glstat": GLSTAT,
            "matsum": make_matsum_text(TIMES + 0.01, [7, 3], np.ones((8, 2))),
        }
    )
    assert "are they from the same run?" in describe_run(doubtful, Selection()).notes[0]


@pytest.mark.parametrize("share", [0.3, 0.7, 0.999])
def test_packed_data_that_ends_early_is_read_as_far_as_it_goes(
    tmp_path: Path, share: float
) -> None:
    whole = (SAMPLES / "energy.glstat").read_bytes()
    packed = gzip.compress(whole)
    file = put(tmp_path / "glstat.gz", packed[: int(share * len(packed))])
    history, full = (
        read_history([str(file)]),
        read_history([str(SAMPLES / "energy.glstat")]),
    )
    assert not history.complete
    assert "ends early" in history.notes[0]
    assert 0 < history.time.size <= full.time.size
    assert history.energy.tolist() == full.energy[: history.time.size].tolist()


def test_a_long_gap_between_legs_is_told() -> None:
    legs = [locate_stored(f"rollover_r100_{leg}.gz") for leg in ("T01", "T03")]
    assert any(
        "no states between 0.0999564 and 0.370008: a restart segment may be missing"
        in note
        for note in open_run(legs).history(Selection()).notes
    )


def masses(path: Path) -> Samples | None:
    return open_run([str(path)], Selection()).masses


def write_matsum(
    path: Path, parts: dict[int, tuple[float, float]], states: int = 4
) -> Path:
    """Write a matsum of parts with momentum and velocity along y at the end, half of both in the middle, and so on."""
    text = make_matsum_head([*parts]).decode()
    for state in range(states):
        text += f" time ={0.1 * state:13.4E}\n"
        for id_, (momentum, velocity) in parts.items():
            block = make_matsum_part(id_, 1.0 + state).decode()
            for name, number in (("y-mom", momentum), ("y-rbv", velocity)):
                block = block.replace(
                    f"{name}={ZERO}", f"{name}={number * state / states:13.4E}"
                )
            text += block
    path.write_text(text)
    return path


def test_of_a_matsum_they_are_momentum_over_velocity(tmp_path: Path) -> None:
    masses_read = masses(
        write_matsum(
            tmp_path / "matsum",
            {1: (30.0, 2.0), 2: (-4.0, -5.0), 7: (0.0, 0.0), 9: (6.0, 0.0)},
        )
    )
    assert masses_read is not None
    assert masses_read[:3] == pytest.approx([15.0, 0.8, 0.0], rel=1e-4)
    assert np.isnan(masses_read[3])  # from a solver that does not write velocities


def test_of_a_time_history_they_are_written(tmp_path: Path) -> None:
    (tmp_path / "RUNT01").write_bytes(
        make_t01(3, (MadePart(3, "box"), MadePart(12, "step"))).data
    )
    assert masses(tmp_path / "RUNT01") == pytest.approx(
        [make_value(1, 3, 6), make_value(1, 12, 6)]
    )  # the middle of all states is not the middle of the states with a mass
    (tmp_path / "ENERGYT01").write_bytes(
        make_t01(3, (MadePart(3, "box", codes=(1, 2)),)).data
    )
    assert masses(tmp_path / "ENERGYT01") is None
    (tmp_path / "MOTIONT01").write_bytes(
        make_t01(3, (MadePart(3, "box", codes=(1, 3, 4, 5)),)).data
    )
    assert masses(tmp_path / "MOTIONT01") is None
