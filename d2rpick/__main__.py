"""The command line as a program: ``d2rpick`` and ``python -m d2rpick``."""

import gc
import os


def main() -> None:
    """Run the command line.

    One thread for linear algebra, unless the environment says otherwise: the systems solved here are small, and
    starting the others costs a quarter of numpy's import.  Garbage is looked for less often, and not at the end: of
    what imports make none is garbage, and looking for it costs a seventh of a run on an ordinary file.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    gc.set_threshold(100_000)
    for stream in range(3):  # a file opened in the place of a closed one would get what is meant for it
        try:
            os.fstat(stream)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    from d2rpick.cli import d2rpick

    try:
        d2rpick()
    finally:
        gc.freeze()  # the system takes back what is left


if __name__ == "__main__":
    main()
