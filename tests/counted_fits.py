"""Fits to windows of a record that are counted."""

from collections.abc import Callable, Hashable
from typing import TypeVar

from d2rpick.vibration.span import Fits

_Found = TypeVar("_Found")


class CountedFits(Fits):
    """What was found in a record, and how often something had to be made."""

    made = 0

    def once(self, key: Hashable, make: Callable[[], _Found]) -> _Found:
        def counted() -> _Found:
            self.made += 1
            return make()

        return super().once(key, counted)
