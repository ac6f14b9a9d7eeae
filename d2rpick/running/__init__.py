"""Follow runs while they are being computed: find what their states show so far, and decide what to do next.

`follow` and `drive` find the same flights, because both use the same sequence of steps:

1. `looks` reads the states that were written since the last read. `record` appends them to the earlier states.
2. `evidence` keeps a `witness` for each set of parts that may fly together, which finds since when no force has acted.
   `inner_motion` finds the waiting time, i.e. how long this force-free time must be in a flight. Both depend only on
   the states up to a time, so the flights do not depend on when the files were read.
3. For `follow`, `events` lists the events that concern the user: start of a flight, advice to switch, contact. `watch`
   reads the files repeatedly and returns the new events, and `report.follow` describes them.
4. For `drive`, the flights known at the end of an engine run are its findings. `sequence` chooses the next engine run
   from the findings of all previous engine runs, and `engine` starts it.

`swing` warns of parts that oscillate too strongly to become rigid. `checks` refuses unsuitable decks before anything is
computed. `first` needs no states: it chooses the parts and the waiting time for a deck in which the solver itself
detects flights from contact forces (`deck.first_run_cards`).
"""
