"""The command ``rule``."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from d2rpick.cli import options
from d2rpick.cli.options import FILES

if TYPE_CHECKING:
    from d2rpick.cli.output import Output

EXAMPLES = """\b
Examples:
  d2rpick rule
  d2rpick rule D2R105
"""


@options.command("rule", EXAMPLES)
@click.argument("id", metavar="[ID]...", nargs=-1)
@options.takes(*FILES)
def command(id: tuple[str, ...], output: Output) -> None:  # noqa: A002  the name is that of the argument in usage
    """Explain a rule of `d2rpick check`, with decks that pass and fail; without ID, list all rules."""
    from d2rpick.report import findings as report
    from d2rpick.rules import find_rules

    output = output.beside()
    rules = [rule for name in id for rule in find_rules(name)]
    output.result("\n\n\n".join(map(report.as_text, rules)) if rules else report.as_list())
