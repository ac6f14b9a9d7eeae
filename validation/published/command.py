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
from d2rpick.report.formats import Shown, written_by
from validation.published import box, exhibits, reproduction, saving
from validation.published.drawing import draw_exhibit
from validation.published.values import table

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
    place = _made(output_dir)  # the page may go there
    output = output.beside(*solver)
    curves = _solver(solver, tables)  # before the half minute that the box takes
    rows = [row for row in table() if not section or str(row.section) in section]
    answer = reproduction.Reproduction(rows, _exhibits(section, curves))
    files = _write(output, place, answer)
    if output.report:
        output.write(
            output.report, reproduction.as_page(answer, options.repeat()).encode()
        )
    answer = answer._replace(files=files)
    output.result(
        written_by(reproduction, output.output_format, answer, output.shown())
    )
    output.notes([f"{len(files)} files in {output_dir}"], ())
    output.finish(objection=not all(row.agrees for row in answer.rows))


def _exhibits(
    sections: Sequence[str], solver: Mapping[str, Mapping[str, Samples]]
) -> list[Exhibit]:
    """Give the figures of these sections, of all without any, in the order of the paper."""
    makers = [
        *box.exhibits_of(Parameters()),
        *exhibits.exhibits_of(solver),
        (5, saving.exhibit),
    ]
    made = [
        make() for section, make in makers if not sections or str(section) in sections
    ]
    return sorted(made, key=lambda exhibit: (exhibit.section, exhibit.figure))


def _solver(names: Sequence[str], tables: Tables) -> dict[str, dict[str, Samples]]:
    """Read each table by the columns that it has."""
    found = {}
    for name in names:
        (database,) = open_run([name], Selection(energy=("2",))).databases
        kinds = [
            kind
            for kind, columns in tables.items()
            if {*columns} <= {*database.channels}
        ]
        if not kinds:
            known = " or ".join(", ".join(columns) for columns in tables.values())
            raise FormatError(
                f"{name}: the columns are {', '.join(database.channels)}; {known} were expected"
            )
        columns = {
            column: database.channel(database.find(column))
            for column in tables[kinds[0]]
        }
        found[kinds[0]] = {"time_s": database.time, **columns}
    return found


def _made(folder: str) -> Path:
    """Create the folder where it is missing; D2RPickError where that cannot be done."""
    place = Path(folder)
    try:
        place.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise D2RPickError(
            f"{folder}: the folder cannot be created ({error.strerror}); choose another one"
        ) from error
    return place


def _write(output: Output, place: Path, answer: Reproduction) -> list[str]:
    """Write all files, or none where one may not be written; give their names."""
    index, values = (
        reproduction.as_markdown(answer, Shown(), pictures=True),
        reproduction.as_csv(answer, Shown()),
    )
    contents = {"README.md": f"{index}\n".encode(), "table.csv": f"{values}\n".encode()}
    for one in answer.exhibits:
        figure = draw_exhibit(one)
        contents |= {
            f"{one.name}.{form}": figures.render(figure, f"x.{form}")
            for form in PICTURES
        }
        if one.columns:
            contents[f"{one.name}.csv"] = csv_table.write(dict(one.columns))
    named = {str(place / name): content for name, content in contents.items()}
    for name in named:
        output.claim(name)
    for name, content in named.items():
        output.write(name, content)
    return list(named)
