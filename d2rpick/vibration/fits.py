"""What was found in a record, remembered: the same windows of it come up again from one td to the next."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable

    from d2rpick.histories.history import Samples
    from d2rpick.vibration.identify import Identification
    from d2rpick.vibration.span import Fitter


_Found = TypeVar("_Found")


class Fits:
    """Fits to windows of one record by one set of rules, and what else is looked for in them, each made once."""

    def __init__(self) -> None:
        self._found: dict[tuple[Hashable, ...], Any] = {}

    def remembered(self, name: str, fitter: Fitter) -> Fitter:
        """Give a fitter that does as ``fitter``, which has this name, and fits no window twice."""

        def fit(time: Samples, energy: Samples, *, quick: bool = False) -> Identification:
            window = (*time[:1].tolist(), *time[-1:].tolist())  # of one record, so the ends tell the samples
            return self.once((name, quick, *window), lambda: fitter(time, energy, quick=quick))

        return fit

    def once(self, key: tuple[Hashable, ...], make: Callable[[], _Found]) -> _Found:
        """Make what is not known yet by this key."""
        if key not in self._found:
            self._found[key] = make()
        found: _Found = self._found[key]
        return found
