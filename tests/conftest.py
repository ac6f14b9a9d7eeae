"""Settings that must hold before any test module is imported."""

import os

# As on the command line: the systems here are small, and threads of several test processes would fight over cores.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from collections.abc import Iterator

import pytest
from hypothesis import settings

# A busy machine is no finding.
settings.register_profile("d2rpick", deadline=None)
settings.load_profile("d2rpick")


@pytest.fixture(scope="session", autouse=True)
def few_explored() -> Iterator[None]:
    """Let pages explore few td: what they show of each is the same."""
    with pytest.MonkeyPatch.context() as patch:
        for name in ("STEPS", "_LEAST"):
            patch.setattr(f"d2rpick.choice.explored.{name}", 5)
        yield
