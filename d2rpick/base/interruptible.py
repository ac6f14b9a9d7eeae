"""Let an interrupt end the process that forks the workers, and the workers that it forks, without a message.

The process starts with SIGINT blocked, so that its start cannot print a traceback either. A parent that ignores
SIGINT, as a background job does, passes that on.

A worker that is still starting when the program ends finds the semaphores of its queues deleted. It ends silently, too:
a pool reports by itself that one of its processes has ended.
"""

import signal
import sys

if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, signal.SIG_DFL)
signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
sys.excepthook = lambda *_: (
    None
)  # Only the start of a worker uses it; errors of calls are sent to the program.
