"""Real histories over a grid of td: no traceback, no library warning, and no contradiction of health and flight."""

from __future__ import annotations

import numpy as np
import pytest

from d2rpick.base.errors import D2RPickError
from d2rpick.choice.answers import suggest_in_history, suggest_in_run, verify_in_history
from d2rpick.choice.question import Reference, Settings
from d2rpick.choice.td.flights import find_flights
from d2rpick.histories.opening import Selection, open_run
from tests.real.files import real
from tests.real.test_files import MORE, PAIRS, READABLE, REFUSED

QA = "more-histories/OpenRadioss__miniqa-"
DRIVEN = (
    f"{QA}INTERF-INT_2-pl_dam_ilev-reference-PLREG41BT01",
    f"{QA}LOIS-LOI38-DMAFNLIN-input_44-isolid_1-reference-DMAFNLINT01",
    f"{QA}RESSORT-kjoint2-reference-JOINTT01",
)
FILES = [
    *(f"histories/{name}" for name in (*READABLE, *REFUSED)),
    *(f"more-histories/{name}" for name in (*MORE, *PAIRS)),
    f"{QA}IMPOSED-IMPDISP_FGEO-reference-mapSimpleT01",
    f"{QA}OPTIONS-damp-new_test_v11-reference-FFO25SCBT01",
    f"{QA}RESSORT-couple-reference-TYPE8MT01",  # driven until 0.41, then free
    f"{QA}SUBMODEL-TRANSF-reference-BOULE1V5T01",
    *DRIVEN,
]
PLAIN = Settings(replay=False)
_TIMES = 7


@pytest.mark.parametrize("name", FILES)
def test_nothing_fails_at_any_td_and_no_flight_contradicts_the_health(
    name: str,
) -> None:
    try:
        reference = Reference.of(open_run([real(name)]))
    except D2RPickError:
        return  # refused; the tests of the readers cover the message
    for td in np.linspace(
        reference.history.time[0], reference.history.time[-1], _TIMES
    ).tolist():
        try:
            answer = suggest_in_run(reference, td, PLAIN)
        except D2RPickError:
            history = reference.history
            assert (
                history.time.size < 3
                or not history.energy.any()
                or history.missing_legs
            )
            continue
        if answer.situation.in_flight:
            assert not {"work-in-window", "contact-in-window"} & {
                caution.code for caution in answer.cautions
            }


@pytest.mark.parametrize("name", DRIVEN)
def test_a_driven_model_does_not_fly(name: str) -> None:
    history = open_run([real(name)]).history(Selection())
    assert find_flights(history, Settings(replay=False)) == ()
    for share in (0.25, 0.5, 0.75):
        td = float(history.time[0] + share * np.ptp(history.time))
        suggestion = suggest_in_history(history, td, Settings(replay=False))
        assert suggestion.recommended is None
        assert not verify_in_history(
            history, td / 2, td, Settings(replay=False)
        ).verified
