"""Describe the numbers that an option or an argument accepts."""

from __future__ import annotations

from math import inf

from d2rpick.base.tuples import NamedTuple


class Number(NamedTuple):
    """A finite number from ``low`` (or above ``low``, if ``above``) to ``high``."""

    low: float = -inf
    high: float = inf
    above: bool = False

    def missed(self, value: float) -> str:
        """Return the limit that a value violates as text; empty if the value is allowed."""
        if value < self.low or (self.above and value == self.low):
            return f"{'above' if self.above else 'of at least'} {self.low:g}"
        return f"of at most {self.high:g}" if value > self.high else ""
