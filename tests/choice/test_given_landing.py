"""A landing that the user gives: it is a contact of the record, or an event that the record does not contain."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from d2rpick.choice.answers import suggest_in_run, verify_run
from d2rpick.choice.pair.decision import Decision
from d2rpick.choice.question import Reference, Settings, read_reference
from d2rpick.choice.td.plan import plan_run
from d2rpick.choice.td.trade_off import explore_run
from d2rpick.histories.names import Selection
from tests.command import MATSUM, run

FLYING = Selection(parts=("flying",))
CONTACT = 0.379  # Time at which the record shows that the flight ends.
EVENT = 0.3  # Time in the middle of this flight.
DECISIONS = ("grade", "reason", "cure")


@pytest.fixture(scope="module")
def box() -> Reference:
    return read_reference([MATSUM], FLYING)


def suggest(
    box: Reference, landing: float | None, *, keep_vibration: bool = False
) -> Decision:
    """Return the decision on the pair that is suggested before a landing."""
    answer = suggest_in_run(
        box, None, Settings(landing=landing, keep_vibration=keep_vibration)
    )
    assert answer.decision is not None
    return answer.decision


def list_codes(cautions: Sequence[tuple[str, str]]) -> list[str]:
    return [code for code, _ in cautions]


def test_an_event_that_the_record_lacks_excuses_no_vibration_error(
    box: Reference,
) -> None:
    """The energy of the contact at the end of the flight is not that of an airbag that fires before it."""
    assert suggest(box, None).quality.worth is not None
    decision = suggest(box, EVENT)
    kept = suggest(box, EVENT, keep_vibration=True)
    assert decision.quality.worth is None
    assert [getattr(decision, name) for name in DECISIONS] == [
        getattr(kept, name) for name in DECISIONS
    ]


@pytest.mark.parametrize("landing", [CONTACT, CONTACT - 0.002, 0.385])
def test_a_landing_at_the_contact_of_the_record_is_this_contact(
    box: Reference, landing: float
) -> None:
    """0.385 lies in the contact: the flight is over then, so the record shows the contact."""
    answer = suggest_in_run(box, None, Settings(landing=landing))
    assert answer.situation.flight.shows_contact
    assert answer.decision is not None
    assert answer.decision.quality.worth is not None
    assert "landing-not-shown" not in list_codes(answer.cautions)


def test_no_grazing_contact_is_reported_where_there_is_no_contact(
    box: Reference,
) -> None:
    settings = Settings(landing=EVENT)
    answer = suggest_in_run(box, None, settings)
    codes = list_codes(answer.cautions)
    assert "landing-not-shown" in codes
    assert not {"grazing-contact", "rotation-unknown"} & {*codes}
    assert answer.situation.expected_margin.source != "grazing"


@pytest.mark.parametrize("landing", [EVENT, CONTACT])
def test_all_answers_treat_a_given_landing_in_the_same_way(
    box: Reference, landing: float
) -> None:
    settings = Settings(landing=landing)
    answer = suggest_in_run(box, None, settings)
    pair, decision = answer.recommended, answer.decision
    assert pair is not None
    assert decision is not None
    verdict = verify_run(box, pair.tr, pair.td, settings)
    plan = plan_run(box, replace(settings, min_quality="poor"))
    (planned,) = [row for row in plan.flights if row.answer]
    explored = explore_run(box, settings, None).suggestion
    assert planned.decision is not None
    assert explored.decision is not None
    told = {"landing-not-shown"} if landing == EVENT else set()
    for of_answer, cautions in (
        (decision, answer.cautions),
        (verdict.decision, verdict.cautions),
        (planned.decision, plan.cautions),
        (explored.decision, explored.cautions),
    ):
        assert of_answer.grade == decision.grade
        assert {"landing-not-shown"} & {*list_codes(cautions)} == told


def test_a_plan_without_a_window_warns_about_the_landing_too(box: Reference) -> None:
    plan = plan_run(box, Settings(landing=EVENT))
    assert not plan.windows
    assert "landing-not-shown" in list_codes(plan.cautions)


def test_check_judges_a_card_before_an_event_as_verify_does(tmp_path: Path) -> None:
    card = tmp_path / "card.k"
    times = ("--tr", "0.0927479", "--td", "0.29")
    history = ("--history", MATSUM)
    event = ("--landing", str(EVENT))
    run("card", *times, "--part", "1,2", "--merge", "1", *history, "-o", str(card))
    assert run("check", str(card), *history).exit_code == 0
    found = run("check", str(card), *history, *event)
    verified = run("verify", *times, "--part", "1,2", *event, MATSUM)
    assert (found.exit_code, verified.exit_code) == (1, 1)
    assert "do not use" in found.stdout
    assert "next contact" not in found.stdout


def test_a_record_that_ends_in_flight_shows_no_contact(tmp_path: Path) -> None:
    table, cut = tmp_path / "box.csv", tmp_path / "cut.csv"
    run("extract", "--part", "flying", MATSUM, "-o", str(table))
    head, *rows = table.read_text().splitlines()
    kept = [row for row in rows if float(row.split(",")[0]) < EVENT]
    cut.write_text("\n".join([head, *kept]))
    settings = Settings(landing=EVENT - 0.01)
    flight = suggest_in_run(read_reference([str(cut)]), None, settings).situation.flight
    assert flight.end == settings.landing
    assert not flight.shows_contact
