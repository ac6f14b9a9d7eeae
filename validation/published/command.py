"""What ``d2rpick reproduce`` does: the figures and tables of the sections that are asked for."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from d2rpick.base.errors import D2RPickError, FormatError
from d2rpick.cli import options
from d2rpick.histories.formats import csv_table
from d2rpick.histories.opening import Selection, open_run
from d2rpick.models.box_model import Parameters
from d2rpick.report import figures
from d2rpick.report.formats import DisplayOptions, write_by_module
from validation.published import box, exhibits, reproduction, saving
from validation.published.drawing import draw_exhibit
from validation.published.values import make_values_table

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from d2rpick.cli.output import Output
    from d2rpick.histories.history import Samples
    from validation.published.exhibits import Exhibit
    from validation.published.reproduction import Reproduction

    Tables = Mapping[str, Sequence[str]]

PICTURES = ("svg", "png")


def reproduce(
    output_dir: str,
    section: Sequence[str],
    solver: Sequence[str],
    tables: Tables,
    output: Output,
) -> None:
    """Write the figures and tables of these sections, of all without any, and the answer.

    ``tables``: the columns of a solver's table beside its times, by what it is.
    """
    folder = _make_folder(output_dir)  # the page may go there
    output = output.beside(*solver)
    curves = _read_solver_tables(
        solver, tables
    )  # before the half minute that the box takes
    rows = [
        row for row in make_values_table() if not section or str(row.section) in section
    ]
    answer = reproduction.Reproduction(rows, make_exhibits(section, curves))
    files = _write(output, folder, answer)
    if output.report:
        output.write(
            output.report,
            reproduction.as_page(answer, options.repeat_command()).encode(),
        )
    answer = answer._replace(files=files)
    output.result(
        write_by_module(reproduction, output.output_format, answer, output.shown())
    )
    output.notes([f"{len(files)} files in {output_dir}"], ())
    output.finish(objection=not all(row.agrees for row in answer.rows))


def make_exhibits(
    sections: Sequence[str], solver: Mapping[str, Mapping[str, Samples]]
) -> list[Exhibit]:
    """Give the figures of these sections, of all without any, in the order of the paper."""
    makers = [
        *box.list_box_exhibits(Parameters()),
        *exhibits.list_exhibits(solver),
        (5, saving.make_saving_exhibit),
    ]
    made = [
        make() for section, make in makers if not sections or str(section) in sections
    ]
    return sorted(made, key=lambda exhibit: (exhibit.section, exhibit.figure))


def _read_solver_tables(
    names: Sequence[str], tables: Tables
) -> dict[str, dict[str, Samples]]:
    """Read each table by the columns that it has."""
    tables_by_name = {}
    for name in names:
        (database,) = open_run([name], Selection(energy=("2",))).databases
        kinds = [
            kind
            for kind, columns in tables.items()
            if {*columns} <= {*database.channels}
        ]
        if not kinds:
            columns_expected = " or ".join(
                ", ".join(columns) for columns in tables.values()
            )
            raise FormatError(
                f"{name}: the columns are {', '.join(database.channels)}; {columns_expected} were expected"
            )
        columns = {
            column: database.channel(database.find(column))
            for column in tables[kinds[0]]
        }
        tables_by_name[kinds[0]] = {"time_s": database.time, **columns}
    return tables_by_name


def _make_folder(folder: str) -> Path:
    """Create the folder where it is missing; D2RPickError where that cannot be done."""
    path = Path(folder)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise D2RPickError(
            f"{folder}: the folder cannot be created ({error.strerror}); choose another one"
        ) from error
    return path


def _write(output: Output, folder: Path, answer: Reproduction) -> list[str]:
    """Write all files, or none where one may not be written; give their names."""
    index, values = (
        reproduction.as_markdown(answer, DisplayOptions(), pictures=True),
        reproduction.as_csv(answer, DisplayOptions()),
    )
    contents = {"README.md": f"{index}\n".encode(), "table.csv": f"{values}\n".encode()}
    for exhibit in answer.exhibits:
        figure = draw_exhibit(exhibit)
        contents |= {
            f"{exhibit.name}.{form}": figures.render(figure, f"x.{form}")
            for form in PICTURES
        }
        if exhibit.columns:
            contents[f"{exhibit.name}.csv"] = csv_table.write(dict(exhibit.columns))
    file_contents = {str(folder / name): content for name, content in contents.items()}
    for name in file_contents:
        output.claim(name)
    for name, content in file_contents.items():
        output.write(name, content)
    return list(file_contents)
