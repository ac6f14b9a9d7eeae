"""Settings that must hold before any test module is imported."""

import os

# As on the command line: the systems here are small, and threads of several test processes would fight over cores.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
