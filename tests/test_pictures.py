"""The pictures of the documentation are drawn from the repository's own runs, and each is shown."""

import re

import numpy as np
import pytest

from tests.examples import PAGES, read_page
from tests.pictures import screenshots
from tests.pictures.__main__ import PICTURES
from tests.pictures.drawing import PLACE, POINTS, draw_curve, drawn, make_figure

ALL = "\n".join(read_page(page) for page in PAGES)
LARGEST = 60_000  # [bytes] of a drawing
LARGEST_SCREENSHOT = 250_000  # [bytes]


def test_every_picture_is_there_and_small() -> None:
    sizes = {path.name: path.stat().st_size for path in PLACE.iterdir()}
    drawings = {f"{name}.svg" for name in PICTURES}
    assert {*sizes} == drawings | {f"{name}.png" for name in screenshots.NAMES}
    assert max(sizes[name] for name in drawings) < LARGEST
    assert max(sizes.values()) < LARGEST_SCREENSHOT


def test_every_picture_is_shown_with_a_text_for_those_who_do_not_see_it() -> None:
    shown = {
        name: text
        for text, name in re.findall(r"!\[([^\]]*)\]\([^)]*pictures/([^)]+)\)", ALL)
    }
    assert {*shown} == {path.name for path in PLACE.iterdir()}
    assert min(map(len, shown.values())) > 20


def test_a_picture_names_no_place_of_this_machine() -> None:
    for path in PLACE.glob("*.svg"):
        assert not re.search(r"/(?:home|root|tmp|work)/", path.read_text("utf-8"))


def test_a_curve_has_few_points() -> None:
    _, (axes,) = make_figure(2.0)
    draw_curve(axes, range(10_000), range(10_000), "black")
    (line,) = axes.lines
    points = np.asarray(line.get_xdata())
    assert len(points) == POINTS
    assert (points[0], points[-1]) == (0, 9_999)


@pytest.mark.slow
@pytest.mark.parametrize("name", PICTURES)
def test_a_picture_is_drawn_the_same_twice(name: str) -> None:
    figure = PICTURES[name]()
    assert all(axes.lines or axes.patches for axes in figure.axes)
    assert drawn(figure, name) == drawn(PICTURES[name](), name)
