"""The solver runs quoted in the documentation: decks, restart segments, comparison, figures."""

import os
import re
from pathlib import Path

import numpy as np
import pytest

from tests.command import ROOT
from validation.compare import Run, compare, read
from validation.figures import FIGURES, read_results
from validation.models import MODELS
from validation.run import run

TD = 0.068753


@pytest.mark.parametrize("name", MODELS)
def test_a_deck_is_a_starter_deck_with_the_main_node_of_its_rigid_body(
    name: str,
) -> None:
    deck = MODELS[name].deck().decode()
    assert deck.startswith("#RADIOSS STARTER")
    assert re.search(rf"/RBODY/1\n.*\n *{MODELS[name].main} ", deck)
    assert "/TH/PART" in deck


@pytest.mark.parametrize(
    ("windows", "ends", "rigid"),
    [
        ([], ["0.15"], [False]),
        ([(0.01, 0.05)], ["0.01", "0.05", "0.15"], [False, True, False]),
        ([(0.0, 0.05)], ["0.05", "0.15"], [True, False]),
        (
            [(0.01, 0.05), (0.07, 0.08)],
            ["0.01", "0.05", "0.07", "0.08", "0.15"],
            [False, True, False, True, False],
        ),
    ],
)
def test_the_legs_follow_the_windows(
    windows: list[tuple[float, float]], ends: list[str], rigid: list[bool]
) -> None:
    legs = list(MODELS["OSC"].legs(windows))
    assert [leg.splitlines()[1] for leg in legs] == ends
    assert ["/DTIX" in leg for leg in legs] == rigid
    assert ["/RBODY/OFF" in leg for leg in legs] == [not is_rigid for is_rigid in rigid]
    assert ["/INIV" in leg for leg in legs] == [True] + [False] * (len(legs) - 1)


def test_a_run_that_is_its_own_reference_has_no_deviation_and_a_late_landing_is_seen() -> (
    None
):
    time = np.linspace(0, 1, 1001)
    reference = Run(time, 1 + np.sin(30 * time) ** 2, np.maximum(time - 0.8, 0.0))
    comparison = compare(reference, reference, 0.5)
    assert comparison.deviation == 0.0
    assert comparison.mean_ratio == pytest.approx(1.0)
    assert comparison.landing == pytest.approx(0.801, abs=1e-3)
    falling = reference._replace(internal=np.where(time < 0.81, 1e-18, 1.0))
    assert compare(falling, falling, 0.5).deviation is None
    late = compare(
        reference, reference._replace(contact=np.maximum(time - 0.81, 0.0)), 0.5
    )
    assert late.shifts == pytest.approx([0.01], abs=1e-3)


@pytest.mark.parametrize("name", FIGURES)
def test_every_figure_is_drawn_from_the_results_and_shown_in_the_docs(
    name: str,
) -> None:
    assert all(axes.lines or axes.patches for axes in FIGURES[name]().axes)
    pages = [*(ROOT / "docs/explanation").glob("validation*.md")]
    assert any(f"validation/{name}.png" in page.read_text("utf-8") for page in pages)
    assert (ROOT / f"docs/explanation/validation/{name}.png").is_file()


@pytest.mark.skipif(
    "OPENRADIOSS_PATH" not in os.environ, reason="OPENRADIOSS_PATH names no solver"
)
def test_the_solver_confirms_the_better_pair_of_the_oscillator(tmp_path: Path) -> None:
    solver = Path(os.environ["OPENRADIOSS_PATH"])
    reference, switched = (
        read([str(leg) for leg in run(MODELS["OSC"], tmp_path / name, windows, solver)])
        for name, windows in (("reference", []), ("switched", [(0.013587, TD)]))
    )
    comparison = compare(reference, switched, TD)
    assert comparison.deviation is not None
    assert comparison.deviation < 0.01
    assert comparison.mean_ratio == pytest.approx(1.0, abs=0.02)


def test_the_landings_of_plans_that_the_docs_sum_up_are_those_of_the_results_and_after_td() -> (
    None
):
    rows = read_results("drop_plans")
    docs = (ROOT / "docs/explanation/validation-motion.md").read_text("utf-8")
    assert np.all(rows["td_s"] < rows["landing_s"])
    assert np.all(rows["tr_s"] < rows["td_s"])
    number = r"\**([-+]?[\d.]+)\**"
    listed = re.findall(
        rf"^\| `(DROP\d)` \| (\d) \| {' [|] '.join([f'{number} to {number}'] * 3)} \|",
        docs,
        re.MULTILINE,
    )
    assert [box for box, *_ in listed] == sorted({*rows["model"]})
    for box, windows, *ranges in listed:
        of_box = rows[rows["model"] == box]
        assert int(windows) == len(of_box)
        columns = [
            of_box["margin_s"],
            *(
                of_box["landing_s"] - of_box[name]
                for name in ("landing_planned_s", "td_s")
            ),
        ]
        wanted = [
            1e3 * limit for column in columns for limit in (column.min(), column.max())
        ]
        assert [float(limit) for limit in ranges] == pytest.approx(wanted, abs=0.051)
