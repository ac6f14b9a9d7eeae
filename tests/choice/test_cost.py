"""Cost model: shares of a time step, and the warnings if they are unknown."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

from d2rpick.base.errors import ConfigurationError
from d2rpick.choice.parts.cost import (
    MEASURED,
    CostModel,
    Weights,
    compute_saved_share,
    format_weights_as_toml,
    read_weights,
)
from d2rpick.deck.formulations import find_ls_dyna_formulation, find_radioss_formulation
from d2rpick.deck.mesh import Elements
from d2rpick.deck.model import Formulation, Inventory, Material, PartData, Section
from tests.energies import require

QBAT, UNKNOWN = (
    Formulation("QBAT", "QBAT"),
    Formulation("strange", None, measured=False),
)


def make_inventory(
    counts: Mapping[int, int],
    *,
    solver: str = "ls-dyna",
    formulations: Mapping[int, Formulation] | None = None,
    rigid: int | None = None,
    notes: tuple[str, ...] = (),
) -> Inventory:
    """Return parts that are rows of shells, each with its own nodes."""
    part = np.repeat(list(counts), list(counts.values()))
    nodes = np.arange(4 * part.size).reshape(-1, 4)
    formulation_by_part = formulations or {}
    parts = {
        count: PartData(
            count,
            f"part {count}",
            Material("MAT", "rigid" if count == rigid else "deformable"),
            Section({"shell": formulation_by_part.get(count, QBAT)}),
        )
        for count in counts
    }
    elements = (Elements("shell", part, nodes),)
    return Inventory(
        solver, parts, elements, np.zeros((4 * part.size, 3)), notes, complete=not notes
    )


def test_shares_of_parts_of_one_formulation_are_those_of_their_elements() -> None:
    model = CostModel(make_inventory({1: 30, 2: 70}), Weights(rigid_node=0.0))
    assert [model.share_of(part).value for part in (1, 2)] == pytest.approx([0.3, 0.7])
    assert model.saved([2]).value == pytest.approx(0.7 * 0.91)
    assert model.saved([1, 2]).value == pytest.approx(0.91)


@pytest.mark.parametrize(("layers", "extra"), [(1, 0), (3, 8), (5, 16), (None, 8)])
def test_shells_cost_more_with_more_integration_points(
    layers: int | None, extra: int
) -> None:
    """Four points per layer, 3 of which are assumed; without a weight for points, they cost nothing."""
    of_deck = require(find_radioss_formulation("shell", 12, 0, 0))
    mesh = make_inventory({1: 30, 2: 70}, formulations={2: UNKNOWN})
    parts = {
        1: mesh.parts[1]._replace(section=Section({"shell": of_deck}, layers=layers)),
        2: mesh.parts[2],
    }
    mesh = replace(mesh, parts=parts)
    assert mesh.further_points(1, "shell") == extra
    model = CostModel(mesh, Weights({"QBAT": 1.0, "strange": 1.0, "point": 0.5}))
    assert model.of_part(1).cost == 30 * (1 + 0.5 * extra)
    assert CostModel(mesh, Weights({"QBAT": 1.0, "strange": 1.0})).of_part(1).cost == 30


def test_elements_that_are_rigid_from_the_start_cost_nothing() -> None:
    model = CostModel(make_inventory({1: 30, 2: 70}, rigid=2))
    assert model.share_of(1).value == 1.0
    assert model.saved([2]).value == 0.0


def test_a_formulation_without_a_weight_leaves_every_share_open_but_with_one_of_its_own_it_is_known() -> (
    None
):
    mesh = make_inventory({1: 30, 2: 70}, formulations={2: UNKNOWN})
    share = CostModel(mesh).saved([1])
    assert share.value is None
    assert "strange" in str(share.reason)
    assert CostModel(mesh, Weights({"QBAT": 1.0, "strange": 3.0})).share_of(
        1
    ).value == pytest.approx(30 / 240)


def test_what_the_deck_does_not_have_leaves_the_cost_open() -> None:
    share = CostModel(make_inventory({1: 30}, notes=("mesh.k was not read",))).saved(
        [1]
    )
    assert share.value is None
    assert "mesh.k was not read" in str(share.reason)
    absent = CostModel(make_inventory({1: 30, 2: 70})).saved([2, 3, 4])
    assert absent == (None, "parts 3, 4 are not in the deck")


def test_formulations_that_were_not_measured_are_named() -> None:
    formulations = {
        1: QBAT,
        2: Formulation("fully integrated (ELFORM 16)", "QBAT", measured=False),
    }
    mesh = make_inventory({1: 1, 2: 1}, formulations=formulations)
    assert CostModel(mesh).assumed == ("fully integrated (ELFORM 16)",)
    assert (
        CostModel(mesh, Weights({"QBAT": 1.0, formulations[2].name: 1.0})).assumed == ()
    )


@given(
    total=st.floats(1.0, 1e9),
    part=st.floats(0.0, 1.0),
    share=st.floats(0.01, 1.0),
    nodes=st.integers(0, 10**6),
    scale=st.floats(1e-3, 1e3),
)
def test_the_saved_share_lies_between_0_and_that_of_the_elements_and_has_no_unit(
    total: float, part: float, share: float, nodes: int, scale: float
) -> None:
    weights = Weights({"BT": 1.0}, share, 0.05)
    scaled = Weights({"BT": scale}, share, 0.05 * scale)
    share_saved = compute_saved_share(weights, total, part * total, nodes)
    assert 0.0 <= share_saved <= share * (1 + 1e-12)
    assert compute_saved_share(
        scaled, scale * total, scale * part * total, nodes
    ) == pytest.approx(share_saved, abs=1e-9)
    assert compute_saved_share(weights, total, total, 0) == pytest.approx(share)


@pytest.mark.parametrize(
    ("formulation_class", "cost"),
    [
        (find_radioss_formulation("shell", 12, 0, 0), "QBAT"),
        (find_radioss_formulation("shell", 24, 0, 0), "QEPH"),
        (find_radioss_formulation("shell", 3, 0, 0), "BT"),
        (find_radioss_formulation("shell", 99, 0, 0), None),
        (find_radioss_formulation("solid", 0, 0, 24), "solid"),
        (find_ls_dyna_formulation("shell", 2), "BT"),
        (find_ls_dyna_formulation("shell", 16), "QBAT"),
        (find_ls_dyna_formulation("shell", 99), None),
        (find_ls_dyna_formulation("spring", 0), "spring"),
    ],
)
def test_classes_of_formulations(
    formulation_class: Formulation, cost: str | None
) -> None:
    assert formulation_class.cost == cost
    assert not (formulation_class.measured and "ELFORM" in formulation_class.name)


def test_weights_read_back_as_they_were_written(tmp_path: Path) -> None:
    weights = Weights(
        {"BT": 0.3, 'a "strange" one': 2.5, "träge \U0001f422": 1.0}, 0.9, 0.01, "site"
    )
    (tmp_path / "site.toml").write_text(format_weights_as_toml(weights), "utf-8")
    assert read_weights(str(tmp_path / "site.toml")) == weights


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no table"),
        ("[per_element]\nBT = 'much'", "BT is 'much'"),
        ("[per_element]\nBT = -1", "at least 0"),
        ("[per_element]\nBT = 1e308", "at most 1e+100"),
        (f"[per_element]\nBT = {'9' * 400}", "is inf"),
        ("rigid_node = nan\n[per_element]\nBT = 1", "rigid_node is nan"),
        ("[per_element]\nBT = 0", "no weight is above 0"),
        ("element_share = 2\n[per_element]\nBT = 1", "up to 1"),
        ("elementshare = 1\n[per_element]\nBT = 1", "not a key"),
        ("= 1", "cannot be read"),
        ("[per_element]\nBT = nan", "at least 0"),
        ("[per_element]\nBT = true", "BT is True"),
        ("a = " + "[" * 100_000, "cannot be read"),
    ],
)
def test_weights_that_make_no_sense_are_refused_with_the_file(
    tmp_path: Path, text: str, message: str
) -> None:
    (tmp_path / "site.toml").write_text(text, "utf-8")
    with pytest.raises(ConfigurationError, match="site") as error:
        read_weights(str(tmp_path / "site.toml"))
    assert message in str(error.value)


def test_counts_by_part_are_counters() -> None:
    assert make_inventory({1: 3}).counts == {1: Counter(shell=3)}


def test_weights_that_lack_a_formulation_keep_the_ratios_of_the_built_in_ones() -> None:
    """Only ratios matter, so that all weights times a factor give the same share, with or without some of them."""
    qeph = require(find_radioss_formulation("shell", 24, 0, 0))
    mesh = make_inventory({1: 30, 2: 70}, formulations={2: qeph})
    built_in = CostModel(mesh)
    some = CostModel(
        mesh, Weights({"QBAT": 5 * MEASURED["QBAT"], "point": 5 * MEASURED["point"]})
    )
    assert some.share_of(1).value == pytest.approx(require(built_in.share_of(1).value))
    assert some.built_in == (qeph.name,)
    assert built_in.built_in == ()
    foreign = CostModel(mesh, Weights({"strange": 1.0}))
    assert foreign.share_of(1).value is None
