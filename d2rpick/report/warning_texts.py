"""Explain what each warning means for the decision, and what to do about it; ``d2rpick rule CODE`` prints the text."""

from __future__ import annotations

from typing import Final, NamedTuple


class Explanation(NamedTuple):
    """What a warning ``means`` for the choice of switch times, and its ``fix``."""

    means: str
    fix: str


EXPLANATIONS: Final = {
    "at-rest": Explanation(
        "Nothing vibrates in the flight up to td, so every tr in it freezes the same deformation. The "
        "pair is as good "
        "as the flight is certain.",
        "Nothing. Use the earliest tr, which keeps the parts rigid for longest.",
    ),
    "blew-up": Explanation(
        "The energies of the run grow without bound, so the run is unstable and its energies mean nothing "
        "from then on.",
        "Repair the model and run it again. Until then choose times only before the energies grow.",
    ),
    "body-left-rigid": Explanation(
        "The deck keeps parts rigid that deform in the reference run. A run of this deck moves differently.",
        "Deactivate these rigid bodies in the first engine file, as rule D2R409 explains.",
    ),
    "body-through-wall": Explanation(
        "While the parts are rigid, their nodes do not see a wall of the deck, so the body falls through it.",
        "Correct the wall as rule D2R406 explains, and run the deck again.",
    ),
    "body-without-velocity": Explanation(
        "The deck lets rigid bodies begin at rest although their parts move, so the motion after tr is wrong.",
        "Correct the initial velocity as rule D2R407 explains.",
    ),
    "card-objection": Explanation(
        "The check of the deck with this card in it finds a problem. The solver may stop or switch other parts.",
        "Read the rule that the warning names (d2rpick rule ID), and change the options of the card.",
    ),
    "coarse-record": Explanation(
        "The fastest strong vibration has few output states per period. A still faster one would not be seen, so the "
        "error after td may be larger than stated.",
        "Write the energies more often: at least ten states per period of the fastest vibration.",
    ),
    "contact-in-window": Explanation(
        "The contact energy of the model changes while the parts would be rigid. If it is their contact, they do not "
        "fly freely and must stay deformable.",
        "Check which contact acts. Write the momenta of the parts, which show whether it acts on them.",
    ),
    "cost-unknown": Explanation(
        "The CPU time that is saved cannot be estimated. The verdict on the pair does not depend on it.",
        "Name the parts to be switched with --part, and the deck of the run with --deck.",
    ),
    "cut-runs": Explanation(
        "These runs end earlier than the others, or within a state. Their tr is chosen from less of the flight.",
        "Let the runs finish, or leave them out of the study.",
    ),
    "deck-in-folder": Explanation(
        "A main deck lies in the folder of the run and is used: its gravity, loads, supports and parts count.",
        "Nothing if it is the deck of this run. Otherwise name another one with --deck, or use --no-deck.",
    ),
    "deck-not-followed": Explanation(
        "Part of the deck cannot be evaluated, such as a curve or a sensor. What it does to the parts is unknown.",
        "Check the line that is named yourself, and give the end of the load with --after if it acts until then.",
    ),
    "deck-of-another-model": Explanation(
        "The parts of the deck are not those of the run, so nothing is taken from this deck.",
        "Name the deck that the run was started from.",
    ),
    "done-without-flight": Explanation(
        "A window in which the run was switched lies in no flight that this run shows, so its landing is unknown.",
        "Check the times in the file of --done, and that the history is that of the switched run.",
    ),
    "energy-balance": Explanation(
        "The computed sample run does not conserve energy well enough with these parameters.",
        "Choose parameters closer to the defaults; do not use this run.",
    ),
    "energy-ratio": Explanation(
        "The total energy differs from the initial energy and the external work by more than practice "
        "allows. Energies "
        "that are not balanced can mislead the choice of tr.",
        "Find the cause in the reference run, such as mass scaling, contacts or hourglassing, and run it again.",
    ),
    "energy-too-large": Explanation(
        "The energies are too large to be computed with, so the run is not judged.",
        "Write the history in larger units of energy.",
    ),
    "engine-wrong-energy": Explanation(
        "This version of OpenRadioss reports wrong internal energies after a rigid body is switched in a restart.",
        "Run the reference again with a version of January 2026 or later, and choose the times by that run.",
    ),
    "eroded-energy": Explanation(
        "Deleted elements hold a notable part of the internal energy. It is part of the internal energy of "
        "the model, but does "
        "not spring back after td.",
        "Choose by the energies of the parts (--part), or by a history without eroded energy.",
    ),
    "erosion": Explanation(
        "Elements are deleted while the parts would be rigid, which free flight does not do. A rigid part "
        "loses none.",
        "Choose a window in which nothing is deleted, or leave the parts that lose elements deformable.",
    ),
    "few-states": Explanation(
        "The file has too few states to show how the energy oscillates, so its level at td is unsure.",
        "Name a file that was written more often, such as glstat, matsum or binout.",
    ),
    "flight-from-energy": Explanation(
        "Only the internal energy shows when the load ends, which is a guess. A tr before the end of "
        "the load changes the "
        "whole motion after it.",
        "Give the end of the load with --after, or write the momenta of the parts.",
    ),
    "flight-sources-disagree": Explanation(
        "Two kinds of evidence show different flights. The better one is used, and it may be the wrong one.",
        "Compare the times with an animation of the run, and give --after and --landing.",
    ),
    "flight-uncertain": Explanation(
        "The flight is found without the momenta of the parts, so a contact or load that these files do "
        "not show may act "
        "in it. The pair is fair at best.",
        "Write the momenta of the parts: matsum for LS-DYNA, /TH/PART for Radioss.",
    ),
    "gravity-assumed": Explanation(
        "A constant force acts in the flight and is treated as gravity. If it is another load, the parts do "
        "not fly freely.",
        "Give the deck with --deck, or write the mass, or kinetic and internal energy.",
    ),
    "grazing-contact": Explanation(
        "The next contact begins so gently that a body that is slightly out of place touches much earlier.",
        "Keep td before the time that the warning gives.",
    ),
    "hourglass": Explanation(
        "The hourglass energy of the model is above what practice allows, so its internal energies are unreliable.",
        "Repair the model with another hourglass control or element formulation, and run it again.",
    ),
    "internal-error": Explanation(
        "The program failed on this input. Nothing is known about it.",
        "Report the error with the input; the other inputs are not affected.",
    ),
    "judged-by-whole": Explanation(
        "The members of a set or body are unknown, so its window is judged by the energy of the whole model.",
        "Define the set in a file that the deck includes, or name the energy with --energy.",
    ),
    "kinetic-share-estimated": Explanation(
        "The kinetic fraction at td is an estimate, so the expected error after td is one too.",
        "Nothing, if the verdict leaves room. Otherwise choose a td near a maximum of the internal energy.",
    ),
    "landed-rigid": Explanation(
        "The run was rigid while a contact acted, so everything after it is wrong and nothing is planned from it.",
        "Run again with an earlier td for this window.",
    ),
    "longer-window-later": Explanation(
        "A short window comes first, and a longer one has to wait for another run because of it.",
        "Give --min-rigid between the two lengths, if you want the longer window in the next run.",
    ),
    "loose-pieces": Explanation(
        "The parts of one rigid body consist of pieces that nothing connects. As one body they would move together.",
        "Switch the pieces as bodies of their own, or leave the loose ones out.",
    ),
    "margin-kept": Explanation(
        "The last part of the window is not used: td keeps a margin before the next contact, which a switch "
        "may advance.",
        "Nothing. Give --margin to keep another one.",
    ),
    "merged-apart": Explanation(
        "Parts that do not touch are merged into one rigid body, and then move as one.",
        "Leave --merge out to keep them apart.",
    ),
    "mixed-bases": Explanation(
        "The runs of the study are judged on different grounds, so their errors are not comparable.",
        "Compare the verdicts, or write the same output in all runs.",
    ),
    "mixed-units": Explanation(
        "The runs of the study have times in different units, but td has only one.",
        "Study runs of each unit by themselves.",
    ),
    "moves-apart": Explanation(
        "A part flies away from the others, so that one rigid body of all would move as none of them does.",
        "Leave the part out of --part, or switch it as a body of its own.",
    ),
    "negative-sliding": Explanation(
        "The contact energy is negative, which has no physical cause, so the energy balance is wrong by as much.",
        "Look for initial penetrations in the reference run, and run it again.",
    ),
    "no-angle": Explanation(
        "The rotation error at td is unknown, since the momenta of these parts do not give the rotation.",
        "Give the deck with --deck, or compare a switched run with verify --switched.",
    ),
    "no-better-td": Explanation(
        "No maximum of the energy in the flight has an admissible tr, so no other td is offered.",
        "Look at all td with d2rpick explore, or name other parts.",
    ),
    "no-candidate": Explanation(
        "No tr is admissible, so there is no pair. The message gives what speaks against the nearest one.",
        "Choose another td, other parts or a larger --tolerance.",
    ),
    "no-deck": Explanation(
        "Without the deck neither cost nor connections of the parts are known.",
        "Name the main deck with --deck.",
    ),
    "no-energy": Explanation(
        "There is no positive internal energy at td, so there is no deformation to freeze.",
        "Choose another td, or name the internal energy with --energy or --part.",
    ),
    "no-flight": Explanation(
        "Nothing in the files shows when the load ends, so no tr can be admissible.",
        "Give the end of the load with --after, or write the momenta of the parts.",
    ),
    "no-free-flight": Explanation(
        "At td the parts do not fly: something pushes or holds them, and they must stay deformable.",
        "Choose td in the flight that the warning names.",
    ),
    "no-part-history": Explanation(
        "The files have no energies or momenta of single parts, so most verdicts on parts stay open.",
        "Write matsum (LS-DYNA) or /TH/PART (Radioss), and run again.",
    ),
    "no-set": Explanation(
        "No set of parts can be recommended.",
        "Read the reasons that are listed with the sets.",
    ),
    "not-verified": Explanation(
        "The times as the card prints them are not to be used, or are worse than --min-quality asks for.",
        "Use the pair that the warning names, or do what it says would improve the pair.",
    ),
    "nothing-to-judge": Explanation(
        "The run holds no energy that could be judged, so its times are not judged either.",
        "Name the file with the energies of the run.",
    ),
    "nothing-to-switch": Explanation(
        "No part of the run may be made rigid.",
        "Read the reasons that are listed with the parts.",
    ),
    "out-of-place": Explanation(
        "A part that moves against the others is frozen, so the body is displaced at td by more than 1 "
        "% of its path, and "
        "the next contact moves.",
        "Leave that part out of --part, choose a shorter window, or accept the displacement that is given.",
    ),
    "part-hourglass": Explanation(
        "The hourglass energy of a part to be switched is above what practice allows, so its internal energy "
        "is unreliable.",
        "Repair this part with another hourglass control or element formulation, and run again.",
    ),
    "part-without-sign": Explanation(
        "The direction of a part's deformation is unknown, so the part is left out of the error. Its "
        "vibration may be wrong.",
        "Nothing, if the part is light. Otherwise write its energy more often.",
    ),
    "partly-rigid": Explanation(
        "Some of the parts were rigid in the run and others deformed, so this time is not used as a window.",
        "Name the parts that were switched together with --part.",
    ),
    "parts-not-in-deck": Explanation(
        "Parts of the history are not in the deck, so neither their cost nor their connections are known.",
        "Name the deck of this run, with all its includes.",
    ),
    "parts-not-joined": Explanation(
        "Without a deck it is unknown whether the parts touch. As separate rigid bodies they come apart if they do.",
        "Name the main deck with --deck, or merge the parts with --merge.",
    ),
    "plastic-or-preload": Explanation(
        "The record fits a vibration about plastic work or about a preload. The energy alone cannot "
        "separate them, which "
        "matters for the direction of the deformation.",
        "Compare with a finished switched run (verify --switched).",
    ),
    "poor-td": Explanation(
        "More than half of the vibration energy is kinetic at td. A rigid body has none of it, so no tr can keep it.",
        "Choose the td that is named as better, near a maximum of the internal energy.",
    ),
    "rigid-legs": Explanation(
        "Parts were already rigid for some time in this run, so it is no reference there.",
        "Use a run without switching, or name these windows with plan --done.",
    ),
    "rigid-times": Explanation(
        "The parts were rigid in this run for some time. That time is no flight of the reference.",
        "Use a run without switching, or name these windows with --done.",
    ),
    "runs-left-out": Explanation(
        "Some runs could not be judged, so the common tr does not hold for them.",
        "Read the reasons in their rows.",
    ),
    "same-leg-twice": Explanation(
        "The same run was given twice; it counts once.",
        "Nothing.",
    ),
    "several-bodies": Explanation(
        "The deck makes several rigid bodies, and the displacement of some at td is unknown.",
        "Compare a switched run with verify --switched.",
    ),
    "sliding": Explanation(
        "The contact energy is above what practice allows. Only friction can explain so much.",
        "Check the contacts of the reference run for penetrations.",
    ),
    "stresses-unturned": Explanation(
        "Some elements keep their stresses unrotated while the body is rigid, so they are wrong after a "
        "large rotation.",
        "Use another element formulation for these parts, or leave them deformable if the body rotates much.",
    ),
    "td-after-contact": Explanation(
        "The next contact begins before td. A rigid part would be hit, and the loads would be wrong.",
        "Choose an earlier td.",
    ),
    "td-in-load": Explanation(
        "td lies before the end of the load, so there is no flight to be rigid in.",
        "Choose a later td.",
    ),
    "ties-not-followed": Explanation(
        "The deck ties parts in a way that is not evaluated. Tied parts belong in one rigid body.",
        "Check the ties, and merge tied parts with --merge.",
    ),
    "timing-tolerance": Explanation(
        "No tr is within the timing tolerance of every run, so the common one makes the error of a run "
        "grow by more than "
        "0.05.",
        "Use the tr of each run, or look at the error at the common tr.",
    ),
    "truncated-input": Explanation(
        "The file ends within a state, as that of a run that was stopped or is still running. Only complete "
        "states count.",
        "Nothing, if td lies well before the end. Otherwise wait for the run.",
    ),
    "unknown-rule": Explanation(
        "A comment in the deck ignores a rule that does not exist, so it ignores nothing.",
        "Correct the id; d2rpick rule lists all.",
    ),
    "unreadable-deck": Explanation(
        "The deck could not be read, so nothing in it was checked.",
        "Correct what the message names.",
    ),
    "unswitchable-part": Explanation(
        "The solver cannot make this part rigid, or its result would be wrong.",
        "Leave the part out of --part.",
    ),
    "weights-by-analogy": Explanation(
        "The cost of some element formulations was not measured, so the saved CPU time is a rough "
        "estimate. The "
        "verdict on the pair does not depend on it.",
        "Calibrate with runs of your solver: d2rpick calibrate.",
    ),
    "window-not-judged": Explanation(
        "Whether contacts or loads work in the window is not judged, since it has too few states.",
        "Write the global energies more often.",
    ),
    "work-in-window": Explanation(
        "External work beyond gravity and damping is done while the parts would be rigid. If it acts on "
        "them, they do not "
        "fly freely.",
        "Check which load acts; write the momenta of the parts, which show whether it acts on them.",
    ),
}  # fmt: skip


def explain_warning(code: str) -> str:
    """Return the explanation of a warning by its code, one of `EXPLANATIONS`."""
    means, fix = EXPLANATIONS[code]
    return f"{code} (warning): {means}\n\nFix: {fix}"
