"""Models of the validation: a deck, the rigid body that switches it, and the reference run."""

from __future__ import annotations

import gzip
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

DECKS: Final = Path(__file__).parent / "decks"
_PRINT: Final = -2000  # cycles between two lines of the listing


@dataclass(frozen=True)
class Model:
    """Model with the deck ``name``_0000.rad.gz, whose switched parts are one rigid body with main node ``main``.

    The run ends at ``t_end`` and writes its time history each ``interval`` [s].  While it is rigid, the time step is
    capped at ``cap`` [s], because without deformable elements it would grow without limit.  ``begin`` are further lines
    of the first engine file.  ``scale`` is the solver's share of the stable time step.
    """

    name: str
    what: str
    main: int
    t_end: float
    interval: float
    cap: float
    begin: str = ""
    scale: float = 0.9

    def deck(self) -> bytes:
        """Return the starter deck."""
        return gzip.decompress((DECKS / f"{self.name}_0000.rad.gz").read_bytes())

    def legs(self, windows: Sequence[tuple[float, float]]) -> Iterator[str]:
        """Yield the engine files of a run that is rigid in ``windows`` (tr, td) [s], in order."""
        bounds = [
            (0.0, False),
            *(
                (time, rigid)
                for tr, td in windows
                for time, rigid in ((tr, True), (td, False))
            ),
        ]
        ends = [*(time for time, _ in bounds[1:]), self.t_end]
        phases = [
            (end, rigid)
            for (start, rigid), end in zip(bounds, ends, strict=True)
            if end > start
        ]
        for number, (end, rigid) in enumerate(phases, start=1):
            yield self._leg(number, end, rigid=rigid)

    def _leg(self, number: int, end: float, *, rigid: bool) -> str:
        # the rigid body is active as the deck defines it; a first leg that is rigid leaves it so
        switch = (
            ""
            if number == 1 and rigid
            else f"/RBODY/{'ON' if rigid else 'OFF'}\n{self.main}\n"
        )
        cap = f"/DTIX\n{self.cap!r} {self.cap!r}\n" if rigid else ""
        return (
            f"/RUN/{self.name}/{number}\n{end:.10g}\n/VERS/2022\n/DT\n{self.scale} 0.0\n{cap}{switch}"
            f"{self.begin if number == 1 else ''}/TFILE/4\n{self.interval}\n/TH/TITLE\n/PRINT/{_PRINT}\n/MON/ON\n"
            "/PARITH/ON\n"
        )


MODELS: Final = {
    model.name: model
    for model in (
        Model(
            "OSC",
            "floating oscillator, its spring ten bricks",
            9001,
            0.15,
            2e-5,
            1e-6,
            "/INIV/TRA/X/2\n6.0\n2\n",
        ),
        Model(
            "ROLL",
            "shell box on a sled that trips over a curb",
            200001,
            0.45,
            5e-5,
            2e-5,
        ),
        Model(
            "CAR",
            "car-like structure of 16 parts that hits a block, rolls and lands",
            1808,
            0.26,
            1e-4,
            2e-5,
        ),
        Model(
            "CAR2",
            "the same on softer mounts, with a lighter battery, on a shorter block",
            1808,
            0.24,
            1e-4,
            2e-5,
        ),
        Model(
            "CAR3",
            "the same with all shells QBAT, on stiffer mounts, with a heavier battery",
            1808,
            0.24,
            1e-4,
            2e-5,
        ),
        Model(
            "CAR4",
            "the same, heavier and faster, on softer wheels",
            1808,
            0.24,
            1e-4,
            2e-5,
        ),
        Model(
            "DROP2",
            "shell box with a block on springs that falls on a corner and bounces",
            535,
            0.8,
            2e-4,
            5e-6,
        ),
        Model(
            "DROP3",
            "the same from 0.25 m, tilted 20 and -40 degrees, springs of 40 kN/m",
            535,
            0.65,
            2e-4,
            5e-6,
        ),
        Model(
            "DROP4",
            "the same from 0.5 m, tilted 45 and 10 degrees, springs of 160 kN/m",
            535,
            0.75,
            2e-4,
            5e-6,
        ),
    )
}
