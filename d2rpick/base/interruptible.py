"""Imported first in the process from which workers are forked: there an interrupt ends it at once, without a word.

The process is started with SIGINT blocked, so that its start cannot print a traceback either.  A parent that ignores
SIGINT, as a job in the background does, passes that on.
"""

import signal

if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, signal.SIG_DFL)
signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
