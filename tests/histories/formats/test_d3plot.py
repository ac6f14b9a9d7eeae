"""d3plot and d3thdt files made by the writer of the tests."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from d2rpick import read, suggest
from d2rpick.base.errors import ChangedError, FormatError
from d2rpick.histories.formats.d3plot import open_legs, recognises
from d2rpick.histories.opening import Selection, Source, open_run, open_sources
from d2rpick.histories.source import open_files
from tests.made_d3plot import D3plotWriter, State, make_states
from tests.text_files import make_glstat_text, make_matsum_text

if TYPE_CHECKING:
    from collections.abc import Mapping

    from d2rpick.histories.run import OpenedRun

TIMES = [0.0, 0.5, 1.0, 1.5, 2.0]
STATES = make_states(TIMES)

# Optional contents of a d3plot: control words, sections of the geometry, and further words of a state.
LAYOUTS = {
    "rigid shells": ({"ndim": 5, "maxint": 3}, {"control": [1, 2, 24, 20]}, -9),
    "fluid materials": ({"ialemat": 2}, {"control": [1, 2]}, 0),
    "particles": (
        {"nmsph": 2},
        {"control": [11, 1, 1, 6, 1, 1, 1, 1, 6, 1, 2], "ids": [1, 1, 2, 1]},
        2 * 22,
    ),
    "older particles": (
        {"nmsph": 2},
        {"control": [10, 1, 1, 6, 1, 1, 1, 1, 6, 1], "ids": [1, 1, 2, 1]},
        2 * 20,
    ),
    "airbags": (
        {"npefg": 4001},
        {"control": [4, 14, 3, 2, 1, *[1] * 20, *[65] * 160], "ids": [1, 3, 1, 1]},
        1 * 2 + 3 * 14,
    ),
    "temperatures": ({"it": 13}, {}, 5 * 7),
    "rates": ({"idtdt": 11}, {}, 5 * 7),
    "ten nodes": ({"nel8": -2}, {"elements": [1] * 4}, 0),
    "ten nodes behind the ids": ({"nel8": -2}, {"ids": [1] * 4}, 0),
    "rigid bodies": ({"ndim": 8}, {"ids": [2, 1, 3, 1, 2, 3, 1, 1, 2, 0, 0]}, 2 * 24),
    "few values of rigid bodies": (
        {"ndim": 9},
        {"ids": [1, 1, 1, 1, 0, 1, 1, 1, 0, *[0] * 4, 9, 1, *[0] * 4]},
        18,
    ),
    "a road": ({"ndim": 6}, {"ids": [2, 3, 1, 0, *[1] * 8, 9, 3, *[1] * 12]}, 6),
    "adapted elements": ({"nadapt": 2}, {"ids": [1] * 4}, 0),
    "shells of eight nodes": ({"nel48": 2}, {"ids": [1] * 10}, 0),
    "solids of twenty nodes": ({"nel20": 1}, {"ids": [1] * 13}, 0),
    "full quadratic solids": ({"nel27": 1, "quadr": 1}, {"ids": [1] * 28}, 0),
    "cubic solids": ({"nel20t": 1, "cubic": 1}, {"ids": [1] * 21}, 0),
    "heat of solids": ({"nt3d": 3}, {}, 2 * 3),
    "depths and energies of contacts": ({"penout": 2, "engout": 1}, {}, 5 * 3),
    "nodes that are deleted": ({"maxint": -3}, {}, 0),
    "nothing that is deleted": ({"maxint": 3}, {}, 0),
}
GLSTAT = make_glstat_text(TIMES, [sum(state.internal) for state in STATES])


def put(folder: Path, files: Mapping[str, bytes]) -> Path:
    folder.mkdir(exist_ok=True)
    for name, content in files.items():
        (folder / name).write_bytes(content)
    return folder / next(iter(files))


def open_family(folder: Path, files: Mapping[str, bytes]) -> OpenedRun:
    return open_run([str(put(folder, files))])


def assert_holds(
    run: OpenedRun, expected: list[State], ids: tuple[int, ...] = (7, 3)
) -> None:
    """Assert that a run has these states, in the precision of the file."""
    (database,) = run.databases
    rounded = np.float32 if database.precisions(())[0].digits == 7 else np.float64

    def same(found: object, values: object) -> None:
        np.testing.assert_array_equal(found, np.asarray(values, rounded).astype(float))

    same(database.time, [state.time for state in expected])
    same(database.channel("kinetic_energy"), [sum(state.kinetic) for state in expected])
    same(
        database.channel("internal_energy"), [sum(state.internal) for state in expected]
    )
    same(database.channel("z_velocity"), [state.model[2] for state in expected])
    assert tuple(part.id for part in database.parts) == ids
    for name, values in {
        "internal_energy": [state.internal for state in expected],
        "kinetic_energy": [state.kinetic for state in expected],
        "mass": [state.masses for state in expected],
        "hourglass_energy": [state.hourglass for state in expected],
        "y_rbvelocity": [np.asarray(state.velocities)[:, 1] for state in expected],
    }.items():
        same(database.part_channel(name, ids), values)
        same(database.part_channel(name, ids[::-1]), np.asarray(values)[:, ::-1])
    momenta = [np.asarray(state.velocities)[:, 2] * state.masses for state in expected]
    np.testing.assert_allclose(
        database.part_channel("z_momentum", ids), momenta, rtol=2e-7
    )


@pytest.mark.parametrize("width", [4, 8])
@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize("per_file", [1, 2, 5])
def test_every_state_of_a_family_is_read(
    width: int, order: str, per_file: int, tmp_path: Path
) -> None:
    run = open_family(tmp_path, D3plotWriter(width, order).written(STATES, per_file))
    assert_holds(run, STATES)
    assert run.databases[0].complete
    assert not run.notes
    assert [part.title for part in run.parts] == ["roof", "door"]
    assert run.sources == (str(tmp_path / "d3plot"),)
    assert run.databases[0].title == "made for a test"
    assert run.databases[0].version == "LS-DYNA R920"


@pytest.mark.parametrize("width", [4, 8])
def test_states_may_follow_the_titles_in_the_first_file(
    width: int, tmp_path: Path
) -> None:
    writer = D3plotWriter(width)
    files = {"d3plot": writer.together(STATES[:2]), "d3plot01": writer.file(STATES[2:])}
    assert_holds(open_family(tmp_path, files), STATES)


def test_files_are_ordered_by_number_and_left_out_numbers_are_told(
    tmp_path: Path,
) -> None:
    writer = D3plotWriter()
    names = ["d3plot01", "d3plot02", "d3plot10", "d3plot11", "d3plot100"]
    files = {
        "d3plot": writer.head(),
        **{
            name: writer.file([state])
            for name, state in zip(names, STATES, strict=True)
        },
    }
    run = open_family(tmp_path, files)
    assert_holds(run, STATES)
    assert not run.databases[0].complete
    assert "of the files after it 03 to 09, 12 to 99 are not there" in run.notes[0]


@pytest.mark.parametrize("width", [4, 8])
def test_a_family_cut_at_every_byte_gives_its_whole_states(width: int) -> None:
    writer = D3plotWriter(
        width, control={"numnp": 1, "nel8": 0, "nel2": 0, "nelt": 0, "nv2d": 3}
    )
    length, content = (
        len(writer.state(STATES[0])),
        writer.file(STATES[:3]).rstrip(b"\0"),
    )
    first = Source("d3plot", writer.head())
    for end in range(len(content)):
        (leg,) = open_legs([first, Source("d3plot01", content[:end])], Selection())
        whole = end // length
        assert leg.time.tolist() == TIMES[:whole]
        assert not leg.complete
        assert "d3plot01: the file ends" in leg.notes[0]


def test_a_first_file_cut_at_every_byte_is_refused_or_has_no_state() -> None:
    content = D3plotWriter().head()
    for end in range(1, len(content)):
        try:
            legs = open_legs([Source("d3plot", content[:end])], Selection())
        except FormatError:
            continue
        assert not legs or legs[0].time.size == 0


def test_a_state_cut_in_a_file_that_others_follow_is_left_out(tmp_path: Path) -> None:
    files = D3plotWriter().written(STATES, 2)
    files["d3plot01"] = files["d3plot01"][: len(D3plotWriter().state(STATES[0])) + 40]
    run = open_family(tmp_path, files)
    assert_holds(run, [STATES[0], *STATES[2:]])
    assert run.notes == (
        f"{tmp_path / 'd3plot01'}: the file ends within state 2, which was left out; is the run still writing?",
    )
    assert not run.databases[0].complete


def test_a_run_that_still_writes_gives_more_each_time(tmp_path: Path) -> None:
    writer = D3plotWriter()
    first, last = (
        put(tmp_path, {"d3plot": writer.filled(writer.head())}),
        tmp_path / "d3plot01",
    )
    run = open_run([str(first)])
    assert run.databases[0].time.size == 0
    for count in range(1, len(STATES) + 1):
        last.write_bytes(writer.file(STATES[:count], ended=False).rstrip(b"\0"))
        run = open_run([str(first)])
        assert_holds(run, STATES[:count])
        assert not run.databases[0].complete
    last.write_bytes(writer.file(STATES))
    assert open_run([str(first)]).databases[0].complete


def test_a_restart_writes_states_anew_and_the_newer_count(tmp_path: Path) -> None:
    writer, later = D3plotWriter(), make_states([0.75, 2.0, 3.0])
    files = {
        "d3plot": writer.head(),
        "d3plot01": writer.file(STATES[:3]),
        "d3plot02": writer.file(later),
    }
    run = open_family(tmp_path, files)
    assert run.databases[0].time.tolist() == [0.0, 0.5, 0.75, 2.0, 3.0]
    assert any("newer" in note for note in run.notes)


@pytest.mark.parametrize("name", ["R712", " R12"])
def test_rigid_walls_have_their_forces(name: str, tmp_path: Path) -> None:
    """All releases with such a name have the number 960, but the states contain positions of rigid walls."""
    run = open_family(
        tmp_path,
        D3plotWriter(walls=2, name=name).written(make_states(TIMES, walls=2), 2),
    )
    assert_holds(run, STATES)
    for wall in (1, 2):
        forces = run.databases[0].channel(f"rigid_wall_{wall}_force")
        assert forces.tolist() == [7.0 * number + wall - 1 for number in range(1, 6)]


def test_parts_that_were_deleted_keep_their_place(tmp_path: Path) -> None:
    """A deleted part has neither mass nor energy, even if the file still contains a velocity for it."""
    gone = State(
        2.5,
        [4.0, 0.0],
        [5.0, 0.0],
        [[1.0, 2.0, 3.0], [9.0, 9.0, 9.0]],
        [2.0, 0.0],
        [0.0, 0.0],
        [0, 0, 0],
    )
    run = open_family(tmp_path, D3plotWriter().written([*STATES, gone], 3))
    assert_holds(run, [*STATES, gone])
    assert run.databases[0].part_channel("x_momentum", [3])[-1, 0] == 0


@pytest.mark.parametrize("kind", LAYOUTS)
def test_what_a_model_has_besides_is_passed_over(kind: str, tmp_path: Path) -> None:
    control, sections, words_after_state = LAYOUTS[kind]
    writer = D3plotWriter(
        control=control, sections=sections, more_of_state=words_after_state
    )
    assert_holds(open_family(tmp_path, writer.written(STATES, 2)), STATES)


def test_a_d3thdt_is_read_by_itself_and_before_a_d3plot(tmp_path: Path) -> None:
    often = make_states([0.1 * number for number in range(30)])
    run = open_family(tmp_path, D3plotWriter(family=3).written(often, 4, "d3thdt"))
    assert_holds(run, often)
    assert run.databases[0].format == "d3thdt"
    put(tmp_path, D3plotWriter().written(STATES))
    assert open_run([str(tmp_path)]).databases[0].time.size == len(often)


@pytest.mark.parametrize("release", [960.0, 971.0])
def test_older_files_have_fewer_values(release: float, tmp_path: Path) -> None:
    """Before release 971 a rigid wall has only its force; even older files have no hourglass energy of parts."""
    old_states = [
        State(
            **{
                **vars(state),
                "walls": [3.0, 4.0] if release < 971 else [3.0, 4.0, *[0.0] * 6],
            }
        )
        for state in STATES
    ]
    run = open_family(
        tmp_path,
        D3plotWriter(walls=2, name="    ", release=release).written(old_states),
    )
    assert run.databases[0].channel("rigid_wall_2_force").tolist() == [4.0] * 5
    old_states = [State(**{**vars(state), "hourglass": []}) for state in STATES]
    run = open_family(
        tmp_path / "older", D3plotWriter(values_of_part=6).written(old_states)
    )
    assert run.databases[0].part_channel("mass", [3])[:, 0].tolist() == [5.0] * 5
    with pytest.raises(FormatError, match="no hourglass_energy of parts"):
        run.databases[0].part_channel("hourglass_energy", [3])


def test_parts_without_a_list_of_ids_have_those_of_their_titles(tmp_path: Path) -> None:
    run = open_family(tmp_path, D3plotWriter(numbered=False).written(STATES))
    assert_holds(run, STATES)
    run = open_family(
        tmp_path / "untitled", D3plotWriter(numbered=False, titles=()).written(STATES)
    )
    assert [part.id for part in run.parts] == [1, 2]


def test_values_that_fit_no_number_of_parts_are_not_given_to_parts(
    tmp_path: Path,
) -> None:
    run = open_family(
        tmp_path, D3plotWriter(control={"nglbv": 19}, more_of_state=-1).written(STATES)
    )
    assert run.databases[0].channel("kinetic_energy").size == 5
    with pytest.raises(
        FormatError, match="13 values for 2 parts, which cannot be told apart"
    ):
        run.part_energies(())


def test_states_of_another_length_than_the_head_says_are_refused(
    tmp_path: Path,
) -> None:
    files = D3plotWriter(more_of_state=5).written(STATES, 5)
    reason = r"d3plot01: its states are \d+ bytes together, one of \d+ bytes each by the head; that layout is not known"
    with pytest.raises(FormatError, match=reason):
        open_family(tmp_path, files)


def test_times_that_are_none_are_refused(tmp_path: Path) -> None:
    files = D3plotWriter(more_of_state=5).written(STATES, 5)
    files["d3plot01"] = files["d3plot01"].rstrip(b"\0")[
        :-4
    ]  # without the end mark, by which the wrong length of the states would be found first
    with pytest.raises(
        FormatError,
        match=r"d3plot01: a state was expected at byte \d+, with a time above that of the state",
    ):
        open_family(tmp_path, files)


def test_a_geometry_that_does_not_end_where_the_head_says_is_refused(
    tmp_path: Path,
) -> None:
    with pytest.raises(
        FormatError,
        match=r"it has no end of the geometry at byte \d+, where its head says",
    ):
        open_family(tmp_path, D3plotWriter(sections={"ids": [0, 0, 0]}).written(STATES))


def test_ids_that_do_not_fit_their_section_are_refused(tmp_path: Path) -> None:
    with pytest.raises(
        FormatError,
        match=r"it has a section of ids of \d+ words, not of \d+; the file is damaged",
    ):
        open_family(tmp_path, D3plotWriter(control={"narbs": 40}).written(STATES))


def test_packed_families_are_named(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="packed by femzip; unpack it"):
        open_family(
            tmp_path, D3plotWriter(control={"nmmat": 76_893_465}).written(STATES)
        )


def test_a_file_behind_the_first_is_not_read_alone(tmp_path: Path) -> None:
    put(tmp_path, D3plotWriter().written(STATES))
    with pytest.raises(
        FormatError,
        match=r"d3plot02: the first file of its family says what it holds; name .*d3plot,",
    ):
        open_run([str(tmp_path / "d3plot02")])


@pytest.mark.parametrize(
    "names", [["d3plot*"], ["d3plot03", "d3plot", "d3plot01"], ["."]]
)
def test_a_family_is_the_same_however_it_is_named(
    names: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    put(tmp_path, D3plotWriter().written(STATES))
    monkeypatch.chdir(tmp_path)
    run = open_run(names)
    assert_holds(run, STATES)
    assert len(run.files) == 6


def test_a_job_has_its_name_before_that_of_the_family(tmp_path: Path) -> None:
    assert_holds(
        open_family(tmp_path, D3plotWriter().written(STATES, name="run7.d3plot")),
        STATES,
    )


def test_two_families_of_one_run_are_its_legs(tmp_path: Path) -> None:
    first = put(tmp_path / "leg1", D3plotWriter().written(STATES[:3]))
    second = put(
        tmp_path / "leg2", D3plotWriter().written(make_states([1.0, 2.0, 3.0])[1:])
    )
    run = open_run([str(first), str(second)])
    assert run.databases[0].time.tolist() == [0.0, 0.5, 1.0, 2.0, 3.0]


def test_other_files_are_none() -> None:
    head = D3plotWriter().head()
    assert recognises(head[:8192])
    assert not recognises(D3plotWriter(family=3).head()[:8192])
    assert not recognises(D3plotWriter(family=4).head()[:8192])  # forces of interfaces
    assert not any(recognises(head[:end]) for end in range(0, 256, 8))
    assert not recognises(b" " * 8192)


def test_in_a_folder_a_d3plot_gives_what_the_others_leave_out(tmp_path: Path) -> None:
    put(tmp_path, {**D3plotWriter().written(STATES), "glstat": GLSTAT})
    run = open_run([str(tmp_path)])
    assert [database.format for database in run.databases] == ["glstat", "d3plot"]
    assert [part.id for part in run.parts] == [7, 3]
    assert run.history(Selection()).energy_format == "glstat"
    assert run.history(Selection(parts=("7",))).energy_format == "d3plot"
    matsum = make_matsum_text(
        TIMES, [7, 3], np.array([state.internal for state in STATES])
    )
    put(tmp_path, {"matsum": matsum})
    run = open_run([str(tmp_path)])
    assert [database.format for database in run.databases] == ["glstat", "matsum"]
    assert {Path(file.name).name for file in run.files} == {"glstat", "matsum"}


def test_in_a_folder_a_d3plot_that_cannot_be_read_stops_nothing(tmp_path: Path) -> None:
    put(
        tmp_path,
        {
            **D3plotWriter(control={"nmmat": 76_893_465}).written(STATES),
            "glstat": GLSTAT,
        },
    )
    run = open_run([str(tmp_path)])
    assert run.sources == (str(tmp_path / "glstat"),)
    assert run.notes[0].endswith(
        "name the glstat or binout of the run; it was not used"
    )


def test_a_file_that_is_written_anew_meanwhile_is_refused(tmp_path: Path) -> None:
    first = put(tmp_path, D3plotWriter().written(STATES))
    sources = open_files([str(first)])
    (tmp_path / "d3plot02").write_bytes(D3plotWriter().file(STATES)[:-2048])
    with pytest.raises(ChangedError, match=r"d3plot02: the file"):
        open_sources(sources)


def test_more_files_than_a_process_may_have_open_are_read(tmp_path: Path) -> None:
    resource = pytest.importorskip("resource")
    first = put(tmp_path, D3plotWriter().written(make_states(np.arange(80.0).tolist())))
    limits = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (60, limits[1]))
    try:
        assert open_run([str(first)]).databases[0].time.size == 80
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, limits)


@pytest.mark.parametrize(("per_period", "is_told"), [(12, False), (4, True)])
def test_a_level_that_too_few_states_show_is_told(
    per_period: int, is_told: bool, tmp_path: Path
) -> None:
    time = np.arange(60.0)
    energy = 2 + np.cos(2 * np.pi * time / per_period + 0.3)
    states = [
        State(t, [1.0], [e], [[1.0, 0, 0]], [2.0], [0.0], [0, 0, 0])
        for t, e in zip(time, energy, strict=True)
    ]
    first = put(tmp_path, D3plotWriter(ids=(1,), titles=()).written(states, 10))
    suggestion = suggest(read(str(first)), td=40.5, after=3.0)
    messages = [
        caution.message
        for caution in suggestion.cautions
        if caution.code == "few-states"
    ]
    assert bool(messages) == is_told
    if messages:
        assert messages[0].startswith(
            "38 states of the d3plot up to td = 40.5 are too few to show how the energy oscillates"
        )
        assert messages[0].endswith(
            "name a file with more states: d3thdt, glstat, matsum, binout"
        )
