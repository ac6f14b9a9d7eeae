"""Fake solver for tests: a box that is pushed, flies, lands and flies again, computed state by state.

``python fake_solver.py starter|engine DECK`` runs in the folder of a run.  The engine continues from the restart file
of the previous restart segment, writes its own, and prints what OpenRadioss prints.  D2RPICK_FAKE names a fault:
``fail`` ends segment 2 with an error, ``hang`` makes segment 2 sleep, ``slow`` delays each state.  ``empty`` and
``cut`` leave an incomplete restart file of segment 3 once, as a full disk does; with ``damaged`` it only looks
complete.  ``lost`` removes the files that the driver has set aside.
"""

import math
import os
import re
import shutil
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from tests.made_t01 import MadePart, write_head

PUSHES = (
    (0.0, 0.03),
    (0.17, 0.19),
)  # landing of the box; it is slightly later while the box is rigid
LATER, STEP, PACE = 0.002, 1e-3, 0.02
SIZE = 400  # size of a restart file [bytes]
MASS = 10.0
CODES = (1, 2, 3, 4, 5, 6)


def compute_momentum(now_time: float, *, rigid: bool) -> float:
    """Return the momentum of the box along z: the sum of gravity and all pushes."""
    late = LATER if rigid else 0.0
    shares = (
        min(max(now_time - begin - late * (begin > 0), 0.0) / (end - begin), 1.0)
        for begin, end in PUSHES
    )
    return (
        sum(30.0 * math.sin(math.pi / 2 * share) ** 2 for share in shares)
        - 9.81 * MASS * now_time
    )


def state(now_time: float, *, rigid: bool) -> tuple[list[float], list[float]]:
    """Return global values and part values; the first values of the part are meaningless (9e9, 0) while it is rigid."""
    along = compute_momentum(now_time, rigid=rigid)
    energy = (
        0.0 if now_time <= 0 else 50.0 + 20.0 * math.cos(2 * math.pi * now_time / 0.01)
    )
    part = [energy, along**2 / (2 * MASS), 0.0, 0.0, along, MASS]
    return [*part, STEP], [9e9, 0.0, 0.0, 0.0, 0.0, 0.0] if rigid else part


def write_restart(name: str, number: int, content: str = "") -> Path:
    """Return the path of the restart file of a restart segment; write it if ``content`` is not empty."""
    path = Path(f"{name}_{number:04d}_0001.rst")
    if content:
        path.write_text(f"{path.name} {content}".ljust(SIZE))
    return path


def run_engine(deck: Path) -> None:
    """Compute a restart segment from the restart file of the previous one."""
    text, fault = deck.read_text(), os.environ.get("D2RPICK_FAKE", "")
    head = re.search(r"/RUN/(\w+)/(\d+)\n\s*(\S+)", text)
    assert head
    name, number, end = head[1], int(head[2]), float(head[3])
    own_name, begins, *held = write_restart(name, number - 1).read_text().split()
    assert own_name == write_restart(name, number - 1).name
    assert not (held and "/RBODY/ON" in text), (
        "OpenRadioss adds to the energy of what is rigid already"
    )
    rigid = "/RBODY/ON" in text or bool(held and "/RBODY/OFF" not in text)
    history, listing = Path(f"{name}T{number:02d}"), Path(f"{name}_{number:04d}.out")
    listing.write_text(" started\n")
    step = int(begins)
    history_head = write_head(
        [MadePart(1, "strip of shells", CODES)], globals_=len(CODES) + 1
    )
    if fault == "hang" and number == 2:
        time.sleep(1000)
    if fault == "lost":
        shutil.rmtree(".drive.replaced", ignore_errors=True)
    cycles = 0
    with history.open("wb") as stream:
        while step * STEP <= end + 1e-9:
            history_head.state(step * STEP, *state(step * STEP, rigid=rigid))
            stream.write(history_head.data)
            stream.flush()
            history_head.data.clear()
            step, cycles = step + 1, cycles + 1
            if fault == "slow":
                time.sleep(PACE)
            if fault == "fail" and number == 2 and cycles == 5:
                listing.write_text(" ** ERROR: NEGATIVE VOLUME\n")
                print(" ** ERROR: NEGATIVE VOLUME IN ELEMENT 7", flush=True)
                sys.exit(2)
    restart_file = write_restart(name, number, f"{step}{' rigid' * rigid}")
    if (
        fault in ("empty", "cut", "damaged")
        and number == 3
        and not Path("full.once").exists()
    ):
        content = restart_file.read_bytes()
        kept_bytes = {"empty": 0, "cut": SIZE // 2}.get(
            fault, len(restart_file.name) + 1
        )
        restart_file.write_bytes(
            content[:kept_bytes] + b"?" * (SIZE - kept_bytes) * (fault == "damaged")
        )
        Path("full.once").touch()
    listing.write_text(
        "  ** CUMULATIVE CPU TIME SUMMARY **\n ELEMENT FORCES..............: .8E+00 80 %\n"
        f" TOTAL.......................: .1E+01 100 %\n     NORMAL TERMINATION\n TOTAL NUMBER OF CYCLES  : {cycles}\n"
    )


if __name__ == "__main__":
    kind, main = sys.argv[1], Path(sys.argv[2])
    if kind == "engine":
        run_engine(main)
    else:
        write_restart(main.stem.removesuffix("_0000"), 0, "0")
        Path(f"{main.stem}.out").write_text(
            "     NORMAL TERMINATION\n     0 ERROR(S)\n"
        )
