"""Which runs of a study stand out, and how they are told apart."""

from __future__ import annotations

from d2rpick.choice.study_rows import NONE, OK, UNREADABLE, StudyRow, outliers, short_names


def row(name: str, tr: float | None = None, status: str = OK) -> StudyRow:
    return StudyRow(name, status, tr=tr)


def test_runs_without_a_tr_and_far_ones_stand_out_the_farthest_first() -> None:
    near = [row(f"run{i}", 1.0 + i / 1000) for i in range(20)]
    far, farther, none, lost = row("far", 1.1), row("farther", 0.5), row("none", None, NONE), row("x", None, UNREADABLE)
    assert outliers([far, *near, lost, none, farther]) == (none, farther, far)
    assert outliers(near) == ()
    assert outliers([none]) == (none,)
    assert outliers([]) == ()


def test_equal_times_let_any_other_stand_out() -> None:
    assert [one.source for one in outliers([*(row("same", 2.0) for _ in range(9)), row("other", 2.1)])] == ["other"]


def test_short_names_tell_runs_apart() -> None:
    assert short_names(["a/b/soft/box/glstat", "a/b/hard/box/glstat"]) == ("soft", "hard")
    assert short_names(["one.csv"]) == ("one.csv",)
    assert short_names(["x/one.csv", "x/one.csv"]) == ("one.csv", "one.csv")
    assert short_names(["one.csv", "deep/er/one.csv"]) == ("one.csv", "deep/er/one.csv")
    assert short_names([]) == ()
