"""The command ``reproduce``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from d2rpick.cli import options as shared
from d2rpick.cli.output import Output, finish

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from d2rpick.histories.history import Samples
    from d2rpick.models.published import Row
    from d2rpick.models.published_figures import Exhibit

EXAMPLES = """\b
Examples:
  d2rpick reproduce --output-dir paper
  d2rpick reproduce --output-dir paper --overwrite --solver sample_data/oscillator_solver.csv -f markdown
"""
SOLVER = ("reference_m", "published_m", "better_m")
PICTURES = ("svg", "png")


@click.command("reproduce", epilog=EXAMPLES)
@click.option(
    "--output-dir",
    metavar="DIR",
    required=True,
    type=shared.FILE,
    help="Folder for figures and tables; created if missing.",
)
@click.option(
    "--solver",
    metavar="FILE",
    type=shared.FILE,
    help=f"Solver run of the same oscillator to draw for comparison: a table of time_s, {', '.join(SOLVER)}.",
)
@shared.output_options("table", "json", "csv", "markdown")
@click.pass_context
def command(
    ctx: click.Context, /, output_dir: str, solver: str | None, output_format: str, exit_zero: bool, **options: Any
) -> None:
    """Reproduce the published oscillator results as figures (svg, png) and tables (csv).

    Displacement for several pairs, closed form against numerical integration, the energy level and the motion that
    follows, beside it the better pair; published numbers beside those found here.
    """
    from d2rpick.models.published import table
    from d2rpick.models.published_figures import exhibits
    from d2rpick.report import reproduction as report

    output = Output.of(options, *([solver] if solver else []))
    rows, shown = table(), exhibits(_solver(solver) if solver else None)
    files = _write(output, output_dir, rows, shown)
    texts = {
        "table": lambda: report.as_table(rows),
        "markdown": lambda: report.as_markdown(rows),
        "csv": lambda: report.as_csv(rows),
        "json": lambda: report.as_json(rows, files, ctx.meta["d2rpick.command"]),
    }
    output.result(texts[output_format]())
    output.notes([f"{len(files)} files in {output_dir}"], ())
    finish(ctx, objection=any(row.agrees is False for row in rows), exit_zero=exit_zero)


def _solver(name: str) -> Mapping[str, Samples]:
    from d2rpick.histories.opening import Selection, open_run

    (database,) = open_run([name], Selection(energy=SOLVER[:1])).databases
    return {"time_s": database.time, **{column: database.channel(database.find(column)) for column in SOLVER}}


def _write(output: Output, folder: str, rows: Sequence[Row], shown: Sequence[Exhibit]) -> list[str]:
    """Write all files, or none where one may not be written; give their names."""
    from pathlib import Path

    from d2rpick.errors import D2RPickError
    from d2rpick.histories.formats import csv_table
    from d2rpick.report import figures, figures_models
    from d2rpick.report import reproduction as report

    place = Path(folder)
    try:
        place.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise D2RPickError(f"{folder}: the folder cannot be created ({error.strerror}); choose another one") from error
    index = report.as_markdown(rows, [(one.title, f"{one.name}.svg") for one in shown])
    contents = {"README.md": f"{index}\n".encode(), "table.csv": f"{report.as_csv(rows)}\n".encode()}
    for one in shown:
        figure = figures_models.draw_exhibit(one)
        contents |= {f"{one.name}.{form}": figures.render(figure, f"x.{form}") for form in PICTURES}
        contents[f"{one.name}.csv"] = csv_table.write(dict(one.columns))
    named = {str(place / name): content for name, content in contents.items()}
    for name in named:
        output.claim(name)
    for name, content in named.items():
        output.write(name, content)
    return list(named)
