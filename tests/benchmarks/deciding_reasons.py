"""Reasons to keep the constants that change no answer in the trials of `deciding_numbers`."""

from __future__ import annotations

from typing import Final

_ROUNDING: Final = "keeps rounding, round-off or overflow from deciding"
_EFFORT: Final = "limits time or memory, or the accuracy of a numerical method beyond what answers show"
_WORDING: Final = "decides a warning, a remark, or what is displayed"
_INPUT: Final = (
    "guards against damaged, short or unusual input, which the questions do not contain"
)
_LOAD: Final = (
    "refuses a load that resembles a flight; the questions contain few such loads"
)
_PARTS: Final = (
    "concerns parts, nodes or contacts in a form that the questions do not contain"
)
_SWITCHED: Final = "concerns finished switched runs, of which the questions contain few"
_DOUBT: Final = "refuses a fit or a pair that may be wrong; the fits in the questions are far from this limit"
_FACT: Final = "is a fact, a unit or a published limit"

_NAMES: Final = {
    _ROUNDING: """
        choice.health._FLOOR choice.health._NOTHING choice.pair.quality.ROUNDING choice.pair.quality._DECIMALS
        choice.pair.situation._SOLVER_ERROR choice.pair.situation._FAINT choice.pair.situation._QUANTA
        choice.pair.warnings._LARGEST_EXPONENT choice.pair.windows._BELOW choice.parts.cost._LARGEST
        choice.switched.comparison._AT_REST choice.switched.comparison._STILL
        choice.switched.comparison._STILL_OF_VIBRATION flight.free_fall._REACH_OF_DIGITS
        flight.free_fall._REACH_OF_NOISE flight.free_fall._UNSEEN flight.internal_energy._HARDLY
        flight.margin._ROUNDING flight.momentum._ROUNDED flight.rotation._VANISHING flight.window.ROUND_OFF
        flight.window.LAST_DIGIT flight.window.VISIBLE flight.work._OF_DIGITS flight.work._OWN_ERROR
        vibration.fitting._NO_EFFECT vibration.hidden_energy.RESOLVED
        vibration.modal._TINY vibration.modes._EPS vibration.modes.SOLVER_FLOOR vibration.modes._ZERO
        vibration.moments._ZERO vibration.moments._ROUNDING_DEVIATIONS vibration.oscillator._SMALLEST
        vibration.oscillator._LARGEST
        vibration.least_squares._MOST_CONDITION vibration.lines._TINY
        """,
    _EFFORT: """
        choice.answers._MOST_REFUSED choice.pair.candidates._MOST choice.pair.candidates._MORE
        choice.pair.windows._EXACT choice.runs.study._STRETCHES choice.switched.switch_times._BETWEEN
        choice.td.suggest_td._FEWEST_TD choice.td.suggest_td._MOST_TD choice.td.trade_off._STEPS_OF_PAGE
        choice.td.trade_off._FEWEST_STEPS flight.body_frame._MOST_NODES flight.momentum._LOOK_BACK
        flight.momentum._LOOK_STATES flight.rotation._MOST_STEPS flight.rotation._SMALL
        flight.rotation._LEAST_GAIN flight.rotation._PERIODS flight.rotation._TRIED flight.turning._STATES
        flight.turning._LAST flight.window._FAR flight.window._MOST_SHRINKS flight.window._TIGHTER
        vibration.doubts._CHECKED vibration.fitting._ORDERS vibration.fitting._LAGS vibration.fitting._MIN_CELLS
        vibration.fitting._MAX_CELLS vibration.fitting._CELLS_PER_PERIOD vibration.fitting.COARSE
        vibration.fitting._MEDIUM vibration.fitting._NEAR vibration.fitting.STARTS vibration.fitting.CERTAIN
        vibration.fitting._MAX_STEPS vibration.identify.HOPELESS vibration.lines._MOST_LAGS
        vibration.lines._MOST_STATES vibration.locked_lines._STRONGEST vibration.locked_lines._HARMONICS
        vibration.modal._SOME_TIMES vibration.modal_span._PARTS vibration.modes.BLOCK vibration.modes._STEPS
        vibration.span._ENDS vibration.span._EARLIER_ENDS
        vibration.span.MOST_REFITS
        vibration.span._MOST_LINES vibration.span._CELLS_PER_PERIOD
        vibration.close_modes._MOST_STEPS vibration.close_modes._CONVERGED vibration.close_modes._DAMPING
        vibration.close_modes._LEAST_DAMPING vibration.close_modes._MOST_DAMPING vibration.lines.PERFECT
        vibration.refined_lines._MOST_PARAMETERS vibration.refined_lines._MOST_OF_REST
        vibration.oscillator_band._TOGETHER
        """,
    _WORDING: """
        choice.pair.decision._ALIKE choice.pair.quality._NAMED choice.pair.warnings._FEW_STATES
        choice.pair.warnings._NOTABLE_PLASTIC choice.runs.study._FENCE choice.runs.study.NAMED
        choice.td.suggest_td._MUCH choice.td.trade_off._MUCH_LESS choice.td.trade_off._LEAST_KEPT
        flight.flight._SAME flight.flight._SAME_STATES vibration.model._GAP
        choice.pair.grades._COARSE
        """,
    _INPUT: """
        choice.health._SMALL_PART choice.health._WITHIN choice.health._GAIN choice.health._SPEED
        choice.health._TORN choice.health._FEWEST choice.pair.aftermath._FEWEST_STATES choice.pair.quality._BAND
        flight.margin._FEWEST flight.window.FEWEST flight.window.FEWEST_STATES_OF_WORK flight.vibrating._FEWEST
        vibration.identify.MIN_SAMPLES vibration.identify.MIN_SAMPLES_PER_PERIOD vibration.lines._EVEN
        vibration.modal.FEWEST_STATES
        choice.question.FEWEST_STATES choice.pair.quality._NOISE_DEVIATIONS
        """,
    _LOAD: """
        flight.contact_forces._INNER flight.contact_forces._PIECES flight.contact_forces._RISE
        flight.flight.MOST_WORK flight.free_fall._ROUGHLY flight.free_fall._DAMPED flight.free_fall._LEFT
        flight.free_fall._SHOWN flight.free_fall._SEEN flight.free_fall._CLEARLY flight.free_fall._LITTLE
        flight.free_fall._STRAIGHT flight.free_fall._OF_WORK flight.internal_energy._OUTER
        flight.internal_energy._LATEST flight.internal_energy._LEVEL flight.internal_energy._KNOWN
        flight.internal_energy._TURNED flight.internal_energy._DRIFT flight.internal_energy._SWINGS
        flight.internal_energy._ALIKE flight.internal_energy._FLAT flight.internal_energy._MOST_FLAT
        flight.internal_energy._NOT_FROM_MOTION flight.margin._GRAZING_FORCE flight.margin._GRAZING_MOMENTUM
        flight.window._STAYS flight.window._STANDS flight.work._BENT flight.work._SLOW flight.work._MASS_ERROR
        flight.work._OF_INTERNAL flight.work._MUCH flight.work._RATE_ERROR choice.td.suggest_td._HIDDEN
        """,
    _PARTS: """
        choice.parts.calibration._DOUBT choice.parts.calibration._TOLD choice.parts.sets_of_parts._LIKE
        choice.parts.switchable_parts._LANDING choice.parts.switchable_parts.LANDING_ALONE
        choice.parts.switchable_parts._CHEAP flight.body_frame._MOST_BENT flight.body_frame._MOST
        flight.body_frame._ALONG_LINE flight.contact_times._SEEN flight.contact_times._OF_WEIGHT
        flight.contact_times._EDGE flight.contact_times._FEWEST flight.contact_times._OF_ONE_INTERVAL
        flight.momentum._LONGER flight.momentum._CANCELS flight.momentum._HELD flight.momentum._ALL_OF_IT
        flight.momentum._BY_ITSELF flight.momentum._OF_ITS_OWN flight.position_error._STEADY
        flight.position_error._HARDLY flight.rotation._SHOWN flight.rotation._NOTABLE_WAY flight.rotation._HEAVY
        flight.vibrating._HARDLY
        """,
    _SWITCHED: """
        choice.switched.same_model._OF_ANOTHER_MODEL choice.switched.switch_times._EARLY
        choice.switched.same_model.MOST_MOMENTUM_ERROR choice.switched.comparison._REPORTED_OFF
        choice.switched.comparison._ABOUT choice.switched.frozen._MUCH
        choice.switched.switched_run._SAME_STATES choice.td.plan._LONGER
        choice.switched.comparison._STATES_BEFORE choice.switched.switch_times._AT_CONTACT
        """,
    _DOUBT: """
        vibration.doubts.MOST_NEGATIVE vibration.doubts._MOST_NEGATIVE_AT_ALL vibration.doubts._MOST_DRIFT
        vibration.doubts.MOST_BEYOND vibration.doubts._MOST_HARMONIC vibration.doubts._MOST_UNSTRETCHED
        vibration.doubts._MOST_UNSTRETCHED_AT_ALL vibration.fitting._FAR_TOO_MUCH vibration.fitting._DRIFT
        vibration.fitting.MAX_STRUCTURE vibration.fitting._BEYOND_DOUBT vibration.fitting._BEYOND_STRUCTURE
        vibration.identify.MAX_LOCAL_STRUCTURE vibration.identify.MAX_GROWTH vibration.identify.MIN_PLASTIC
        vibration.identify.MAX_OF_SPRING vibration.identify._OF_A_PRELOAD vibration.line_scatter.MOST_SHARED
        vibration.lines._OF_A_LINE vibration.lines._ABOVE_NOISE vibration.locked_lines.NOTABLE
        vibration.locked_lines._NOTABLE_PARTNER vibration.locked_lines.ABOVE_SCATTER
        vibration.locked_lines._EXACT_RATE vibration.locked_lines._SAME_PHASE_OF_HARMONICS
        vibration.locked_lines._THIRD_ROOM vibration.locked_lines._SAME_HEIGHT vibration.measures.BAND_DEVIATIONS
        vibration.modal._NO_STATIC vibration.modal._AMBIGUOUS vibration.modal._VAGUE_HALF
        vibration.modal._SWINGING_COUNTS
        vibration.model._OF_INTERVAL vibration.moments._DROWNED
        vibration.span._LEAST_PERIODS vibration.swings._SWING
        vibration.swings._OFF_FLOOR vibration.swings._MOST_OFF vibration.swings._FEWEST vibration.swings._UNEVEN
        vibration.swings._MOST_BEATING vibration.swings._STRETCHED vibration.swings._OF_ANY_SPRING
        vibration.swings._OF_THE_FLOOR vibration.swings._UNRESOLVED
        vibration.close_modes._MOST_STATIC vibration.close_modes._LEAST_CHANGE vibration.close_modes._AS_WELL
        vibration.hidden_energy._LIKE_LEVEL vibration.hidden_energy._HIDDEN_LINES vibration.lines._LEAST_TURNS
        vibration.lines._SURE_TURNS vibration.modal._EXACT vibration.modal._SLOW_TOO
        vibration.refined_lines._SAME_LINE vibration.refined_lines._MOST_DECAY vibration.refined_lines._OF_MEAN
        vibration.lines._FEW_BLOCKS vibration.lines._MANY_BLOCKS vibration.lines._MOST_SWING
        """,
    _FACT: """
        choice.health.MOST_HOURGLASS choice.health.MOST_IMBALANCE choice.health.MOST_SLIDING
        choice.health.MOST_NEGATIVE_SLIDING choice.pair.few_states._TURNS_PER_PERIOD
        choice.pair.quality.MOST_WORTH_OF_FAIR choice.parts.calibration._US flight.free_fall._OF_DECKS
        vibration.locked_lines._THIRD_OF_SPRING vibration.locked_lines._HIGHEST_SECOND
        vibration.modal._MOST_OPPOSED
        vibration.close_modes._OF_ENDS
        """,
}
REASONS: Final = {
    name: reason for reason, names in _NAMES.items() for name in names.split()
}
