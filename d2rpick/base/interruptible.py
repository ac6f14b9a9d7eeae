"""Let an interrupt end the process that forks the workers, immediately and without a message.

The process starts with SIGINT blocked, so that its start cannot print a traceback either. A parent that ignores
SIGINT, as a background job does, passes that on.
"""

import signal

if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, signal.SIG_DFL)
signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
