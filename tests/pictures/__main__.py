"""Write the pictures of the documentation."""

from __future__ import annotations

import sys

from tests.pictures import decisions, mechanics, samples, screenshots, tutorial
from tests.pictures.drawing import write_figure

PICTURES = {
    "workflow": tutorial.workflow,
    "fall-motion": tutorial.fall_motion,
    "fall-plan": tutorial.fall_plan,
    "fall-comparison": tutorial.fall_comparison,
    "flight": mechanics.flight,
    "level": mechanics.level,
    "sign": mechanics.sign,
    "kinetic-fraction": mechanics.kinetic_fraction,
    "residual": mechanics.residual,
    "out-of-place": mechanics.out_of_place,
    "static-energy": mechanics.static_energy,
    "trade-off": decisions.trade_off,
    "saving": decisions.saving,
    "sampling": decisions.sampling,
    "landings": decisions.landings,
    "worth": decisions.worth,
}


def write_pictures(names: list[str]) -> None:
    """Write the pictures with these names."""
    for name in names:
        if name in PICTURES:
            write_figure(PICTURES[name](), name)
        elif name in samples.NAMES:
            samples.draw_sample(name)
        elif program := screenshots.browser():
            screenshots.take_screenshot(name, program)
        else:
            print(f"{name}: no Chromium here")


if __name__ == "__main__":
    write_pictures(sys.argv[1:] or [*PICTURES, *samples.NAMES, *screenshots.NAMES])
