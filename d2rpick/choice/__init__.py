"""Choose tr and td: turn a history into a recommendation, a verdict, a plan, or one answer for many runs.

A question (`question`) consists of a reference run, the energy selected from it, and the settings.  It is answered
in these steps:

1. `situation` finds the flight around a td, the vibration in this flight, and the energy at td.
2. `candidates` finds the times at which the deformation may equal that at td, and computes the measures of each time as
   tr. It judges them by the objections of `warnings`: outside of the flight, opposite sign, error above the tolerance,
   too much energy.
3. `quality` ranks the candidates, recommends the first acceptable one, and grades the motion and the vibration of the
   pair; `aftermath` predicts the energy after td. `decision` combines these to one verdict: use, use with care, do not
   use.
4. `answers` are the results of ``suggest`` and ``verify``; `windows` adds the ranges of acceptable tr.

If td is not given, `flights` finds the flights of the record and `suggest_td` the best td in one of them; `trade_off`
compares the td of a window, and `plan` chooses windows for all flights of a run.

`deck_of_run`, `switchable_parts`, `cost`, `calibration` and `sets_of_parts` decide which parts to make rigid, and
estimate what this saves. `switched_run` and `comparison` compare a finished switched run with its reference run.
`study` answers one question for many runs, `overview` and `health` describe the files of a run, and `judged_card`
prints the card.
"""
