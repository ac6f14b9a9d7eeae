"""What may be asked for."""

from __future__ import annotations

from typing import Any

import pytest

from d2rpick.choice.settings import Settings


@pytest.mark.parametrize(
    ("asked", "name"),
    [({"tolerance": 20}, "tolerance"), ({"margin": -1}, "margin"), ({"cost_share": 1.5}, "cost_share")],
)
def test_settings_out_of_their_range_are_refused_by_name(asked: dict[str, Any], name: str) -> None:
    with pytest.raises(ValueError, match=name):
        Settings(**asked)
