"""Memory of fits that counts how often a fit had to be computed."""

from collections.abc import Callable, Hashable
from typing import TypeVar

from d2rpick.vibration.span import Fits

_Found = TypeVar("_Found")


class CountedFits(Fits):
    """Fits of a record, with the number of results that were computed rather than remembered."""

    computed = 0

    def once(self, key: Hashable, make: Callable[[], _Found]) -> _Found:
        def counted() -> _Found:
            self.computed += 1
            return make()

        return super().once(key, counted)
