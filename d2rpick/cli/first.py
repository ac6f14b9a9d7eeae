"""The command ``first``."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from d2rpick.api.request import NOT_NEGATIVE, POSITIVE, Option
from d2rpick.base.errors import printable
from d2rpick.cli import options
from d2rpick.cli.values import click_type

if TYPE_CHECKING:
    from d2rpick.cli.output import Output

EXAMPLES = """\b
Examples:
  d2rpick first --part 1 --wait 0.02 sample_data/falling_plate/plate_0000.rad -o first/
  d2rpick first --part 1 --wait 0.02 --after 0.05 sample_data/falling_plate/plate_0000.rad -o later/
"""


@options.command("first", EXAMPLES)
@click.argument("deck", type=click_type("file"))
@options.option(
    "part",
    Option(
        "Parts to switch, by number (3,7) or range (10-19).  [default: Radioss, those of bodies that are put off]",
        *("names", "IDS"), many=True,
    ),
)  # fmt: skip
@options.option("wait", Option("Time without force that counts as flight.  [default: by the deck]", POSITIVE, "T"))
@options.option("after", Option("Nothing becomes rigid before.", NOT_NEGATIVE, "T"))
@options.option(
    "output_dir", Option("Folder for the copy, made where there is none.", "file", "DIR", short=("-o",)), required=True
)
@options.takes("overwrite", "quiet")
def first(
    deck: str, part: tuple[str, ...], wait: float | None, after: float | None, output_dir: str, output: Output
) -> None:
    """Write a copy of DECK whose first run switches itself: no reference run is needed.

    The solver makes the parts rigid when no contact has had a force for the wait, and deformable with the next force.
    Radioss: legs that sensors end, and the rigid bodies that the deck lacks.  LS-DYNA: switches with contact codes.
    """
    from d2rpick.api.first_run import prepared

    found = prepared(deck, output_dir, part, wait, after, output.overwrite)
    output.notes(found.notes, ())
    click.echo("\n".join(f"written  {printable(name)}" for name in found.files))
