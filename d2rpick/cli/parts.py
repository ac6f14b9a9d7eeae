"""The command ``parts``."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.api.request import LIMITS, READING
from d2rpick.cli import options
from d2rpick.cli.options import DECK, HISTORY, RESULT
from d2rpick.cli.progress import opened
from d2rpick.errors import ArgumentError
from d2rpick.report.formats import FORMATS

if TYPE_CHECKING:
    from d2rpick.api.request import Request
    from d2rpick.cli.output import Output

EXAMPLES = """\b
Examples:
  d2rpick parts sample_data/rollover_box.matsum
  d2rpick parts --deck sample_data/rollover_box.k sample_data/rollover_box.matsum
  d2rpick parts --deck sample_data/rollover_box.k -f json sample_data/rollover_box.matsum
  d2rpick parts --deck sample_data/rollover_box.k --report parts.html sample_data/rollover_box.matsum
"""


@options.command("parts", EXAMPLES)
@options.time("--tr", "With --td: compare the sets in this window.")
@options.time("--td", "Compare the sets in a window that ends here.  [default: at the end of the longest flight]")
@options.takes(
    *("deck", "weights", HISTORY, *READING, *LIMITS, "step_ratio", "report", *RESULT),
    deck=f"{DECK}.",
    step_ratio="Time step while rigid over that before, 1 or more.",
    report="Write everything to one HTML page to read and sign.",
    forms=FORMATS["parts"],
)
def command(tr: float | None, td: float | None, request: Request, output: Output) -> None:
    """Say which parts of a run may be switched, and what sets of them save.

    Each part with its elements, material, mass and energy, and a verdict with its reasons; then sets of parts with the
    run time that they save, and the one to take.  A set that --part names is compared too.
    """
    from d2rpick.api.costs import check_times, tabled

    check_times(tr, td)
    if request.energy:
        raise ArgumentError("`energy` names one energy for the whole model; parts compares those of its parts")
    with opened(request, output) as (run, output):
        answer = tabled(run, request, tr, td)
    output.notes(run.notes, answer.cautions)
    output.beside_answer(answer, lambda: answer.page(options.repeat()))
    output.answer(answer)
    output.finish(objection=answer.recommended is None)
