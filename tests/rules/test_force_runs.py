"""Force sensors in 20 runs of OpenRadioss: plates that bounce on a contact or on a rigid wall.

Half of the histories have the force of the contact or wall, the others only the momenta of the plate.  Runs only where
OPENRADIOSS_PATH names an installation of OpenRadioss; takes some minutes.
"""

import random
import re
from pathlib import Path
from typing import NamedTuple

import pytest

import d2rpick as d2
from d2rpick.choice.question import Settings
from d2rpick.histories.names import Selection
from d2rpick.rules import check_deck
from d2rpick.rules.judgement import HistoryJudge
from tests.deck.test_openradioss import run_solver
from tests.decks import pad

WIDE = 20  # columns of a real number
MAIN, SENSOR, ENTITY, END, INTERVAL = 9999, 5, 3, 0.25, 5e-4
GAP = 0.002  # gap of the contact
_CELLS = 3  # cells of the plate along each side


class Bounce(NamedTuple):
    """A plate that falls on the ground: its speed, height, slope, modulus and thickness, and Tdelay of the sensor.

    ``forces``: the history has the force of the contact or wall.
    """

    wall: bool
    forces: bool
    speed: float
    height: float
    slope: float
    modulus: float
    thickness: float
    wait: float


def generate_bounces() -> list[Bounce]:
    random.seed(5)
    generated = []
    for number in range(20):
        speed, height = (
            round(random.uniform(0.3, 2.0), 2),
            round(random.uniform(0.005, 0.03), 4),
        )
        slope, modulus = (
            round(random.uniform(0.0, 0.15), 3),
            random.choice([2e8, 2e9, 2e10]),
        )
        thickness, wait = (
            random.choice([0.01, 0.02]),
            round(random.uniform(0.004, 0.03), 4),
        )
        generated.append(
            Bounce(
                number % 2 == 1,
                number % 4 < 2,
                speed,
                height,
                slope,
                modulus,
                thickness,
                wait,
            )
        )
    return generated


def write_reals(*values: float) -> str:
    return pad(*values, width=WIDE)


def write_bounce_deck(run: Bounce, *, switched: bool) -> str:
    """Write the starter deck, whose body has the sensor if the run is ``switched``."""
    corners = range(_CELLS + 1)
    nodes = {(i, j): 1 + i * (_CELLS + 1) + j for i in corners for j in corners}
    text = f"#RADIOSS STARTER\n/BEGIN\nX\n{pad(2023, 0)}" + 2 * pad(
        "kg", "m", "s", width=WIDE
    )
    text += f"/TITLE\nplate\n/MAT/ELAST/1\nsteel\n{write_reals(7850.0)}{write_reals(run.modulus, 0.3)}"
    text += f"/PROP/SHELL/1\nshell\n{pad(24, 0, 0, 0)}\n{pad(3, 0)[:-1]}{write_reals(run.thickness)}/NODE\n"
    for (i, j), node in nodes.items():
        x, y = i / _CELLS, j / _CELLS
        text += pad(node)[:-1] + write_reals(x, y, run.height + GAP + run.slope * x)
    text += (
        pad(MAIN)[:-1]
        + write_reals(0.5, 0.5, run.height + 0.2)
        + f"/PART/1\nplate\n{pad(1, 1)}/SHELL/1\n"
    )
    cells = [(i, j) for i in range(_CELLS) for j in range(_CELLS)]
    for number, (i, j) in enumerate(cells, start=1):
        text += pad(
            number, nodes[i, j], nodes[i + 1, j], nodes[i + 1, j + 1], nodes[i, j + 1]
        )
    node_ids = [*nodes.values(), MAIN]
    text += f"/GRNOD/PART/1\nplate\n{pad(1)}/GRNOD/NODE/6\nall\n"
    text += "".join(pad(*node_ids[at : at + 10]) for at in range(0, len(node_ids), 10))
    text += f"/INIVEL/TRA/1\nthrown\n{write_reals(0.0, 0.0, -run.speed)[:-1]}{pad(6)}"
    text += f"/FUNCT/1\ngravity\n{write_reals(0.0, -9.81)}{write_reals(10.0, -9.81)}"
    text += f"/GRAV/1\ngravity\n{pad(1, 'Z', 0, 0, 6)[:-1]}{write_reals(1.0, 1.0)}"
    text += write_wall() if run.wall else write_contact()
    kind = "RWALL" if run.wall else "INTER"
    force = pad(ENTITY, "NF")[:-1] + write_reals(-1.0, 0.0, 0.0)
    text += f"/SENSOR/{kind}/{SENSOR}\nforce\n{write_reals(run.wait)}{force}"
    text += f"/RBODY/1\nbody\n{pad(MAIN, SENSOR * switched, 0, 0)[:-1]}{write_reals(0.0)[:-1]}{pad(1, 1, 0, 0)}"
    text += 2 * write_reals(0.0, 0.0, 0.0) + pad(0, 0, 0)
    text += f"/TH/PART/1\nparts\nDEF       XMOM      YMOM      ZMOM      MASS\n{pad(1)}"
    if run.forces:
        text += f"/TH/{kind}/2\nforces\nDEF\n{pad(ENTITY)}"
    return f"{text}/END\n"


def write_wall() -> str:
    plane = write_reals(0.0, 0.0, 0.0) + write_reals(0.0, 0.0, 1.0)
    return f"/RWALL/PLANE/{ENTITY}\nground\n{pad(0, 0, 1, 0)}{write_reals(0.0)}{plane}"


def write_contact() -> str:
    corners = ((-1.0, -1.0), (2.0, -1.0), (2.0, 2.0), (-1.0, 2.0))
    ids = range(1001, 1005)
    text = "/NODE\n" + "".join(
        pad(node)[:-1] + write_reals(*corner, 0.0)
        for node, corner in zip(ids, corners, strict=True)
    )
    text += f"/PART/2\nground\n{pad(1, 1)}/SHELL/2\n{pad(900, *ids)}/GRNOD/NODE/2\nground\n{pad(*ids)}"
    text += f"/BCS/1\nfixed\n   111 111{pad(0, 2)}/SURF/PART/7\nground\n{pad(2)}"
    text += f"/INTER/TYPE7/{ENTITY}\nplate on ground\n{pad(1, 7, 4, 0, 0)}{pad('', 0, 0, 0, 0)}"
    text += 2 * write_reals(0.0, 0.0) + write_reals(1.0, 0.0, GAP, 0.0, 0.0)
    return (
        text
        + f"{'000':>10}{'':10}{0:10d}{write_reals(0.05, 0.0, 0.0)}{pad(0, 0)[:-1]}{write_reals(0.0)[:-1]}{pad(0)}"
    )


def read_listed_windows(folder: Path) -> list[tuple[float, float]]:
    """Return the spans in which the sensor is inactive according to the listing."""
    ends, now = [0.0], 0.0
    for line in (folder / "X_0001.out").read_text("latin-1").splitlines():
        if cycle := re.match(r"\s+\d+\s+([\d.E+-]+)\s+[\d.E+-]+ [A-Z]+ ", line):
            now = float(cycle[1])
        elif event := re.search(
            rf"SENSOR \(\w+\) NUMBER +{SENSOR} ,?(DE)?ACTIVATED AT TIME +([\d.E+-]+)",
            line,
        ):
            time = float(event[2])
            ends.append(time if time < END else now)
    return list(zip(ends[::2], [*ends[1::2], END][: len(ends[::2])], strict=True))


def is_met(window: tuple[float, float], windows: list[tuple[float, float]]) -> bool:
    """Return True if another window has the same ends to within an output interval of the history."""
    return any(
        window == pytest.approx(other_window, abs=INTERVAL) for other_window in windows
    )


@pytest.mark.parametrize("run", generate_bounces())
def test_the_sensor_switches_as_often_as_momenta_say(
    tmp_path: Path, run: Bounce
) -> None:
    """In the reference run, the sensor switches nothing, so its listing shows when it would have switched."""
    reference, switched = tmp_path / "reference", tmp_path / "switched"
    engine = f"/RUN/X/1\n{END}\n/VERS/2023\n/DT\n0.9 0.0\n{{}}/DTIX\n2e-05 2e-05\n/TFILE/4\n{INTERVAL}\n/PRINT/-1\n"
    for folder, off_cards in ((reference, f"/RBODY/OFF\n{MAIN}\n"), (switched, "")):
        folder.mkdir()
        (folder / "X_0000.rad").write_text(
            write_bounce_deck(run, switched=folder is switched)
        )
        (folder / "X_0001.rad").write_text(engine.format(off_cards))
    run_solver(reference, "X")
    judge = HistoryJudge(d2.read(reference / "XT01").files, Selection(), Settings())
    windows = check_deck(str(switched / "X_0000.rad"), judge=judge).windows
    predicted = [
        (window.tr, END if window.td is None else window.td) for window in windows
    ]
    listed = read_listed_windows(reference)
    for windows_a, windows_b in ((predicted, listed), (listed, predicted)):
        # A window shorter than an interval may lie between two states of the history. Momenta do not show a force
        # that is small relative to the weight.
        shortest = INTERVAL if run.forces else 3 * INTERVAL
        lasting = [(tr, td) for tr, td in windows_a if td - tr > shortest]
        assert lasting
        assert all(is_met(window, windows_b) for window in lasting)
