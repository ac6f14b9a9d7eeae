"""A solver for tests: a box that is pushed, flies, lands and flies again, one state of its history after the other.

``python fake_solver.py starter|engine DECK`` in the folder of a run.  The engine obeys its control file, writes
restarts, and goes on from them; what it prints is what OpenRadioss prints there.  D2RPICK_FAKE names what goes wrong:
``fail`` ends leg 2 with an error, ``slow`` has no state of it before it is told to stop.
"""

import math
import os
import re
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from tests.made_t01 import MadePart, headed

PUSHES = ((0.0, 0.03), (0.17, 0.19))  # of the box; it reaches the ground a little later while it is rigid
LATER, STEP, PACE = 0.002, 1e-3, 0.016
MASS = 10.0
CODES = (1, 2, 3, 4, 5, 6)


def momentum(now: float, *, rigid: bool) -> float:
    """Momentum of the box along z: gravity and each push, softly, add to it."""
    late = LATER if rigid else 0.0
    shares = (min(max(now - begin - late * (begin > 0), 0.0) / (end - begin), 1.0) for begin, end in PUSHES)
    return sum(30.0 * math.sin(math.pi / 2 * share) ** 2 for share in shares) - 9.81 * MASS * now


def state(now: float, *, rigid: bool) -> tuple[list[float], list[float]]:
    """Quantities of the whole model, and of its part, whose own are void while it is rigid."""
    along = momentum(now, rigid=rigid)
    energy = 0.0 if now <= 0 else 50.0 + 20.0 * math.cos(2 * math.pi * now / 0.01)
    part = [energy, along**2 / (2 * MASS), 0.0, 0.0, along, MASS]
    return [*part, STEP], [9e9, 0.0, 0.0, 0.0, 0.0, 0.0] if rigid else part


def engine(deck: Path) -> None:
    """Compute a leg from the restart that its deck names."""
    text = deck.read_text()
    head = re.search(r"/RUN/(\w+)/(\d+)(?:/(\w))?\n\s*(\S+)", text)
    assert head
    name, number, letter, end = head[1], int(head[2]), head[3], float(head[4])
    many, every = map(int, re.findall(r"/RFILE/(\d+)\n(\d+)", text)[0])
    before = Path(f"{name}_{number - 1:04d}_0001{f'_{letter}' if letter else ''}.rst")
    begins, *held = before.read_text().split()
    start, stop, step = float(begins), end, 0
    assert not (held and "/RBODY/ON" in text), "OpenRadioss adds to the energy of what is rigid already"
    rigid = "/RBODY/ON" in text or bool(held and "/RBODY/OFF" not in text)
    history, listing = Path(f"{name}T{number:02d}"), Path(f"{name}_{number:04d}.out")
    listing.write_text(" started\n")
    made = headed([MadePart(1, "strip of shells", CODES)], globals_=len(CODES) + 1)
    killed, normal, last = False, True, start
    if number == 2 and os.environ.get("D2RPICK_FAKE") == "slow":
        while not Path(f"{name}_{number:04d}.ctl").exists():
            time.sleep(PACE)
        stop = start
    with history.open("wb") as stream:
        while True:
            now = start + (step + (start > 0)) * STEP  # a restart does not repeat a state
            if now > stop + 1e-9 or killed:
                break
            last = now
            made.state(now, *state(now, rigid=rigid))
            stream.write(made.data)
            stream.flush()
            made.data.clear()
            time.sleep(PACE)
            step += 1
            control = Path(f"{name}_{number:04d}.ctl")
            if control.exists():
                told = control.read_text()
                control.write_text("CURRENT STATE")
                killed = "/KILL" in told
                asked = re.search(r"/TIME/(\S+)", told)
                stop = (float(asked[1]) if asked else now) if "/STOP" in told else stop
            if step % every == 0:
                letter = chr(ord("I") + (step // every - 1) % many)
                Path(f"{name}_{number:04d}_0001_{letter}.rst").write_text(f"{now!r}{' rigid' * rigid}")
            if number == 2 and step == 5 and os.environ.get("D2RPICK_FAKE") == "fail":
                normal = False
                break
    if not normal:
        listing.write_text(" ** ERROR: NEGATIVE VOLUME\n")
        print(" ** ERROR: NEGATIVE VOLUME IN ELEMENT 7", flush=True)
        sys.exit(2)
    if not killed:
        reached = max(last, min(now, stop))
        letter = chr(ord("I") + (step // every) % many)
        Path(f"{name}_{number:04d}_0001_{letter}.rst").write_text(f"{reached!r}{' rigid' * rigid}")
    listing.write_text(
        "  ** CUMULATIVE CPU TIME SUMMARY **\n ELEMENT FORCES..............: .8E+00 80 %\n"
        f" TOTAL.......................: .1E+01 100 %\n     NORMAL TERMINATION\n TOTAL NUMBER OF CYCLES  : {step}\n"
    )


if __name__ == "__main__":
    kind, main = sys.argv[1], Path(sys.argv[2])
    if kind == "engine":
        engine(main)
    else:
        Path(f"{main.stem}_0001.rst").write_text("0.0")
        Path(f"{main.stem}.out").write_text("     NORMAL TERMINATION\n     0 ERROR(S)\n")
