"""Settings that must hold before any test module is imported."""

import os

# As on the command line: the systems here are small, and threads of several test processes would fight over cores.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from hypothesis import settings

# A busy machine is no finding.
settings.register_profile("d2rpick", deadline=None)
settings.load_profile("d2rpick")
