"""Run a model with OpenRadioss, switched or not: ``python -m validation.run OSC FOLDER --window 0.013587 0.068753``.

OPENRADIOSS_PATH names the folder of the solver; its starter and engine are in the subfolder ``bin`` or ``exec``.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from pathlib import Path

from validation.models import MODELS, Model

_PROGRAMS = {
    "starter": ("bin/starter_gf", "exec/starter_linux64_gf"),
    "engine": ("bin/engine_gf", "exec/engine_linux64_gf"),
}


def main() -> None:
    """Write deck and engine files, run them, and print the names of the time histories."""
    parser = argparse.ArgumentParser(
        prog="python -m validation.run", description=__doc__
    )
    parser.add_argument("model", choices=MODELS)
    parser.add_argument("folder", type=Path)
    parser.add_argument(
        "--window", nargs=2, type=float, action="append", default=[], metavar=("TR", "TD"),
        help="rigid from TR to TD [s]; repeatable, in order",
    )  # fmt: skip
    options = parser.parse_args()
    solver = os.environ.get("OPENRADIOSS_PATH")
    if not solver:
        sys.exit("OPENRADIOSS_PATH is not set; it names the folder of OpenRadioss")
    for name in run(
        MODELS[options.model],
        options.folder,
        [tuple(window) for window in options.window],
        Path(solver),
    ):
        print(name)


def run(
    model: Model, folder: Path, windows: list[tuple[float, float]], solver: Path
) -> list[Path]:
    """Run a model in ``folder``, rigid in ``windows``; return its time histories, one for each engine file."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{model.name}_0000.rad").write_bytes(model.deck())
    legs = [
        folder / f"{model.name}_{number:04d}.rad"
        for number in range(1, 2 * len(windows) + 2)
    ]
    written = [
        leg
        for leg, text in zip(legs, model.legs(windows), strict=False)
        if leg.write_text(text)
    ]
    _call(
        solver,
        "starter",
        folder,
        "-i",
        f"{model.name}_0000.rad",
        "-np",
        "1",
        "-nt",
        "1",
    )
    for leg in written:
        _call(solver, "engine", folder, "-i", leg.name, "-nt", "1")
    return sorted(folder.glob(f"{model.name}T[0-9][0-9]"))


def _call(solver: Path, program_kind: str, folder: Path, *options: str) -> None:
    """Run starter or engine in ``folder``; write its output to a log there."""
    programs = [
        solver / name for name in _PROGRAMS[program_kind] if (solver / name).exists()
    ]
    if not programs:
        sys.exit(
            f"{solver}: no {' or '.join(_PROGRAMS[program_kind])}; OPENRADIOSS_PATH names the folder of OpenRadioss"
        )
    configuration = os.environ.get("RAD_CFG_PATH", str(solver / "hm_cfg_files"))
    libraries = os.pathsep.join(
        filter(
            None,
            (
                str(solver / "exec"),
                os.environ.get("LD_LIBRARY_PATH"),
                str(solver / "syslib"),
            ),
        )
    )
    surroundings = {
        **os.environ, "RAD_CFG_PATH": configuration, "LD_LIBRARY_PATH": libraries, "OMP_STACKSIZE": "400m",
        "OMP_NUM_THREADS": "1",
    }  # fmt: skip
    log = folder / f"{program_kind}_{Path(options[1]).stem}.log"
    command = [
        "bash",
        "-c",
        'ulimit -s unlimited; exec "$0" "$@"',
        str(programs[0].resolve()),
        *options,
    ]
    with log.open("w") as words:
        done = subprocess.run(
            command,
            cwd=folder,
            env=surroundings,
            stdout=words,
            stderr=words,
            check=False,
        )
    if done.returncode:
        sys.exit(
            f"{log}: the {program_kind} ended with {done.returncode}; its last words are there"
        )


if __name__ == "__main__":
    main()
