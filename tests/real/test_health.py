"""Health of runs from other people: the names used by each solver are found."""

from __future__ import annotations

import numpy as np
import pytest

from d2rpick.choice.health import assess_health, warn_about_health
from d2rpick.histories.balance import read_balance
from d2rpick.histories.history import Balance
from d2rpick.histories.opening import open_run
from tests.real.files import real

TIME = np.linspace(0.0, 1.0, 201)


@pytest.mark.parametrize(
    ("name", "known", "expected"),
    [
        (
            "PILLARS-LSDyna__Bolt_B_Explicit-glstat",
            {"hourglass_share": 0.0},
            {"energy-ratio", "sliding"},
        ),
        (
            "Crimping__results-glstat.head16000",
            {"hourglass_share": 0.0082211},
            {"sliding"},
        ),
        (
            "Masters-Project__Steel_Explicit-glstat.head16000",
            {"hourglass_share": None, "sliding_share": 0.0},
            set(),
        ),
        (
            "lasso-python__sph_models-R12_2_1-binout",
            {"energy_ratio_min": 0.950303},
            set(),
        ),
        (
            "OpenRadioss__miniqa-AMS-boxbeam-reference-BOXBEAMT01",
            {"part_hourglass_share": 0.0574625},
            set(),
        ),
        (
            "OpenRadioss__miniqa-AMS-boxbeam-reference-BOXBEAMT01.csv",
            {"hourglass_share": 0.0574625},
            set(),
        ),
        (
            "OpenRadioss__miniqa-onefile_rad-reference-CRA2AV4T01",
            {},
            {"hourglass", "part-hourglass"},
        ),
    ],
)
def test_each_solver_s_names_are_found(
    name: str, known: dict[str, float | None], expected: set[str]
) -> None:
    run_of = open_run([real(f"histories/{name}")])
    health = assess_health(
        read_balance(run_of.databases, run_of.parts) or Balance(TIME)
    )
    for key, value in known.items():
        assert getattr(health, key) == (value and pytest.approx(value, rel=1e-4))
    assert {caution.code for caution in warn_about_health(health)} == expected
