"""Units of energy on axes and in headings: those given in the header of the energy column, and no others."""

from pathlib import Path

import pytest

import d2rpick as d2
from d2rpick.report.figures_choice import draw_plan, draw_suggestion, draw_trade_off
from d2rpick.report.formats import DisplayOptions
from tests.command import ENERGY

LINES = Path(ENERGY).read_text().splitlines()[1:]


def write_table(folder: Path, *heads: str) -> str:
    """Write the history of the oscillator, with a column of its energy for each head."""
    table = folder / "table.csv"
    columns = [
        ",".join([cells[0], *[cells[5]] * len(heads)])
        for cells in (line.split(",") for line in LINES)
    ]
    table.write_text("\n".join([",".join(["time", *heads]), *columns]) + "\n")
    return str(table)


@pytest.mark.parametrize(
    ("head", "unit"),
    [
        ("internal_energy_J", "J"),
        ("internal_energy_mJ", "mJ"),
        ("internal_energy_kJ", "kJ"),
        ("Internal energy [J]", "J"),
        ("Internal energy (N*mm)", "N*mm"),
        ("internal_energy", ""),
        ("Internal energy [-]", ""),
        ("Internal energy [s]", ""),
    ],
)
def test_axes_have_the_unit_of_the_energy(tmp_path: Path, head: str, unit: str) -> None:
    answer = d2.suggest(d2.read(write_table(tmp_path, head)), td=0.064)
    assert answer.situation.history.energy_unit == unit
    labels = [axes.get_ylabel() for axes in draw_suggestion(answer).axes[:2]]
    root = f"√({unit})" if "*" in unit else f"√{unit or 'energy'}"
    assert labels == [
        f"internal energy [{unit}]" if unit else "internal energy",
        f"deformation [{root}]",
    ]
    text = answer.text("table", DisplayOptions())
    energy = f"{answer.situation.energy_td:.6g}"
    assert (f"energy {energy} {unit}, kinetic" in text) == bool(unit)
    assert (f"energy {energy}, kinetic" in text) == (not unit)


def test_figures_of_plan_and_explore_have_the_unit_too(tmp_path: Path) -> None:
    run = d2.read(write_table(tmp_path, "internal_energy_mJ"))
    plan = draw_plan(d2.plan(run))
    exploration = d2.explore(run, td_window=(0.06, 0.07), steps=3)
    trade_off = draw_trade_off(exploration)
    assert plan.axes[0].get_ylabel() == "internal energy [mJ]"
    assert trade_off.axes[0].get_ylabel() == "internal energy [mJ]"
    page = exploration.page([])
    assert '"energy_label":"internal energy [mJ]"' in page.replace('": "', '":"')


@pytest.mark.parametrize(
    ("heads", "unit"),
    [
        (("box [J]", "frame [J]"), "J"),
        (("box [J]", "frame [kJ]"), ""),
        (("box [J]", "frame"), ""),
    ],
)
def test_a_sum_has_a_unit_only_if_all_its_terms_have_it(
    tmp_path: Path, heads: tuple[str, ...], unit: str
) -> None:
    run = d2.read(write_table(tmp_path, *heads), energy=heads)
    assert d2.suggest(run, td=0.064).situation.history.energy_unit == unit


@pytest.mark.parametrize("unit", ["mJ", ""])
def test_json_measures_and_the_figure_of_study_have_the_unit(
    tmp_path: Path, unit: str
) -> None:
    table = write_table(tmp_path, f"internal_energy_{unit}" if unit else "energy")
    run = d2.read(table, energy=2)
    verdict = d2.verify(run, tr=0.0135867, td=0.0687534)
    for answer in (verdict, d2.suggest(run, 0.064), d2.plan(run)):
        assert answer.to_dict()["history"]["energy_unit"] == unit
    name = f"energy at td [{unit}]" if unit else "energy at td "
    assert name in verdict.text("table", DisplayOptions())
    study = d2.study([table], td=0.0687534, energy=2)
    assert [row["energy_unit"] for row in study.to_dict()["runs"]] == [unit]
    label = f"internal energy [{unit}]" if unit else "internal energy"
    assert study.plot().axes[0].get_ylabel() == label
