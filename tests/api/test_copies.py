"""Runs and answers can be copied, compared and sent to other processes; numpy values and None work everywhere."""

import copy
import pickle
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import d2rpick as d2
from d2rpick.api.choosing import Choosing
from d2rpick.histories.content import OnDisk
from tests.command import DECK, ENERGY, GLSTAT, MATSUM, put
from tests.sample_deck import DECK as SAMPLE_DECK

loose: Any = d2  # for what a type checker would not let pass
OF_BOX: Any = {"parts": 1, "replay": False}

ANSWERS: dict[str, Callable[[], Any]] = {
    "run": lambda: d2.read(GLSTAT),
    "overview": lambda: d2.read(ENERGY).overview(),
    "suggest": lambda: d2.suggest(d2.read(ENERGY), 0.064),
    "suggest with a deck": lambda: d2.suggest(
        d2.read(MATSUM), 0.37, deck=SAMPLE_DECK, **OF_BOX
    ),
    "verify": lambda: d2.verify(d2.read(ENERGY), 0.0135867, 0.0687534),
    "verify a poor pair": lambda: d2.verify(d2.read(ENERGY), 0.0128855, 0.064),
    "explore": lambda: d2.explore(d2.read(MATSUM), steps=3, **OF_BOX),
    "plan": lambda: d2.plan(d2.read(MATSUM), **OF_BOX),
    "parts": lambda: d2.parts(d2.read(MATSUM), replay=False),
    "study": lambda: d2.study([ENERGY], td=0.064, replay=False),
    "check": lambda: d2.check(DECK),
    "frame": lambda: d2.from_frame(pd.read_csv(ENERGY)),
}


@pytest.mark.parametrize("name", ANSWERS)
def test_a_copy_is_equal(name: str) -> None:
    answer = ANSWERS[name]()
    copies = (
        pickle.loads(pickle.dumps(answer)),
        copy.deepcopy(answer),
        copy.copy(answer),
    )
    assert [copied == answer for copied in copies] == [True] * 3
    assert len({answer, *copies}) == 1
    assert answer != ANSWERS["run" if name != "run" else "check"]()


def test_a_copy_of_a_run_gives_the_same_answers() -> None:
    run = d2.read(MATSUM)
    assert d2.plan(pickle.loads(pickle.dumps(run)), **OF_BOX) == d2.plan(run, **OF_BOX)


def test_other_answers_are_not_equal() -> None:
    run = d2.read(ENERGY)
    assert d2.suggest(run, 0.064, replay=False) != d2.suggest(run, 0.065, replay=False)
    assert run != d2.read(GLSTAT)
    assert run != d2.read(ENERGY, energy="internal_energy")


@pytest.mark.slow
def test_runs_and_answers_go_to_other_processes() -> None:
    runs = [d2.read(ENERGY), d2.read(GLSTAT)]
    ask = partial(d2.suggest, td=0.064, replay=False)
    with ProcessPoolExecutor(2) as pool:
        assert list(pool.map(ask, runs)) == [ask(run) for run in runs]


def write_big_table(tmp_path: Path) -> Path:
    rows = "".join(f"{i / 1000:.6f},{i % 7}\n" for i in range(1_500_000))
    return Path(put(tmp_path / "big.csv", f"time,internal_energy\n{rows}"))


@pytest.mark.slow
def test_a_copy_of_a_big_file_opens_it_again_unless_it_was_changed(
    tmp_path: Path,
) -> None:
    file = write_big_table(tmp_path)
    run = d2.read(file)
    assert isinstance(run.files.files[0].data, OnDisk)
    pickled = pickle.dumps(run)
    assert len(pickled) < 20_000
    assert pickle.loads(pickled).to_frame().shape == (1_500_000, 1)
    file.write_text("time,internal_energy\n0,0\n1,1\n")
    with pytest.raises(d2.ChangedError, match="became shorter"):
        pickle.loads(pickled)
    file.unlink()
    with pytest.raises(
        d2.FormatError, match="cannot be copied: its file cannot be read"
    ):
        pickle.loads(pickled)


@pytest.mark.slow
def test_numbers_of_numpy_are_taken_wherever_numbers_go() -> None:
    run, box = d2.read(ENERGY), d2.read(MATSUM)
    exact = d2.suggest(run, td=0.0625, margin=0.001, replay=False)
    for td in (np.float64(0.0625), np.float32(0.0625), np.array(0.0625)):
        assert (
            loose.suggest(run, td=td, margin=np.float64(0.001), replay=np.False_)
            == exact
        )
    window = d2.suggest(run, td_window=(0.06, 0.07), replay=False)
    for pair in (
        np.array([0.06, 0.07]),
        [0.06, 0.07],
        pd.Series([0.06, 0.07]),
        (np.float64(0.06), np.float64(0.07)),
    ):
        assert loose.suggest(run, td_window=pair, replay=False) == window
    chosen = d2.plan(box, parts=[1], replay=False, min_quality="poor")
    for parts in (
        np.array([1]),
        np.int64(1),
        np.array(1),
        pd.Series([1]),
        {1},
        range(1, 2),
        np.array(["box"]),
    ):
        expected = (
            chosen
            if "box" not in str(parts)
            else d2.plan(box, parts="box", replay=False, min_quality="poor")
        )
        assert (
            loose.plan(box, parts=parts, replay=False, min_quality="poor").windows
            == expected.windows
        )
    explored = d2.explore(run, td_window=(0.06, 0.07), steps=4, replay=False)
    assert (
        loose.explore(run, td_window=(0.06, 0.07), steps=np.int32(4), replay=False)
        == explored
    )
    cards = d2.card([(0.1, 0.2)], parts=1, swset=(11, 12))
    assert str(
        loose.card(
            np.array([[0.1, 0.2]]), parts=np.array([1]), swset=np.array([11, 12])
        )
    ) == str(cards)
    assert (
        loose.read(ENERGY, energy=np.int64(6))
        .to_frame()
        .equals(d2.read(ENERGY, energy=6).to_frame())
    )
    assert loose.read(ENERGY, energy=np.array([6, 7])).to_frame().shape == (1501, 1)
    assert box.to_frame(parts=np.array([1, 2])).shape == (421, 2)


@pytest.mark.slow
def test_none_is_the_default_everywhere() -> None:
    run = d2.read(ENERGY)
    nothing: dict[str, Any] = dict.fromkeys(Choosing.__annotations__)
    assert loose.suggest(
        run,
        0.064,
        td_window=None,
        parts=None,
        flying=None,
        deck=None,
        weights=None,
        **nothing,
    ) == (d2.suggest(run, 0.064))
    verified = d2.verify(run, 0.0135867, 0.0687534, replay=False)
    assert (
        loose.verify(
            run, 0.0135867, 0.0687534, switched=None, min_mean_energy=None, replay=False
        )
        == verified
    )
    of_plan = dict.fromkeys(("min_rigid", "done", "before", "parts", "after"))
    planned = loose.plan(run, **of_plan, min_quality=None, replay=False)
    assert planned == d2.plan(run, replay=False)
    planned = loose.plan(run, **of_plan, min_quality="poor", replay=False)
    assert planned.windows
    assert planned == d2.plan(run, replay=False, min_quality="poor")
    explored = loose.explore(
        run, td=None, td_window=(0.069, 0.07), steps=None, replay=False
    )
    assert explored == d2.explore(run, td_window=(0.069, 0.07), replay=False)
    studied = loose.study(
        [ENERGY],
        0.064,
        jobs=None,
        input_format=None,
        energy=None,
        channels=None,
        replay=False,
    )
    assert studied == d2.study([ENERGY], 0.064, replay=False)
    assert (
        loose.read(ENERGY, time=None, energy=None, channels=None, input_format=None)
        == run
    )
    assert loose.check(DECK, history=None, select=None, ignore=None) == d2.check(DECK)
    assert str(
        loose.card([(0.1, 0.2)], parts=1, run=None, merge=None, tolerance=None)
    ) == str(d2.card([(0.1, 0.2)], parts=1))
    assert loose.from_frame(pd.read_csv(ENERGY), name=None).sources == ("frame",)


@pytest.mark.slow
def test_a_study_needs_no_td() -> None:
    study_answer = d2.study([ENERGY], replay=False)
    alone = d2.suggest(d2.read(ENERGY), replay=False)
    assert alone.recommended is not None
    assert (study_answer.td, study_answer.td_window) == (None, None)
    assert (study_answer.runs[0].tr, study_answer.runs[0].td) == (
        alone.recommended.tr,
        alone.recommended.td,
    )
    assert study_answer.command == ("study", "--no-verify", ENERGY)
    assert "longest flight" in repr(study_answer) + str(study_answer._repr_html_())
