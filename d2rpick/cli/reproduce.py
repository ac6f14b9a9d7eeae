"""The command ``reproduce``."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from d2rpick.cli import options
from d2rpick.cli.options import RESULT
from d2rpick.cli.values import click_type
from d2rpick.report.formats import FORMATS

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from d2rpick.cli.output import Output
    from d2rpick.histories.history import Samples
    from d2rpick.models.published_figures import Exhibit
    from d2rpick.report.reproduction import Reproduction

EXAMPLES = """\b
Examples:
  d2rpick reproduce --output-dir paper --section 2
  d2rpick reproduce --output-dir paper --overwrite --section 3 --solver sample_data/oscillator_solver_6_80.csv
  d2rpick reproduce --output-dir paper --overwrite --section 5 --report paper.html -f markdown
"""
# Columns of a solver's table beside time_s, by what it is.
SOLVER = {
    "pairs": ("reference_m", "published_m", "better_m"),
    "run": ("z_m", "y_m", "vz_mps", "vy_mps"),
}
SECTIONS = ("1", "2", "3", "4", "5")
PICTURES = ("svg", "png")


@options.command("reproduce", EXAMPLES)
@click.option(
    "--output-dir",
    metavar="DIR",
    required=True,
    type=click_type("file"),
    help="Folder for figures and tables; created if missing.",
)
@click.option(
    "--section",
    type=click.Choice(SECTIONS),
    multiple=True,
    help="Only the figures of this section of the paper; repeatable.  1: the setting, early switches of the box; 2: "
    "the oscillator; 3: finite elements; 4: the choice, the revised pair, variants; 5: what is saved.",
)
@click.option(
    "--solver",
    metavar="FILE",
    multiple=True,
    type=click_type("file"),
    help="A solver's runs of the same oscillator to draw for comparison: a table of time_s and "
    + ", or ".join(", ".join(columns) for columns in SOLVER.values())
    + "; repeatable.",
)
@options.takes("report", *RESULT, report="Write all of it to one HTML page.", forms=FORMATS["reproduction"])
def reproduce(output_dir: str, section: Sequence[str], solver: Sequence[str], output: Output) -> None:
    """Reproduce the published results as figures (svg, png) and tables (csv), section by section.

    Each figure stands with what the paper shows there, what is found here, and whether the two agree; the table puts
    published numbers and reference values beside those found here.  The figures of the box (sections 1 and 4) take
    about half a minute.
    """
    from d2rpick.models.published import table
    from d2rpick.report.formats import write
    from d2rpick.report.reproduction import Reproduction

    place = _made(output_dir)  # the page may go there
    output = output.beside(*solver)
    curves = _solver(solver)  # before the half minute that the box takes
    answer = Reproduction(table(), list(_exhibits(section, curves)))
    files = _write(output, place, answer)
    if output.report:
        from d2rpick.report.pages import reproduction_page

        output.write(output.report, reproduction_page(answer.rows, answer.exhibits, options.repeat()).encode())
    answer = answer._replace(files=files)
    output.result(write("reproduction", output.output_format, answer, output.shown()))
    output.notes([f"{len(files)} files in {output_dir}"], ())
    output.finish(objection=not all(row.agrees for row in answer.rows))


def _exhibits(sections: Sequence[str], solver: Mapping[str, Mapping[str, Samples]]) -> Iterator[Exhibit]:
    """Give the figures of these sections, of all without any, in the order of the paper."""
    from d2rpick.models import published_box, published_figures, saving
    from d2rpick.models.box_model import Parameters

    of_box, of_oscillator = published_box.exhibits_of(Parameters()), published_figures.exhibits_of(solver)
    makers = sorted([*of_box, *of_oscillator, (5, saving.exhibit)], key=lambda one: one[0])
    return (make() for section, make in makers if str(section) in (sections or SECTIONS))


def _solver(names: Sequence[str]) -> dict[str, dict[str, Samples]]:
    """Read each table by the columns that it has."""
    from d2rpick.base.errors import FormatError
    from d2rpick.histories.opening import Selection, open_run

    found = {}
    for name in names:
        (database,) = open_run([name], Selection(energy=("2",))).databases
        kinds = [kind for kind, columns in SOLVER.items() if {*columns} <= {*database.channels}]
        if not kinds:
            known = " or ".join(", ".join(columns) for columns in SOLVER.values())
            raise FormatError(f"{name}: the columns are {', '.join(database.channels)}; {known} were expected")
        columns = {column: database.channel(database.find(column)) for column in SOLVER[kinds[0]]}
        found[kinds[0]] = {"time_s": database.time, **columns}
    return found


def _made(folder: str) -> Path:
    """Create the folder where it is missing; D2RPickError where that cannot be done."""
    from pathlib import Path

    from d2rpick.base.errors import D2RPickError

    place = Path(folder)
    try:
        place.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise D2RPickError(f"{folder}: the folder cannot be created ({error.strerror}); choose another one") from error
    return place


def _write(output: Output, place: Path, answer: Reproduction) -> list[str]:
    """Write all files, or none where one may not be written; give their names."""
    from d2rpick.histories.formats import csv_table
    from d2rpick.report import figures, figures_models, reproduction

    index = reproduction.as_markdown(answer, pictures=True)
    contents = {"README.md": f"{index}\n".encode(), "table.csv": f"{reproduction.as_csv(answer.rows)}\n".encode()}
    for one in answer.exhibits:
        figure = figures_models.draw_exhibit(one)
        contents |= {f"{one.name}.{form}": figures.render(figure, f"x.{form}") for form in PICTURES}
        if one.columns:
            contents[f"{one.name}.csv"] = csv_table.write(dict(one.columns))
    named = {str(place / name): content for name, content in contents.items()}
    for name in named:
        output.claim(name)
    for name, content in named.items():
        output.write(name, content)
    return list(named)
