"""One verdict for a pair: the same in every command, with a reason and a cure wherever it is not good."""

import pytest

import d2rpick as d2
from d2rpick.choice.grades import DO_NOT_USE, GRADES, VERDICTS
from tests.command import ENERGY, GLSTAT, MATSUM, answer
from tests.energies import sure

RUNS = [(ENERGY, ()), (GLSTAT, ()), (MATSUM, ("--part", "flying"))]


@pytest.mark.parametrize(("source", "asked"), RUNS, ids=["csv", "glstat", "matsum"])
def test_all_commands_give_one_verdict_on_a_pair(
    source: str, asked: tuple[str, ...]
) -> None:
    planned = answer("plan", "--min-quality", "poor", *asked, source)["windows"][0]
    tr, td = repr(planned["tr"]), repr(planned["td"])
    chosen = answer("suggest", "--td", td, *asked, source)
    judged = answer("verify", "--tr", tr, "--td", td, *asked, source)
    (offer,) = (
        one
        for one in answer("explore", "--td", td, "--steps", "2", *asked, source)[
            "offers"
        ]
        if one["td"] == planned["td"]
    )
    row = next(one for one in chosen["candidates"] if one["recommended"])
    found = [planned, chosen, judged, offer, row]
    assert {one["verdict"] for one in found} == {planned["verdict"]}
    assert len({one["verdict_reason"] for one in found}) == 1


@pytest.mark.parametrize("td", [0.05, 0.06, 0.064, 0.0687534, 0.0698, 0.075])
def test_a_reason_and_a_cure_stand_with_every_grade(td: float) -> None:
    decision = sure(d2.suggest(d2.read(ENERGY), td).decision)
    assert decision.verdict == VERDICTS[decision.grade]
    assert decision.reason
    assert decision.expected
    assert decision.worst_case
    assert bool(decision.cure) == (decision.grade != GRADES[-1])


def test_nothing_is_verified_or_acceptable_whose_error_exceeds_a_half() -> None:
    run = d2.read(ENERGY)
    for td in (0.055, 0.064, 0.0687534, 0.07):
        found = d2.suggest(run, td)
        for candidate in found.candidates:
            wrong = candidate.residual is not None and candidate.residual > 0.5
            judged = d2.verify(run, tr=candidate.tr, td=td)
            assert not (wrong and (candidate.acceptable or judged.verified))
            if wrong:
                assert judged.decision.verdict == DO_NOT_USE


def test_a_poor_pair_names_the_pair_to_use_instead() -> None:
    judged = d2.verify(d2.read(ENERGY), tr=0.0128853, td=0.064)
    assert sure(judged.better).td == pytest.approx(0.0687534, abs=1e-6)
    assert "tr = 0.0135867, td = 0.0687534" in judged.decision.cure
