"""One verdict on a pair, which is the same in every command and has a reason and a cure unless it is good."""

from html import unescape

import pytest

import d2rpick as d2
from d2rpick.choice.pair.aftermath import MeanEnergyBounds
from d2rpick.choice.pair.grades import DO_NOT_USE, GRADES, VERDICTS
from tests.command import (
    ENERGY,
    GLSTAT,
    MATSUM,
    ROOT,
    join_wrapped_lines,
    run,
    run_json,
)
from tests.energies import require

RUNS = [(ENERGY, ()), (GLSTAT, ()), (MATSUM, ("--part", "flying"))]


@pytest.mark.parametrize(("source", "arguments"), RUNS, ids=["csv", "glstat", "matsum"])
def test_all_commands_give_one_verdict_on_a_pair(
    source: str, arguments: tuple[str, ...]
) -> None:
    planned = run_json("plan", "--min-quality", "poor", *arguments, source)["windows"][
        0
    ]
    tr, td = repr(planned["tr"]), repr(planned["td"])
    chosen = run_json("suggest", "--td", td, *arguments, source)
    judged = run_json("verify", "--tr", tr, "--td", td, *arguments, source)
    (offer,) = (
        answer_row
        for answer_row in run_json(
            "explore", "--td", td, "--steps", "2", *arguments, source
        )["offers"]
        if answer_row["td"] == planned["td"]
    )
    row = next(
        answer_row for answer_row in chosen["candidates"] if answer_row["recommended"]
    )
    answers = [planned, chosen, judged, offer, row]
    assert {answer_row["verdict"] for answer_row in answers} == {planned["verdict"]}
    assert len({answer_row["verdict_reason"] for answer_row in answers}) == 1


@pytest.mark.parametrize(
    ("bounds", "says"),
    [
        (
            (0.33, 0.34),
            "it will reject the switched run; to accept it",
        ),
        ((1.4, 7.1), "it will reject the switched run)"),
        (
            (0.58, 7.1),
            "(d2rpick verify accepts only 70% to 130%, so it may reject the switched run)",
        ),
        ((0.8, 1.2), "mean energy after td 80% to 120% of the reference run"),
    ],
)
def test_a_pair_that_verify_will_refuse_by_its_mean_energy_says_so(
    bounds: tuple[float, float], says: str
) -> None:
    """Only the motion of such a pair is used, but a comparison with its switched run fails without another limit."""
    decision = require(d2.suggest(d2.read(ENERGY), 0.0687534).decision)
    expected = decision._replace(mean_energy_bounds=MeanEnergyBounds(*bounds)).expected
    assert says in expected
    assert ("reject" in expected) == ("reject" in says)
    assert ("`min_mean_energy` to 0.33" in expected) == (bounds == (0.33, 0.34))


def test_a_better_pair_without_a_residual_is_named_with_its_gain() -> None:
    decision = require(d2.suggest(d2.read(ENERGY), 0.064).decision)
    better = require(decision.better)._replace(residual=None)
    named = decision._replace(better=better, better_level=1.09)
    assert "the energy at td is 1.09 times as high" in named.cure
    assert "times as high" not in named._replace(better_level=None).cure


@pytest.mark.parametrize("td", [0.05, 0.06, 0.064, 0.0687534, 0.0698, 0.075])
def test_a_reason_and_a_cure_stand_with_every_grade(td: float) -> None:
    decision = require(d2.suggest(d2.read(ENERGY), td).decision)
    assert decision.verdict == VERDICTS[decision.grade]
    assert decision.reason
    assert decision.expected
    assert decision.worst_case
    assert bool(decision.cure) == (decision.grade != GRADES[-1])


def test_nothing_is_verified_or_acceptable_whose_error_exceeds_a_half() -> None:
    run = d2.read(ENERGY)
    for td in (0.055, 0.064, 0.0687534, 0.07):
        suggestion = d2.suggest(run, td)
        for candidate in suggestion.candidates:
            exceeds_half = candidate.residual is not None and candidate.residual > 0.5
            judged = d2.verify(run, tr=candidate.tr, td=td)
            assert not (exceeds_half and (candidate.acceptable or judged.verified))
            if exceeds_half:
                assert judged.decision.verdict == DO_NOT_USE


def test_a_cause_of_the_motion_is_not_excused_by_the_worth_of_the_vibration() -> None:
    """Unknown gravity makes the motion poor, independently of the energy of the vibration error."""
    table = d2.read(str(ROOT / "sample_data/rollover_box_excel.csv"))
    decision = require(d2.suggest(table).decision)
    quality = decision.quality
    assert quality.motion.grade == "poor"
    assert quality.alone.grade != quality.vibration.grade
    for reason in (decision.reason, decision.general_reason):
        assert "gravity" in reason
        assert "next contact" not in reason


@pytest.mark.parametrize("td", [0.064, 0.0698, 0.075])
def test_the_general_reason_holds_no_number_of_the_pair(td: float) -> None:
    decision = require(d2.suggest(d2.read(ENERGY), td).decision)
    assert f"{decision.residual:.0%}" in decision.reason
    assert f"{decision.residual:.0%}" not in decision.general_reason


def test_a_poor_pair_names_the_pair_to_use_instead() -> None:
    judged = d2.verify(d2.read(ENERGY), tr=0.0128853, td=0.064)
    assert require(judged.better).td == pytest.approx(0.0687534, abs=1e-6)
    assert "tr = 0.0135867, td = 0.0687534" in judged.decision.cure


def test_a_notebook_shows_reason_and_cure_with_every_verdict() -> None:
    run = d2.read(MATSUM)
    plan = d2.plan(run)
    study = d2.study([ENERGY], 0.064)
    suggestion = d2.suggest(d2.read(ENERGY), 0.064)
    planned = [require(row.decision) for row in plan.flights if row.window]
    decision = require(suggestion.decision)
    for answer, texts in (
        (plan, [text for judged in planned for text in (judged.reason, judged.cure)]),
        (suggestion, [decision.reason, decision.cure]),
        (study, [decision.reason, decision.cure]),
    ):
        shown = unescape(answer._repr_html_())
        assert all(text and text in shown for text in texts)


@pytest.mark.parametrize("td", [0.258462, 0.355385])
def test_the_next_contact_does_not_excuse_an_error_that_makes_a_pair_inadmissible(
    td: float,
) -> None:
    """The verdict on a pair, and the grade of its vibration, are one grade, and the reason is the one that decides."""
    answer = d2.suggest(d2.read(MATSUM), td, parts="1,2")
    refused = 0
    for candidate in answer.candidates:
        decision = answer.decision_on(candidate)
        quality = decision.quality
        if decision.objections:
            continue
        assert decision.grade == quality.grade
        is_small = quality.worth is not None and quality.worth.share <= 0.05
        if is_small and not candidate.admissible:
            refused += 1
            assert quality.vibration.grade == quality.alone.grade == "poor"
            decisive = "d2rpick accepts no such pair, even if the error hardly matters"
            assert decisive in decision.reason
            assert " more than 1" in decision.reason
    assert refused


def test_verify_gives_the_reason_that_decides_and_one_grade() -> None:
    times = ("--tr", "0.257499", "--td", "0.355385")
    judged = run_json("verify", "--part", "1,2", *times, MATSUM)
    text = join_wrapped_lines(run("verify", "--part", "1,2", *times, MATSUM).stdout)
    assert "vibration poor; the energy of its error is at most 4.48%" in text
    assert judged["vibration"] == judged["quality"] == "poor"
    assert judged["verdict_reason"].endswith(
        "residual 1.127, more than 1, the residual of a release without any vibration: d2rpick accepts no such pair, "
        "even if the error hardly matters in the next contact"
    )
