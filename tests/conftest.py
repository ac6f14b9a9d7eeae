"""Settings that must hold before any test module is imported, and what all tests of a process share."""

import gc
import os
import time
from collections.abc import Callable, Iterator
from functools import wraps
from hashlib import blake2b
from types import ModuleType
from typing import Any, ClassVar

# As on the command line: the systems here are small, and threads of several test processes would fight over cores.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# The program is started again and again: that it is compiled each time is no part of any test.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

import pytest
from hypothesis import settings

from d2rpick.choice import examine, explored
from d2rpick.flight import momentum
from d2rpick.flight.window import Remembered
from d2rpick.histories.history import Samples
from d2rpick.vibration.identify import Identification, identify, identify_several

# A busy machine is no finding.
settings.register_profile("d2rpick", deadline=None)
settings.load_profile("d2rpick")


class Misfits(Remembered):
    """A law that is held against no window twice in all tests: many read the same momentum."""

    known: ClassVar[dict[bytes, dict[tuple[int, int], float]]] = {}

    def __init__(self, law: momentum.FreeFall) -> None:
        super().__init__(law)
        self._misfits = self.known.setdefault(digest(law.time, law.momentum), {})


def digest(*samples: Samples) -> bytes:
    """Digest of samples."""
    return blake2b(b"".join(one.tobytes() for one in samples), digest_size=16).digest()


def remembered(fitter: Callable[..., Identification]) -> Callable[..., Identification]:
    """Give a fitter that does as ``fitter`` and fits no samples twice: many tests ask about the same sample records."""
    known: dict[tuple[bytes, bool], Identification] = {}

    @wraps(fitter)
    def fit(time: Samples, energy: Samples, *, quick: bool = False) -> Identification:
        key = digest(time, energy), quick
        if key not in known:
            known[key] = fitter(time, energy, quick=quick)
        return known[key]

    return fit


def replace(module: ModuleType, **values: Any) -> None:
    """Give names of a module other values; they must be there, since a name that is gone would change nothing."""
    missing = values.keys() - vars(module).keys()
    assert not missing, f"{module.__name__} has no {missing}"
    vars(module).update(values)


# What a fit is does not depend on who asks; the tests of the fits themselves call them where they are defined.
replace(examine, identify=remembered(identify), identify_several=remembered(identify_several))
replace(momentum, Remembered=Misfits)
# Pages explore few td: what they show of each is the same.
replace(explored, _STEPS=5, _LEAST=5)
_now = time.time_ns


@pytest.fixture(scope="session", autouse=True)
def _old_files() -> Iterator[None]:
    """Let all files look old: most tests read what they have just written, and no write of theirs is under way."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(time, "time_ns", lambda: _now() + 3_600_000_000_000)
        yield


@pytest.fixture
def new_files(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let files look as new as they are, but make no pause: what is under way in these tests ends by itself."""
    monkeypatch.setattr(time, "time_ns", _now)
    monkeypatch.setattr(time, "sleep", lambda _: None)


# Looking for garbage as often as Python does by itself takes a tenth of the time of all tests.
gc.set_threshold(20_000, 20, 50)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the slow folder that would come last: at the end one process would wait for the other."""
    items.sort(key=lambda item: not item.nodeid.startswith("tests/vibration/"))


def pytest_collection_finish() -> None:
    """Look for no garbage among the modules and the collected tests, which are needed to the end."""
    gc.freeze()
