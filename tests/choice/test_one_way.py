"""The one way from files to an answer: every user of it gets the same, and a record is examined once per question."""

from functools import partial

from d2rpick.choice.answers import suggest_of, verify_of
from d2rpick.choice.judged_card import CardRequest, judged_card
from d2rpick.choice.question import Reference, Settings, read
from d2rpick.histories.names import Selection
from d2rpick.histories.opening import open_run
from d2rpick.rules.judgement import faults_of
from tests.command import BOX as T01, ENERGY, GLSTAT
from tests.counted_fits import CountedFits
from tests.energies import sure

BOX = Selection(parts=("box",))
PLAIN = Settings()


def test_the_health_of_the_run_comes_with_every_answer() -> None:
    whole = read([T01], BOX)
    answer, in_window = suggest_of(whole, 0.37, PLAIN), suggest_of(whole, (0.3, 0.38), PLAIN)
    verdict = verify_of(whole, sure(answer.recommended).tr, 0.37, PLAIN)
    assert sure(answer.health) == verdict.health
    assert sure(answer.health).window == (sure(answer.recommended).tr, 0.37)
    assert in_window.health is not None
    assert suggest_of(read([ENERGY]), 0.064, PLAIN).health is None  # a table of two columns tells nothing of it


def test_the_momenta_come_with_every_history_and_know_the_chosen_part() -> None:
    opened = open_run([T01])
    whole, box = (Reference.of(opened, selection).history for selection in (Selection(), BOX))
    (of_whole, *_), (of_box, *_) = whole.momenta, box.momenta
    assert of_whole.parts == of_box.parts
    assert of_whole.chosen == tuple(range(len(sure(of_whole.parts))))
    assert [sure(of_whole.parts)[i].title for i in of_box.chosen] == ["box"]
    assert of_whole.values is of_box.values  # read once


def test_a_tr_that_suits_is_the_way_out_of_one_that_does_not() -> None:
    verdict = verify_of(read([GLSTAT]), 0.02, 0.0687, PLAIN)
    assert any("suits this td" in fault.message for fault in faults_of(verdict))


def test_a_card_is_judged_by_what_the_choice_found_in_the_record() -> None:
    reference, fits = read([T01], BOX), CountedFits()
    box = suggest_of(reference, 0.37, PLAIN, fits=fits)
    before = fits.made
    assert before > 0
    judge = partial(verify_of, reference, settings=PLAIN, known=box.situation)
    assert judged_card([sure(box.recommended)[:2]], box.situation.history, judge, CardRequest("ls-dyna"))
    assert fits.made == before
