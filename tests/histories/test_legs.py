"""Later legs beside the files of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from d2rpick.histories.source import later_legs
from tests.command import run
from tests.computed import stored

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.parametrize(
    ("named", "beside", "later"),
    [
        (["runT01"], ["runT02.gz", "runT03", "otherT02"], ["runT02.gz", "runT03"]),
        (["binout0000"], ["binout0001", "binoutx"], ["binout0001"]),
        (["glstat"], ["glstat01", "glstat.csv"], ["glstat01"]),
        (["runT02", "runT03"], ["runT01"], []),
        (["missing/runT01"], [], []),
    ],
)
def test_legs_are_files_of_the_same_name_with_a_higher_number(
    named: list[str], beside: list[str], later: list[str], tmp_path: Path
) -> None:
    for name in (*(n for n in named if "/" not in n), *beside):
        (tmp_path / name).touch()
    assert later_legs([str(tmp_path / name) for name in named]) == [str(tmp_path / name) for name in later]


def test_a_td_that_only_a_later_leg_reaches_names_it() -> None:
    first = stored("rollover_r100_T01.gz")
    result = run("suggest", "--td", "0.4", "--part", "box", first)
    assert result.exit_code == 2
    assert first.replace("T01", "T02") in result.stderr
