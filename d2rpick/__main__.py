"""The command line as a program: ``d2rpick`` and ``python -m d2rpick``."""

import gc
import os
import signal
import sys


def main() -> None:
    """Run the command line.

    One thread for linear algebra, unless the environment says otherwise: the systems solved here are small, and
    starting the others costs a quarter of numpy's import.  Garbage is looked for less often, and not at the end: of
    what imports make none is garbage, and looking for it costs a seventh of a run on an ordinary file.

    An interrupt leaves as KeyboardInterrupt, without a traceback: Python then ends itself by SIGINT, and the shell ends
    its loop.  A shell goes on with its loop after a program that caught the signal and ended with any exit code.
    """
    interrupts: list[int] = []

    def interrupt(number: int, _: object) -> None:
        """Raise KeyboardInterrupt, and remember the signal, since library code may swallow the error."""
        interrupts.append(number)
        sys.unraisablehook = lambda _: (
            None
        )  # what is swallowed in the end of an object would print a traceback
        raise KeyboardInterrupt

    try:
        if (
            signal.getsignal(signal.SIGINT) is signal.default_int_handler
        ):  # background jobs ignore interrupts
            signal.signal(signal.SIGINT, interrupt)
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        gc.set_threshold(100_000)
        _fill_closed_streams()
        from d2rpick.cli import d2rpick

        d2rpick()
    except KeyboardInterrupt:
        interrupts.append(signal.SIGINT)
    finally:
        if signal.getsignal(signal.SIGINT) is interrupt:
            signal.signal(
                signal.SIGINT, signal.SIG_DFL
            )  # the next one ends the program at once
        gc.freeze()  # the system takes back what is left
        if interrupts:
            sys.excepthook = lambda *_: None
            raise KeyboardInterrupt


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
                writer = io.TextIOWrapper(
                    file, errors="backslashreplace", write_through=True
                )
                setattr(sys, ("stdout", "stderr")[stream - 1], writer)


if __name__ == "__main__":
    main()
