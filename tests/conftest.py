"""Settings that must hold before any test module is imported, and what all tests of a process share."""

import os
from collections.abc import Callable
from functools import wraps
from hashlib import blake2b

# As on the command line: the systems here are small, and threads of several test processes would fight over cores.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# The program is started again and again: that it is compiled each time is no part of any test.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

from hypothesis import settings

from d2rpick import file_state
from d2rpick.choice import examine, explored
from d2rpick.histories.history import Samples
from d2rpick.vibration.identify import Identification, identify, identify_several

# A busy machine is no finding.
settings.register_profile("d2rpick", deadline=None)
settings.load_profile("d2rpick")


def remembered(fitter: Callable[..., Identification]) -> Callable[..., Identification]:
    """Give a fitter that does as ``fitter`` and fits no samples twice: many tests ask about the same sample records."""
    known: dict[bytes, Identification] = {}

    @wraps(fitter)
    def fit(time: Samples, energy: Samples, *, quick: bool = False) -> Identification:
        key = blake2b(time.tobytes() + energy.tobytes() + bytes([quick]), digest_size=16).digest()
        if key not in known:
            known[key] = fitter(time, energy, quick=quick)
        return known[key]

    return fit


# What a fit is does not depend on who asks; the tests of the fits themselves call them where they are defined.
vars(examine).update(identify=remembered(identify), identify_several=remembered(identify_several))
# Pages explore few td: what they show of each is the same.
vars(explored).update(STEPS=5, _LEAST=5)
# Most tests read what they have just written: that no write is under way is sure without waiting for it.
vars(file_state).update(PAUSE=0.0)
