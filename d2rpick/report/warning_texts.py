"""Explain what each warning means for the result and what to do; ``d2rpick rule CODE`` prints the text.

The topics are the headings of docs/reference/warnings.md, which ``python -m tests.reference`` writes from these texts.
"""

from __future__ import annotations

from typing import Final, NamedTuple


class Explanation(NamedTuple):
    """The meaning of a warning for the result (``means``), and what to do (``fix``)."""

    means: str
    fix: str


EXPLANATIONS_BY_TOPIC: Final = {
    "The flight": {
        "at-rest": Explanation(
            "Nothing vibrates in the flight up to td, so every tr in the flight freezes the same deformation. d2rpick "
            "recommends the earliest tr, which gives the longest rigid time.",
            "Nothing to do.",
        ),
        "flight-from-energy": Explanation(
            "No force, momentum or energy balance shows the flight, so d2rpick inferred it from the internal energy. "
            "The end of the load may be wrong. If tr lies before the end of the load, the whole motion after tr is "
            "wrong.",
            "Give the end of the load with --after or write the part momenta in the next run.",
        ),
        "flight-sources-disagree": Explanation(
            "Two kinds of evidence give different flights. d2rpick uses the later start and the earlier end, or the "
            'times that you gave with --after and --landing. The verdict is at best "use with care".',
            "Compare both flights with the animation of the run, then give --after and --landing.",
        ),
        "flight-uncertain": Explanation(
            'The evidence for the flight does not exclude a contact or another load. The verdict is at best "use with '
            'care".',
            "Write the part momenta in the next run: matsum for LS-DYNA, /TH/PART for Radioss.",
        ),
        "gravity-assumed": Explanation(
            "A constant force acts in the flight, and neither masses nor energies show whether it is gravity. d2rpick "
            "assumes that it is. If it is another load, the parts do not fly freely.",
            "Give the deck with --deck, or write the mass, or the kinetic and internal energy.",
        ),
        "landing-not-shown": Explanation(
            "The record shows that the parts fly on after the landing that you gave. The event at this time, such as "
            "an airbag that fires or a contact of another variant, is not in the record. The energy of this event is "
            "unknown, so d2rpick grades the vibration after td by the vibration error alone, as with "
            "--keep-vibration.",
            "Nothing to do for such an event. For a contact of this run, give the time at which the force begins, or "
            "omit --landing.",
        ),
        "grazing-contact": Explanation(
            "The body only grazes another surface at the end of the flight. If the body is slightly out of place, "
            "this contact may come much earlier.",
            "Keep td before the time that the warning gives.",
        ),
        "margin-kept": Explanation(
            "td could be later, but d2rpick keeps a margin before the next contact, because switching may make "
            "this contact earlier.",
            "Nothing to do. To change the margin, use --margin.",
        ),
        "no-flight": Explanation(
            "Nothing in the record shows when the load ends, so d2rpick cannot recommend a tr.",
            "If the parts never fly, do not switch them. If they fly, give the end of the load with --after or write "
            "the part momenta in the next run. Flights shorter than 5 % of the record are ignored.",
        ),
        "no-free-flight": Explanation(
            "The parts do not fly at this td: a force, a support or a prescribed motion acts on them. The warning "
            "names the nearest flight.",
            "Choose a td in a flight. If the evidence is wrong, give --after and --landing.",
        ),
        "rotation-unknown": Explanation(
            "Neither the parts nor the motion of nodes shows how the body rotates in the flight. If you give the "
            "deck, d2rpick assumes the worst rotation that the kinetic energy allows, so the margin before the next "
            "contact may be large. Without the deck, the margin may be too short.",
            "Give the deck with --deck and write the motion of at least three nodes of the body that do not lie on "
            "a line. In Radioss use /TH/NODE, in LS-DYNA use *DATABASE_HISTORY_NODE with the binout or nodout. "
            "Otherwise set the margin with --margin.",
        ),
        "td-after-contact": Explanation(
            "The next contact begins before td, or td lies within the margin before it. The parts may hit something "
            "while they are rigid.",
            "Choose an earlier td.",
        ),
        "td-in-load": Explanation(
            "td lies before the end of the load, so there is no flight before td.",
            "Choose a later td.",
        ),
    },
    "The pair": {
        "kinetic-share-estimated": Explanation(
            "The kinetic fraction at td comes from an envelope of the energy, not from a vibration model. The kinetic "
            "fraction and the residual are rough values.",
            "Nothing to do if the verdict is clear. Otherwise choose a td near a peak of the internal energy.",
        ),
        "no-better-td": Explanation(
            "No peak of the energy in this flight has an admissible tr. A tr is admissible if it lies in the flight, "
            "the deformation has the same direction as at td, and the error is small enough. So d2rpick offers no "
            "other td.",
            "Compare other values of td with d2rpick explore or choose other parts.",
        ),
        "no-candidate": Explanation(
            "No tr is admissible for this td: each candidate lies outside the flight, has a deformation of opposite "
            "direction, or has too large an error. The warning gives the reason for the best candidate.",
            "Omit --td, compare other values of td with d2rpick explore, or choose other parts.",
        ),
        "flight-outside-record": Explanation(
            "The momenta show a flight that continues after the end of the energy record. The files may belong to "
            "different runs, or one of them was truncated.",
            "Give the files of one run only or copy the shorter file again.",
        ),
        "no-energy": Explanation(
            "The internal energy at td is zero or negative, so there is no level to match.",
            "Check the energy that d2rpick reads (d2rpick info). Choose another td, or select the energy with "
            "--energy or --part.",
        ),
        "out-of-place": Explanation(
            "A part that moves inside the body is frozen in the position that it has at tr. At td the body is "
            "displaced by the stated distance, which is more than 1 % of its path. The next contact may come earlier "
            "or later.",
            "Leave the moving part deformable or choose another tr. You may accept the displacement if no result "
            "depends on the exact time and place of the next contact.",
        ),
        "partly-rigid": Explanation(
            "In the stated interval, some of the chosen parts were rigid and others were deformable. d2rpick does not "
            "use this interval as a rigid window.",
            "Use --part to name the parts that were switched together.",
        ),
        "plastic-or-preload": Explanation(
            "Plastic work and a preload explain the static energy of this record equally well. The recommended pair "
            "is the same in both cases, but the direction of the deformation may differ.",
            "Nothing to do unless the parts are preloaded. In that case compare with a finished switched run (verify "
            "--switched).",
        ),
        "poor-td": Explanation(
            "More than half of the vibration energy is kinetic at td. A rigid body cannot keep this energy, whatever "
            "tr is.",
            "Choose a td near a peak of the internal energy. The answer names one.",
        ),
    },
    "The record": {
        "coarse-record": Explanation(
            "The fastest spectral line of the energy, even a weak one, has fewer than 4 states per period. The verdict "
            "is based on the strong lines. The record may hide a faster vibration, and the error after td may then be "
            "larger than stated.",
            "Write the energies more often: at least ten states per period of the fastest line of the energy. This "
            "period is half a period of the vibration.",
        ),
        "engine-wrong-energy": Explanation(
            "The listing shows a version of OpenRadioss from before January 2026. Such versions write wrong internal "
            "energies after a switch in a restart.",
            "Do not use the energies of this run. Run the model again with a newer version.",
        ),
        "few-states": Explanation(
            "The file has too few states to show how the energy oscillates, so the level at td is uncertain.",
            "Use a file with more states, such as glstat, matsum or binout.",
        ),
        "no-part-history": Explanation(
            "The files contain no energies or momenta of parts, so most verdicts on parts are unknown.",
            "Write matsum (LS-DYNA) or /TH/PART (Radioss) in the next run.",
        ),
        "rigid-legs": Explanation(
            "The record that d2rpick info examines contains an interval in which parts were rigid. Their energies have "
            "no meaning in this interval, and d2rpick does not use them.",
            "Use a reference run, in which no part is switched. For a switched run, use d2rpick plan --done.",
        ),
        "switched-run-ended": Explanation(
            "The switched run ended before the next contact, or its listing reports an error. The runs agree as far as "
            "they were compared, but the comparison does not pass, because the rest of the switched run is missing.",
            "Find the cause in the listing (messag and d3hsp of LS-DYNA, NAME_0001.out of Radioss), let the run "
            "continue, and compare again. If files of later restart segments exist, name them too.",
        ),
        "truncated-input": Explanation(
            "The file ends within a state, for example because the run was killed or is still running. d2rpick uses "
            "only the complete states.",
            "Nothing to do if td lies well before the end. Otherwise wait for the run.",
        ),
    },
    "Health of the run": {
        "begins-late": Explanation(
            "The record begins after the start of the run, and earlier restart segments lie in the same folder. The "
            "earlier segments show whether the run was switched, and when the load ended. d2rpick does not use the "
            "later segments alone.",
            "Name the earlier restart segments too.",
        ),
        "blew-up": Explanation(
            "The energies of the run grow without limit, so the run is unstable. d2rpick does not use the run.",
            "Repair the model and run it again.",
        ),
        "contact-in-window": Explanation(
            "The contact energy changes inside the rigid window, so something is in contact. If the chosen parts are "
            "in contact, they do not fly freely.",
            "Check which contact acts. Part momenta show whether it acts on the chosen parts.",
        ),
        "energy-ratio": Explanation(
            "The total energy differs by more than 10 % from the sum of initial energy and external work. If the "
            "energies do not balance, the recommended tr may be wrong.",
            "Find the cause in the reference run, such as mass scaling, contacts or hourglassing, and run it again.",
        ),
        "energy-too-large": Explanation(
            "The energies are far larger than physically possible, so d2rpick does not use the run.",
            "Check the units, and check whether the run is stable.",
        ),
        "eroded-energy": Explanation(
            "Eroded elements contain a significant part of the internal energy. This energy is not released at td.",
            "Name individual parts with --part or use a history without the eroded energy.",
        ),
        "erosion": Explanation(
            "Elements erode inside the rigid window. If their parts are rigid, these elements do not erode.",
            "Choose a window without erosion, or leave the parts with eroded elements deformable.",
        ),
        "hourglass": Explanation(
            "The hourglass energy of the model is more than 10 % of the internal energy, so the internal energy is "
            "unreliable.",
            "Use another hourglass control or element formulation and run the model again.",
        ),
        "negative-sliding": Explanation(
            "The contact energy is strongly negative. This has no physical cause, so the energy balance is wrong by "
            "this amount.",
            "Check the reference run for initial penetrations and run it again.",
        ),
        "nothing-to-judge": Explanation(
            "The internal energy is zero in all states, so there is nothing to judge.",
            "Check which parts and which energy d2rpick reads (d2rpick info).",
        ),
        "part-hourglass": Explanation(
            "The hourglass energy of a chosen part is more than 10 % of the internal energy of the part, so this "
            "internal energy is unreliable.",
            "Use another hourglass control or element formulation for this part and run the model again.",
        ),
        "sliding": Explanation(
            "The contact energy is more than 10 % of the internal energy. Only friction can explain so large a contact "
            "energy.",
            "Check the contacts of the reference run for penetrations.",
        ),
        "window-not-judged": Explanation(
            "The rigid window has too few states to check for contacts and loads inside it.",
            "Write the global energies more often, or check the window in the animation.",
        ),
        "work-in-window": Explanation(
            "More external work is done inside the rigid window than gravity and damping explain. If the load acts on "
            "the chosen parts, they do not fly freely.",
            "Check which load acts. Part momenta show whether it acts on the chosen parts.",
        ),
    },
    "Deck, parts and cards": {
        "body-left-rigid": Explanation(
            "Some parts that deform in the history stay rigid in the deck. The deck does not belong to the history, or "
            "an engine file is missing.",
            "Deactivate these rigid bodies in the first engine file, as rule D2R409 explains.",
        ),
        "body-through-wall": Explanation(
            "The Radioss starter removes nodes of a rigid body from a rigid wall, so the body can pass through the "
            "wall.",
            "Correct the deck as rule D2R406 explains and run it again.",
        ),
        "body-without-velocity": Explanation(
            "An initial velocity does not include the main node of a rigid body, so the body starts at rest.",
            "Correct the initial velocity as rule D2R407 explains.",
        ),
        "card-error": Explanation(
            "A check of the deck together with this card finds an error. The solver may stop, or switch the wrong "
            "parts. The exit code is 1.",
            "Read the rule that the warning names (d2rpick rule ID), correct the options of the card or the deck, and "
            "print the card again.",
        ),
        "card-objection": Explanation(
            "A check of the deck together with this card finds a problem that is less severe than an error.",
            "Read the rule that the warning names (d2rpick rule ID), and correct the card or the deck.",
        ),
        "cost-unknown": Explanation(
            "d2rpick cannot estimate the CPU time; the warning gives the reason. The verdict on the pair does not "
            "depend on it.",
            "Name the parts with --part and the deck with --deck or give --cost-share.",
        ),
        "deck-in-folder": Explanation(
            "The run folder contains one main deck, and d2rpick uses it: its gravity, loads, supports and parts.",
            "Nothing to do if it is the deck of this run. Otherwise give another deck with --deck or use --no-deck.",
        ),
        "deck-not-followed": Explanation(
            "d2rpick cannot evaluate an item of the deck, such as a curve or a sensor, and uses the history instead. "
            "The warning is also issued if the deck already contains switching cards, which the answer does not "
            "consider. The warning names the line.",
            "Check the named line. If it is a load, give its end with --after.",
        ),
        "deck-of-another-model": Explanation(
            "Most parts of the deck have titles that differ from the titles in the history, or the deck lacks parts of "
            "the history. So d2rpick does not use the deck. The exit code is 1 if you gave the deck with --deck.",
            "Give the deck of this run, or leave out --deck.",
        ),
        "judged-by-whole": Explanation(
            "The history does not contain these parts, or the members of a part set or rigid body are unknown. "
            "d2rpick judges the window by the energy of the whole model.",
            "Write part energies, and define the set in a file that the deck includes.",
        ),
        "loose-pieces": Explanation(
            "A part consists of pieces that nothing connects, for example four wheels. LS-DYNA makes one rigid body "
            "of them, so they move together.",
            "Leave the part out or give each piece its own part.",
        ),
        "merged-apart": Explanation(
            "--merge joins parts that nothing connects in the deck, so they move as one rigid body.",
            "Omit --merge to keep them separate.",
        ),
        "moves-apart": Explanation(
            "A part flies away from the other parts, so nothing holds it. If the parts became one rigid body, the "
            "motion of this part would be wrong.",
            "Leave the part out of --part, or switch it as a separate body.",
        ),
        "no-angle": Explanation(
            "The part momenta do not show the rotation of these parts, so the rotation error at td is unknown.",
            "Give the deck with --deck, or compare with a switched run (d2rpick verify --switched).",
        ),
        "no-deck": Explanation(
            "Without a deck, the costs and connections of the parts are unknown.",
            "Give the main deck with --deck.",
        ),
        "no-set": Explanation(
            "d2rpick cannot recommend a set of parts. The table gives the reasons.",
            "Read the reasons next to the sets.",
        ),
        "not-verified": Explanation(
            'The verdict on the times as printed on the card is "do not use", or worse than --min-quality allows. The '
            "warning gives the reason.",
            "Do not use this card. Use the pair that the warning names, or follow its advice.",
        ),
        "nothing-to-switch": Explanation(
            "No part of the model may be made rigid. The table gives the reasons.",
            "Read the reasons next to the parts.",
        ),
        "parts-not-in-deck": Explanation(
            "Parts of the history are missing from the deck, so their costs and connections are unknown.",
            "Give the deck of this run, with all its include files.",
        ),
        "lead-part-unknown": Explanation(
            "The card merges the parts into a lead part that the history does not contain. LS-DYNA stops with an error "
            "if the model has no such part.",
            "Give the deck with --deck, so that d2rpick checks the card, or give a part of the model with --merge.",
        ),
        "parts-not-joined": Explanation(
            "The card makes several parts rigid, each as a separate rigid body. If they share nodes, they must form "
            "one rigid body. Without a deck, or if elements of the deck are encrypted or missing, it is unknown "
            "whether they share nodes.",
            "Give the deck with all its includes (--deck), or merge the parts with --merge.",
        ),
        "same-leg-twice": Explanation(
            "d2rpick calibrate found the same restart segment or engine run twice and counts it only once.",
            "Nothing to do.",
        ),
        "several-bodies": Explanation(
            "The parts become several rigid bodies, and the position error of at least one of them is unknown.",
            "Compare with a switched run (d2rpick verify --switched).",
        ),
        "stresses-unturned": Explanation(
            "Solid elements without a co-rotational stress update do not rotate their stresses while the body is "
            "rigid. After a large rotation the stresses are wrong (D2R116).",
            "Use another element formulation for these parts, or leave them deformable if the body rotates by a large "
            "angle.",
        ),
        "ties-not-followed": Explanation(
            "The deck contains ties that d2rpick does not evaluate. Parts that they join must become one rigid body.",
            "Check the named tie, and merge the parts that it joins with --merge.",
        ),
        "unknown-rule": Explanation(
            "A setting (select, ignore) or a comment in the deck names a rule that does not exist, so it has no "
            "effect.",
            "Correct the id. d2rpick rule lists all rules.",
        ),
        "unreadable-deck": Explanation(
            "d2rpick cannot read the deck, so it checks nothing in it.",
            "Correct the error that the message names.",
        ),
        "unswitchable-part": Explanation(
            "The solver cannot make this part rigid, or its results would be wrong. The warning gives the reason.",
            "Leave the part out of --part.",
        ),
        "weights-by-analogy": Explanation(
            "The cost of some element formulations was not measured. d2rpick uses the cost of a similar "
            "formulation, measured with OpenRadioss, so the saving is a rough estimate.",
            "Calibrate with runs of your own solver (d2rpick calibrate).",
        ),
        "deck-of-another-solver": Explanation(
            "One solver wrote the history, and the deck is for the other solver. d2rpick uses the loads, connections "
            "and costs of the deck. These data are valid only if history and deck describe the same model.",
            "Give the deck of the run, or check that both models are the same.",
        ),
        "built-in-weights": Explanation(
            "Your weights lack some element formulations of the deck. For these, d2rpick uses the built-in weights, "
            "multiplied by the median ratio of your weights to the built-in weights.",
            "Also calibrate with runs that contain these formulations (d2rpick calibrate) or add their weights under "
            "[per_element].",
        ),
    },
    "Plans": {
        "done-without-flight": Explanation(
            "A window of --done does not lie in any flight of this run, so the landing after it is unknown.",
            "Check that the file of --done and the history belong to the same switched run.",
        ),
        "landed-rigid": Explanation(
            "In the switched run, a contact began or ended while the parts were rigid. The motion after this contact "
            "is wrong, and d2rpick plans nothing after it.",
            "Choose an earlier td for this window and run the model again.",
        ),
        "longer-window-later": Explanation(
            "A later flight allows a longer window than the window that is planned now. The later window needs a new "
            "run first.",
            "To plan the longer window first, set --min-rigid to a value between the two lengths.",
        ),
        "rigid-times": Explanation(
            "The record from which d2rpick is to choose times is the record of a switched run. d2rpick does not use "
            "the interval in which parts were rigid as a flight. The deformation that was frozen in this interval also "
            "changes the vibration after it.",
            "Choose times from the reference run. To plan the later windows of the switched run, use d2rpick plan "
            "--done.",
        ),
    },
    "Many runs": {
        "cut-runs": Explanation(
            "Some runs end within a state, or earlier than the other runs. Their tr is based on less data.",
            "Check whether these runs failed. Let them finish, or leave them out.",
        ),
        "repeated-runs": Explanation(
            "Several runs of the study have the same content, so they necessarily agree. The common tr is based "
            "on fewer runs than the table has rows.",
            "Give each run once. Check whether a file was copied to the wrong folder.",
        ),
        "internal-error": Explanation(
            "An internal error of d2rpick prevented a verdict on this input. d2rpick judged the other inputs.",
            "Please report the error with the output of --debug.",
        ),
        "mixed-bases": Explanation(
            "The basis is not the same in all runs, so the errors of the runs are not directly comparable.",
            "Compare the verdicts or write the same output in all runs.",
        ),
        "mixed-models": Explanation(
            "The files of the runs contain different parts, or other titles of the same parts. A tr of one model means "
            "nothing for another model.",
            "Study the runs of each model separately. If only the output of the runs differs, or a variant has another "
            "part, check that all runs switch the same parts.",
        ),
        "mixed-parts": Explanation(
            "The runs were judged by the energies of different parts. The common tr then applies to different sets of "
            "parts in different runs.",
            "Name the same parts for all runs by their numbers with --part.",
        ),
        "mixed-units": Explanation(
            "The runs have different time units: their files name different units, or the times of some runs are 1000 "
            "times the times of other runs. A study has one unit for td and tr.",
            "Convert the runs to one unit, or study the runs of each unit separately.",
        ),
        "runs-left-out": Explanation(
            "d2rpick could not judge some runs, so the summary does not include them. Their rows give the reasons.",
            "Read the reasons, and correct the inputs.",
        ),
        "timing-tolerance": Explanation(
            "No tr lies within the timing tolerance of every run. At the common tr, the error of some runs is more "
            "than 0.05 larger than at their own tr.",
            "Use a separate tr for each run, or leave out the runs that differ most.",
        ),
    },
    "Computed models": {
        "energy-balance": Explanation(
            "The computed sample run does not conserve energy well enough with these parameters.",
            "Do not use this run. Choose parameters closer to the defaults.",
        ),
    },
}  # fmt: skip
EXPLANATIONS: Final = {
    code: explanation
    for explanations in EXPLANATIONS_BY_TOPIC.values()
    for code, explanation in explanations.items()
}


def explain_warning(code: str) -> str:
    """Return the explanation of the warning with the given code, which is a key of `EXPLANATIONS`."""
    means, fix = EXPLANATIONS[code]
    return f"{code} (warning): {means}\n\nFix: {fix}"
