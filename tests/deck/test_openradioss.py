"""Printed engine files run to the end with the real solver, and the parts are rigid in the windows.

These tests run only if OPENRADIOSS_PATH names an installation of OpenRadioss, and take some seconds.
"""

import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

import d2rpick as d2
from d2rpick.deck.printed_card import Printing
from d2rpick.deck.printing import print_cards
from d2rpick.deck.writing import write_deck
from d2rpick.histories.opening import Selection, open_run
from d2rpick.rules import check_deck
from tests.decks import pad

MAIN, END = 99, 0.02
ENGINE = f"""\
/RUN/strip/1
{END}
/VERS/2022
/DT
0.9 0.0
/RBODY/OFF
{MAIN}
/INIV/TRA/Z/2
5.0
2
/TFILE/4
2e-05
/PRINT/-1000
"""


WIDE = 20  # columns of a real number


def write_starter() -> str:
    """Return a strip of four shells with a velocity at one end; SI units."""
    nodes = [(2 * i + j + 1, 0.1 * i, 0.1 * j) for i in range(5) for j in range(2)]
    text = f"#RADIOSS STARTER\n/BEGIN\nstrip\n{pad(2022, 0)}" + 2 * pad(
        "kg", "m", "s", width=WIDE
    )
    text += f"/TITLE\nstrip of shells\n/MAT/ELAST/1\nsteel\n{pad(7850.0, width=WIDE)}{pad(2.1e11, 0.3, width=WIDE)}"
    text += f"/PROP/SHELL/1\nshell\n{pad(24, 0, 0, 0)}{pad(*5 * [0.0], width=WIDE)}"
    text += f"{pad(3, 0)[:-1]}{pad(0.002, 0.0, width=WIDE)[:-1]}{'':10}{pad(1, 1)}"
    text += f"/PART/1\nstrip\n{pad(1, 1)}/NODE\n"
    text += "".join(pad(node)[:-1] + pad(x, y, 0.0, width=WIDE) for node, x, y in nodes)
    text += pad(MAIN)[:-1] + pad(0.2, 0.05, 0.01, width=WIDE)
    text += "/SHELL/1\n" + "".join(
        pad(i + 1, 2 * i + 1, 2 * i + 3, 2 * i + 4, 2 * i + 2) for i in range(4)
    )
    text += f"/GRNOD/NODE/1\nstrip\n{pad(*(node for node, _, _ in nodes))}/GRNOD/NODE/2\nend\n{pad(1, 2)}"
    text += f"/RBODY/1\nstrip\n{pad(MAIN, 0, 0, 0)[:-1]}{pad(0.0, width=WIDE)[:-1]}{pad(1, 0, 0, 0)}"
    text += 2 * pad(0.0, 0.0, 0.0, width=WIDE) + pad(0, 0, 0)
    return text + f"/TH/PART/1\nparts\nDEF       MASS\n{pad(1)}/END\n"


def run_solver(folder: Path, name: str) -> None:
    """Run the starter and all engine files; the test is skipped if there is no solver."""
    home = os.environ.get("OPENRADIOSS_PATH")
    if not home:
        pytest.skip(
            "OPENRADIOSS_PATH names no installation of OpenRadioss; set it to run the printed cards"
        )
    programs = [
        path
        for kind in ("starter", "engine")
        for path in (
            Path(home, "bin", f"{kind}_gf"),
            Path(home, "exec", f"{kind}_linux64_gf"),
        )
        if path.exists()
    ]
    assert len(programs) == 2, f"no starter and engine in {home}"
    libraries = os.pathsep.join(
        str(Path(home, part)) for part in ("exec", "syslib", "extlib/hm_reader/linux64")
    )
    environment = {
        **os.environ, "RAD_CFG_PATH": str(Path(home, "hm_cfg_files")), "LD_LIBRARY_PATH": libraries,
        "OMP_STACKSIZE": "400m", "OMP_NUM_THREADS": "1",
    }  # fmt: skip
    calls = [(programs[0], ["-i", f"{name}_0000.rad", "-np", "1", "-nt", "1"])]
    calls += [
        (programs[1], ["-i", path.name, "-nt", "1"])
        for path in sorted(folder.glob(f"{name}_000[1-9].rad"))
    ]
    for program, arguments in calls:
        script = 'ulimit -s unlimited; exec "$@"'
        result = subprocess.run(
            ["bash", "-c", script, "bash", str(program), *arguments],
            cwd=folder, env=environment, capture_output=True, text=True, check=False,
        )  # fmt: skip
        ended = ("NORMAL TERMINATION", "TERMINATION WITH WARNING")
        assert any(words in result.stdout for words in ended), (
            result.stdout[-2000:] + result.stderr
        )


@pytest.mark.parametrize(
    ("windows", "vibrates"),
    [
        ([(0.004, 0.012)], True),
        ([(0.003, 0.006), (0.009, 0.014)], True),
        ([(0.0, 0.005)], False),
    ],
    ids=["one", "two", "from 0: then nothing ever deforms the strip"],
)
def test_printed_legs_run_to_the_end_and_are_rigid_in_their_windows(
    tmp_path: Path, windows: list[tuple[float, float]], vibrates: bool
) -> None:
    reference, switched = tmp_path / "reference", tmp_path / "switched"
    reference.mkdir()
    (reference / "strip_0000.rad").write_text(write_starter())
    (reference / "strip_0001.rad").write_text(ENGINE)
    card = print_cards(
        windows, Printing(node=(MAIN,), end=END, name="strip", solver="radioss")
    )
    main, *legs = write_deck(str(reference / "strip_0000.rad"), card, str(switched))
    checked = check_deck(main)
    assert [finding.rule for finding in checked.findings] == (
        [] if vibrates else ["D2R407"]
    )  # the velocity does not move its main node
    assert [(window.part, window.tr, window.td) for window in checked.windows] == [
        (1, *times) for times in windows
    ]
    run_solver(switched, "strip")
    histories = sorted(map(str, switched.glob("stripT0?")))
    assert len(histories) == len(legs)
    history = open_run(histories).history(Selection(parts=("1",)))
    assert history.time[-1] == pytest.approx(END, abs=4e-5)
    inside = np.zeros(history.time.size, dtype=bool)
    for tr, td in windows:
        held = (history.time > tr + 4e-5) & (history.time < td - 4e-5)
        assert held.sum() > 50
        assert (
            np.ptp(history.energy[held]) <= 1e-9 * history.energy.max()
        )  # the locked-in energy stays constant
        inside |= held
    assert (
        bool(np.ptp(history.energy[~inside]) > 0.5 * history.energy.max()) == vibrates
    )
    assert (history.energy.max() > 0.1) == vibrates  # [J]


def test_sensors_switch_in_one_run_as_legs_do(tmp_path: Path) -> None:
    """Before tr, all states equal those of the reference run bit by bit; in the windows, nothing deforms."""
    windows, reference = [(0.003, 0.006), (0.009, 0.014)], tmp_path / "reference"
    reference.mkdir()
    (reference / "strip_0000.rad").write_text(write_starter())
    (reference / "strip_0001.rad").write_text(ENGINE)
    energies = {}
    for solver in ("radioss", "radioss-sensors"):
        # the limit of the only run also applies while it is deformable, with a time step of 1.7e-5
        card = print_cards(
            windows,
            Printing(
                node=(MAIN,), end=END, name="strip", step_cap=2.5e-5, solver=solver
            ),
        )
        main = write_deck(
            str(reference / "strip_0000.rad"), card, str(tmp_path / solver)
        )[0]
        assert [
            (window.tr, window.td) for window in check_deck(main).windows
        ] == windows
        run_solver(tmp_path / solver, "strip")
        histories = sorted(map(str, (tmp_path / solver).glob("stripT0?")))
        energies[solver] = open_run(histories).history(Selection(parts=("1",)))
    run_solver(reference, "strip")
    plain = open_run([str(reference / "stripT01")]).history(Selection(parts=("1",)))
    for history in energies.values():
        leg_energies = int(np.searchsorted(history.time, windows[0][0] - 4e-5))
        assert leg_energies > 50
        np.testing.assert_array_equal(
            history.energy[:leg_energies], plain.energy[:leg_energies]
        )
        for (
            tr,
            td,
        ) in (
            windows
        ):  # the time step of the switch differs, and so does the locked-in energy
            held = history.energy[
                (history.time > tr + 6e-5) & (history.time < td - 6e-5)
            ]
            assert held.size > 50
            assert np.ptp(held) <= 1e-9 * history.energy.max()


def test_a_first_run_switches_itself_at_the_same_step_twice(tmp_path: Path) -> None:
    """The strip flies 20 mm to a wall at 5 m/s; it is rigid after the wait, and released by the force of the wall."""
    head, _, body_lines = write_starter().partition("/RBODY/1")
    reals = [
        pad(*row, width=WIDE)
        for row in ((0.0, 0.0, 0.0), (0.0, 0.0, -0.02), (0.0, 0.0, 1.0))
    ]
    wall = f"/GRNOD/NODE/5\nall\n{pad(*range(1, 11))}/RWALL/PLANE/8\nground\n{pad(0, 0, 5, 0)}{''.join(reals)}"
    thrown = f"/INIVEL/TRA/3\nthrown\n{pad(0.0, 0.0, -5.0, width=WIDE)[:-1]}{pad(5)}"
    reference = tmp_path / "reference"
    reference.mkdir()
    (reference / "strip_0000.rad").write_text(
        f"{head}{wall}{thrown}{body_lines[body_lines.index('/TH/PART') :]}"
    )
    (reference / "strip_0001.rad").write_text(
        f"/RUN/strip/1\n{END}\n/VERS/2022\n/DT\n0.9 0.0\n/TFILE/4\n2e-05\n"
    )
    ends = []
    for name in ("one", "other"):
        d2.first(reference / "strip_0000.rad", tmp_path / name, parts=1, wait=0.003)
        run_solver(tmp_path / name, "strip")
        times = [
            open_run([str(tmp_path / name / f"stripT0{leg}")]).history(Selection()).time
            for leg in (1, 2, 3)
        ]
        ends.append([time[-1] for time in times])
    assert ends[0] == ends[1]
    assert ends[0] == [pytest.approx(stop, abs=5e-5) for stop in (0.003, 0.004, END)]
