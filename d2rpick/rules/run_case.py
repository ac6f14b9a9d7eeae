"""A Radioss run as the rules see it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from d2rpick.deck import Parts
from d2rpick.deck.radioss_run import find_run_windows
from d2rpick.rules.base import RADIOSS, Case

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from d2rpick.deck import SwitchSet, Window, Windows
    from d2rpick.deck.card import Field, Value
    from d2rpick.deck.radioss_run import Flaw, Run, RunWindows
    from d2rpick.deck.reader import Unread
    from d2rpick.rules.base import Judge


@dataclass(frozen=True, eq=False, kw_only=True)
class RunCase(Case):
    """The starter deck and the legs, with the windows that they make."""

    run: Run

    @classmethod
    def of(cls, run: Run, judge: Judge | None) -> RunCase:
        """Show a run."""
        return cls(run.deck, judge, run=run)

    @property
    def solver(self) -> str:
        """Whose deck it is."""
        return RADIOSS

    @cached_property
    def found(self) -> RunWindows:
        """Windows, and the parts of the bodies."""
        return find_run_windows(self.run)

    @cached_property
    def parts(self) -> Parts:
        """Parts of the starter deck by id."""
        lines = self.run.starter.parts if self.run.starter else {}
        return Parts(dict.fromkeys(lines, ""), {part: line.title for part, line in lines.items()})

    @cached_property
    def sets(self) -> tuple[SwitchSet, ...]:
        """What switches bodies."""
        return self.found.sets

    @cached_property
    def windows(self) -> Windows:
        """The rigid windows of every part, or of every body whose parts are not known."""
        return self.found.windows

    @cached_property
    def end_time(self) -> Value[float] | None:
        """The end of the last leg as written."""
        return self.run.legs[-1].stop if self.run.legs else None

    @cached_property
    def end(self) -> float | None:
        """The end of the last leg [time of the run], where it is known and positive."""
        stop = self.end_time
        return stop.value if stop and not stop.problem and stop.value > 0 else None

    @cached_property
    def unread(self) -> Sequence[Unread]:
        """Includes that were not read, where a main node that is switched may stand in them."""
        bodies = {body.node.value for body in self.run.starter.bodies} if self.run.starter else set()
        return self.deck.unread if self.named - bodies - {0} else ()

    @cached_property
    def untimed(self) -> tuple[tuple[Field, str], ...]:
        """Bodies that a sensor switches whose time is not known."""
        starter = self.run.starter
        bodies = starter.bodies if starter else []
        return tuple(
            (body.node.field, f"rigid body {body.id} is switched by sensor {body.sensor}, which is not a time sensor")
            for body in bodies
            if starter and body.sensor and body.sensor not in starter.timed
        )

    @cached_property
    def unturned(self) -> Mapping[int, str]:
        """Parts of elements without a co-rotating frame."""
        return self.run.starter.unturned if self.run.starter else {}

    @cached_property
    def named(self) -> frozenset[int]:
        """Main nodes that the legs switch."""
        return frozenset(node.value for leg in self.run.legs for _, _, nodes in leg.switched for node in nodes)

    @cached_property
    def flaws(self) -> tuple[Flaw, ...]:
        """What the starter does to the nodes of the bodies that the legs switch."""
        starter, legs = self.run.starter, self.run.legs
        if not self.named or starter is None:
            return ()
        if not (starter.walls or starter.velocities or any(leg.starts for leg in legs)):
            return ()
        from d2rpick.deck.radioss_flaws import flaws_of  # loads numpy

        return flaws_of(self.run, self.named)

    @cached_property
    def rigid_legs(self) -> list[tuple[int, list[Window]]]:
        """Index of every leg in which something is rigid, with the windows that hold it."""
        found = []
        start = 0.0
        for index, leg in enumerate(self.run.legs):
            stop = leg.stop.value
            held = [w for w in self.windows.windows if w.tr <= start and (w.td is None or w.td >= stop)]
            if held and stop > start:
                found.append((index, held))
            start = stop
        return found
