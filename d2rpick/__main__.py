"""The command line as a program: ``d2rpick`` and ``python -m d2rpick``."""

import gc
import os
import sys

INTERRUPTED = 130  # what a shell reports for a program that SIGINT ended


def main() -> None:
    """Run the command line.

    One thread for linear algebra, unless the environment says otherwise: the systems solved here are small, and
    starting the others costs a quarter of numpy's import.  Garbage is looked for less often, and not at the end: of
    what imports make none is garbage, and looking for it costs a seventh of a run on an ordinary file.  An interrupt
    before anything was begun, during the imports, ends the program without a word.
    """
    try:
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        gc.set_threshold(100_000)
        _fill_closed_streams()
        from d2rpick.cli import d2rpick

        d2rpick()
    except KeyboardInterrupt:
        os._exit(INTERRUPTED)
    finally:
        gc.freeze()  # the system takes back what is left


def _fill_closed_streams() -> None:
    """Put something in the place of closed streams: a file opened there would get what is meant for them.

    To write to a standard output that was closed is an error; a closed stderr loses only messages.
    """
    for stream in range(3):
        try:
            os.fstat(stream)
        except OSError:
            os.open(os.devnull, os.O_RDONLY if stream == 1 else os.O_RDWR)
            if stream:
                import io

                file = io.FileIO(stream, "w", closefd=False)
                writer = io.TextIOWrapper(file, errors="backslashreplace", write_through=True)
                setattr(sys, ("stdout", "stderr")[stream - 1], writer)


if __name__ == "__main__":
    main()
