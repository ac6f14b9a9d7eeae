"""Each figure has one message: the flight, the acceptable times in it, or the differences between runs."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.patches import Patch
from matplotlib.transforms import Bbox

import d2rpick as d2
from d2rpick.choice.answers import suggest_in_history
from d2rpick.choice.question import Settings
from d2rpick.choice.runs.study import Common, StudyOfRuns, StudyRow
from d2rpick.histories.history import History
from d2rpick.report.figures_choice import draw_study, draw_suggestion, draw_trade_off
from d2rpick.report.formats import DisplayOptions
from d2rpick.report.study import shorten_names
from tests.command import BOX, ENERGY, MATSUM, ROOT
from tests.energies import require

SWITCHED_RUN = "switched run, as computed"


def list_texts(axes: Axes) -> list[str]:
    return [text.get_text() for text in axes.texts]


def test_load_and_landing_are_both_cut_with_a_mark() -> None:
    (axes,) = (
        d2.suggest(
            d2.read(ROOT / "sample_data" / "rollover_box.matsum"), td=0.37, parts="box"
        )
        .plot()
        .axes
    )
    assert [text for text in list_texts(axes) if "\u2191" in text] == [
        "load, up to 70.09 \u2191",
        "landing, up to 52.09 \u2191",
    ]


def list_marks(axes: Axes) -> list[int]:
    return [
        len(np.asarray(collection.get_offsets())) for collection in axes.collections
    ]


def find_extents(patch: Patch) -> Bbox:
    """Return width and height in the coordinates of the patch; older matplotlib draws a span as a polygon."""
    path = patch.get_path().transformed(patch.get_patch_transform())
    return path.get_extents()


def test_many_candidates_become_a_band_and_the_landing_is_cut_with_a_mark() -> None:
    answer = d2.suggest(d2.read(BOX), td=0.37, parts="box")
    assert len(answer.candidates) > 20
    (axes,) = answer.plot().axes
    assert axes.get_ylim()[1] < 4
    assert axes.get_xlim() == pytest.approx((0.0736, 0.3989), abs=1e-3)
    assert "landing, up to 1248 \u2191" in list_texts(axes)
    assert list_marks(axes) == [1]  # only the recommended one
    drawn_patches = map(find_extents, axes.patches)
    bands = [drawn_patch for drawn_patch in drawn_patches if drawn_patch.height < 0.1]
    drawn = sum(drawn_patch.width for drawn_patch in bands)
    assert drawn == pytest.approx(
        sum(
            drawn_patch.end - drawn_patch.start
            for drawn_patch in require(answer.windows)
        ),
        rel=0.03,
    )
    assert len(bands) < len(require(answer.windows))  # invisible gaps are closed


@pytest.mark.parametrize("replay", [True, False])
def test_the_band_is_known_on_every_basis(replay: bool) -> None:
    answer = d2.suggest(d2.read(ENERGY), td=0.0687534, replay=replay)
    windows = answer.acceptable_windows
    assert any(start <= require(answer.recommended).tr <= end for start, end in windows)
    assert all(start <= end < answer.situation.td for start, end in windows)


def test_few_candidates_are_marks_acceptable_or_not() -> None:
    answer = d2.suggest(d2.read(ENERGY), td=0.0687534)
    energy, motion = answer.plot().axes
    acceptable = sum(candidate.acceptable for candidate in answer.candidates)
    assert list_marks(energy) == [acceptable, len(answer.candidates) - acceptable]
    assert len(motion.lines) == 4  # both motions, tr and td


def test_a_recommended_tr_of_a_large_residual_is_marked_as_admissible() -> None:
    """Its residual of 0.58 hardly matters in the next contact, so the pair may be used with care."""
    run = d2.read(ROOT / "sample_data/rollover_box.matsum")
    answer = d2.suggest(run, td=0.345455, parts="1,2")
    assert require(answer.decision).verdict == "use with care"
    labels = [marks.get_label() for marks in answer.plot().axes[0].collections]
    assert "admissible" in labels
    assert "not admissible" not in labels


def test_the_figure_of_a_page_holds_the_better_pair_in_a_look_of_its_own() -> None:
    answer = d2.suggest(d2.read(ENERGY), td=0.064)
    better = require(answer.clearly_better)
    figure = draw_suggestion(answer, page=True)
    energy, motion = figure.axes
    lines = [
        line
        for line in (*energy.lines, *motion.lines)
        if line.get_label() == "better pair"
    ]
    assert len(lines) == 6  # level, times in both axes, and the energy after td
    assert np.unique(lines[0].get_ydata()).tolist() == [
        answer.situation.at(better.td).energy_td
    ]
    assert np.unique([line.get_xdata() for line in lines[1:3]]).tolist() == [
        better.tr,
        better.td,
    ]
    assert {line.get_linestyle() for line in lines} == {"-."}
    assert not any(
        line.get_label() == "better pair"
        for axes in draw_suggestion(answer).axes
        for line in axes.lines
    )
    (legend,) = figure.legends
    assert "better pair" in {text.get_text() for text in legend.get_texts()}


@pytest.mark.parametrize("scale", [1e-12, 1.0, 7e4, 1e15])
def test_nothing_of_a_pages_figure_lies_outside_of_it_whatever_the_unit(
    scale: float,
) -> None:
    time, energy = np.loadtxt(ENERGY, delimiter=",", skiprows=1, usecols=(0, 5)).T
    history = History(
        time * scale, (energy + energy.max()) * scale, ("made",), "made", "E"
    )
    figure = draw_suggestion(
        suggest_in_history(history, 0.064 * scale, Settings()), page=True
    )
    box, (width, height) = figure.get_tightbbox(), figure.get_size_inches()
    assert box.x0 >= -0.01
    assert box.y0 >= -0.01
    assert box.x1 <= width + 0.01
    assert box.y1 <= height + 0.01


def test_what_rests_is_drawn_flat_beside_what_the_run_has() -> None:
    """Round-off of 1e-21 J is flat next to a landing of 40 J or, if nothing lands, on the scale of the energy."""
    time = np.linspace(0, 1, 501)
    energy = 1e-21 * (1 + np.sin(40 * time)) + 40.0 * (time > 0.9)
    answer = suggest_in_history(
        History(time, energy, ("made",), "made", "E"), 0.8, Settings(after=0.01)
    )
    assert answer.situation.at_rest
    for page in (False, True):
        axes = draw_suggestion(answer, page=page).axes[0]
        assert axes.get_yscale() == "linear"
        assert axes.get_ylim() == pytest.approx((-3.2, 43.2))
    best = require(answer.chosen)
    assert (best.level_error, best.level_ratio) == (0.0, None)
    resting = replace(
        make_row("run", 0.01),
        curve=np.stack([time, energy]),
        energy_td=1e-21,
        warnings=("at-rest",),
    )
    assert draw_study(make_study(resting)).axes[0].get_ylim()[1] == pytest.approx(43.2)


def test_a_pair_that_must_not_be_used_is_not_called_recommended_or_admissible() -> None:
    """Every td of the box alone is refused, whatever its energy."""
    run = d2.read(MATSUM)
    exploration = d2.explore(run, td_window=(0.36, 0.37), parts="box", steps=3)
    pair = require(exploration.recommended)
    assert require(exploration.suggestion.decision).verdict == "do not use"
    energy, *_ = draw_trade_off(exploration).axes
    labels = [line.get_label() for line in energy.lines]
    assert "chosen (do not use)" in labels
    assert "recommended" not in labels
    assert energy.get_title(loc="left") == (
        f"tr = {pair.tr:.6g}, td = {pair.td:.6g}: do not use"
    )
    suggestion = d2.suggest(run, td=pair.td, parts="box")
    assert require(suggestion.decision).verdict == "do not use"
    (axes,) = draw_suggestion(suggestion).axes
    labels = [marks.get_label() for marks in (*axes.collections, *axes.patches)]
    assert not [label for label in labels if "admissible" in str(label)]
    assert "admissible" not in suggestion.text("table", DisplayOptions(()))


@pytest.mark.slow
@pytest.mark.parametrize("page", [False, True])
def test_the_first_and_the_last_td_of_a_trade_off_stand_clear_of_the_edge(
    page: bool,
) -> None:
    exploration = d2.explore(d2.read(ENERGY), td_window=(0.06, 0.0687534), replay=False)
    offers = exploration.offers
    for axes in draw_trade_off(exploration, page=page).axes:
        low, high = axes.get_xlim()
        room = 0.01 * (high - low)
        assert low + room < offers[0].td <= offers[-1].td < high - room


def make_row(name: str, tr: float, level: float = 1.0) -> StudyRow:
    time = np.linspace(0, 1, 50)
    energy = level * (1 + 0.1 * np.sin(20 * time)) + 500 * (time > 0.95)
    return StudyRow(name, "ok", tr=tr, energy_td=level, curve=np.stack([time, energy]))


def make_study(*rows: StudyRow) -> StudyOfRuns:
    return StudyOfRuns(0.8, None, rows, None, None, Common(None, None, "made"), ())


def test_up_to_ten_runs_have_a_name_and_a_look_of_their_own() -> None:
    (axes,) = draw_study(
        make_study(
            *(make_row(f"runs/{i}/glstat", 0.2 + i / 100, 1 + i) for i in range(10))
        )
    ).axes
    lines = axes.lines[:10]
    assert len({(line.get_color(), line.get_linestyle()) for line in lines}) == 10
    assert {*list_texts(axes)} >= {str(i) for i in range(10)}
    assert axes.get_ylim()[1] < 20  # the landing is cut
    heights = sorted(text.xyann[1] for text in axes.texts if text.get_text().isdigit())  # type: ignore[attr-defined]
    assert min(np.diff(heights)) > 0.05


def test_of_many_runs_those_that_stand_out_are_named() -> None:
    rows = [make_row(f"run{i}", 0.2 + i / 1000) for i in range(30)]
    (axes,) = draw_study(make_study(*rows, make_row("odd", 0.5))).axes
    assert "odd" in list_texts(axes)
    assert "run3" not in list_texts(axes)
    assert axes.collections[0].get_label() == "internal energy of 31 runs"


@pytest.mark.parametrize("page", [False, True])
def test_runs_of_any_energy_can_be_drawn(page: bool) -> None:
    rows = [
        make_row("zero", 0.2, 0.0),
        make_row("one", 0.2),
        make_row("large", 0.3, 1e6),
    ]
    figure = draw_study(make_study(*rows), page=page)
    figure.canvas.draw()
    assert draw_study(make_study()).axes


def test_short_names_tell_runs_apart() -> None:
    assert shorten_names(["a/b/soft/box/glstat", "a/b/hard/box/glstat"]) == (
        "soft",
        "hard",
    )
    assert shorten_names(["one.csv"]) == ("one.csv",)
    assert shorten_names(["x/one.csv", "x/one.csv"]) == ("one.csv", "one.csv")
    assert shorten_names(["one.csv", "deep/er/one.csv"]) == (
        "one.csv",
        "deep/er/one.csv",
    )
    assert shorten_names([]) == ()


def test_a_finished_switched_run_is_drawn_as_it_was_computed() -> None:
    reference = d2.read(ENERGY)
    verdict = d2.verify(reference, tr=0.0135867, td=0.0687534, switched=reference)
    (energy,) = verdict.plot().axes
    (line,) = (
        energy_line
        for energy_line in energy.lines
        if energy_line.get_label() == SWITCHED_RUN
    )
    assert np.array_equal(line.get_ydata(), require(verdict.computed).energy)


def test_a_plan_names_no_negative_energies_and_the_times_of_its_windows() -> None:
    plan = d2.plan(d2.read(ENERGY))
    (axes,) = plan.plot().axes
    assert axes.get_ylim()[0] == 0
    assert max(axes.get_yticks()) < axes.get_ylim()[1]
    (label,) = (text.get_text() for text in axes.texts if text.get_text()[:1] == "1")
    ((tr, td),) = plan.windows
    assert label == f"1: tr = {tr:.4g}, td = {td:.4g}"
