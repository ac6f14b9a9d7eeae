"""Start the command line: the program ``d2rpick``, which ``python -m d2rpick`` starts too."""

import atexit
import gc
import os
import signal
import sys

_SOON = 0.05  # time until an interrupt that was swallowed is repeated [s]
_PATIENCE = 2.0  # longest wait for other threads at the end of an interrupted run [s]


def main() -> None:
    """Run the command line.

    Linear algebra uses one thread, unless the environment sets another number. The systems solved here are small, and
    starting more threads takes a quarter of the time of numpy's import.

    Garbage is collected less often, because imports create none. At the end, objects are not deleted one by one. Both
    together take a fifth of the time of a run with an ordinary file.

    An interrupt is raised as KeyboardInterrupt, without a traceback, so that Python ends itself by SIGINT. A shell then
    ends its loop. It would continue its loop after a program that catches the signal and returns an exit code. Until
    the command begins, the signal ends the process by itself, because there is nothing to finish.
    """
    interrupts: list[int] = []
    exit_codes: list[int] = []

    def interrupt(number: int, _: object) -> None:
        """Raise KeyboardInterrupt, and remember the signal, because a library may swallow the error."""
        interrupts.append(number)
        sys.unraisablehook = interrupt_again
        raise KeyboardInterrupt

    def interrupt_again(ignored: "sys.UnraisableHookArgs") -> None:
        """Repeat an interrupt that Python swallows while it deletes an object, and print no traceback for it."""
        if ignored.exc_type is KeyboardInterrupt:
            from _thread import start_new_thread

            # Raised here, it would be swallowed again. A Thread or Timer is not used, because its start waits for it.
            start_new_thread(_interrupt_soon, ())

    # A background job has another handler, because it ignores interrupts.
    is_interruptible = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    try:
        if is_interruptible:
            signal.signal(signal.SIGINT, signal.SIG_DFL)
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        gc.set_threshold(100_000)
        atexit.register(_end_at_once, exit_codes)
        _fill_closed_streams()
        from d2rpick.cli import d2rpick

        if is_interruptible:
            signal.signal(signal.SIGINT, interrupt)
        d2rpick()
    except KeyboardInterrupt:
        interrupts.append(signal.SIGINT)
    except SystemExit as ended:
        if isinstance(ended.code, int):
            exit_codes.append(ended.code)
        raise
    finally:
        if signal.getsignal(signal.SIGINT) is interrupt:
            # The next interrupt ends the program at once.
            signal.signal(signal.SIGINT, signal.SIG_DFL)
        if interrupts:
            exit_codes.clear()
            sys.excepthook = lambda *_: None
            _limit_waiting()
            raise KeyboardInterrupt


def _end_at_once(exit_codes: list[int]) -> None:
    """End this process with the exit code of the command, if it has ended; the system frees the memory anyway.

    Python calls this function last, because it was registered first: what libraries do at the end has been done.
    """
    if exit_codes:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(exit_codes[0])


def _interrupt_soon() -> None:
    """Send the interrupt to this process again after a while."""
    import time

    time.sleep(_SOON)
    os.kill(os.getpid(), signal.SIGINT)


def _limit_waiting() -> None:
    """End this process by SIGINT after some time, even if one of its threads does not end.

    Python waits for the threads of a process pool before it ends. The processes of the pool have been interrupted too,
    at any point of their work.
    """
    if os.name == "posix":
        from threading import Timer

        watch = Timer(_PATIENCE, os.kill, (os.getpid(), signal.SIGINT))
        watch.daemon = True
        watch.start()


def _fill_closed_streams() -> None:
    """Replace closed standard streams, so that no file gets their number and thus their output.

    Writing to a closed standard output is an error. If stderr is closed, only messages are lost.
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
