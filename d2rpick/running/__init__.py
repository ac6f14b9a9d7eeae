"""Follow runs while they are being computed: find what their states show so far, and decide what to do next.

`follow` and `drive` find the same flights, because the data go one way:

1. `looks` reads what was written since the last read.  `record` appends the new states to those before.
2. `evidence` keeps, for each set of parts that may fly together, a `witness`: since when has no force acted?
   `inner_motion` finds the wait, i.e. how long this time must be in a flight.  Both depend only on the states up to a
   time, so that a flight does not depend on when the files were read.
3. For `follow`, `events` lists what the flights mean to the user: begin, advice to switch, contact.  `watch` reads the
   files again and again, and returns what is new.  `report.follow` describes it.
4. For `drive`, the flights at the end of an engine run are its findings.  `sequence` chooses the next engine run from
   the findings of all engine runs before, and `engine` starts it.

`swing` warns of parts that oscillate too strongly to become rigid.  `checks` refuses decks before anything is computed.
`first` needs no states: it chooses the parts and the wait of a deck in which the solver itself detects flights by
contact forces (`deck.first_run_cards`).
"""
