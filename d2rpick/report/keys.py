"""Define the fields that several results share. They describe a candidate, the history, its health, and the situation.

Tests compare the schemas in ``d2rpick/schemas`` with these tables; ``python -m tests.generated_schemas`` writes them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final, Protocol

from d2rpick.choice.pair.grades import DO_NOT_USE, USE, USE_WITH_CARE
from d2rpick.flight import SOURCES
from d2rpick.report.fields import Field, get_kind, many, maybe, one_of, row
from d2rpick.vibration import MODELS

if TYPE_CHECKING:
    from collections.abc import Iterable

    from d2rpick.choice.pair.situation import Situation
    from d2rpick.choice.parts.cost import Weights
    from d2rpick.choice.td.plan import RunPlan

SHARE: Final = get_kind("number", minimum=0, maximum=1)
BASIS: Final = one_of(*MODELS)
KIND: Final = one_of("crossing", "start", "extremum", "match")

WARNING: Final = row(
    Field(
        "code", get_kind("text", pattern="^[a-z0-9-]+$"), "stable code of the warning"
    ),
    Field("message", "text", "text of the warning"),
    name="warning",
)
WARNINGS: Final = Field(
    "warnings",
    many(WARNING),
    "warnings about the answer",
    lambda answer: answer.cautions,
)
PART: Final = row(
    Field("id", "integer", "part number"),
    Field("title", "text", "part title"),
    name="part",
)
TR: Final = Field("tr", "number", "time at which the parts become rigid")
TD: Final = Field("td", "number", "time at which the parts become deformable again")
TIMES: Final = row(TR, TD)
PAIR: Final = row(
    TD, TR, Field("residual", "size?", "residual of this pair; null if unknown")
)
WINDOW: Final = row(
    Field("start", "number", "first tr of the range"),
    Field("end", "number", "last tr of the range"),
    Field("share", "number", "length as a fraction of the flight up to td"),
)

WEIGHTS: Final = (
    Field("source", "text", "source of the costs, as text"),
    Field("file", "text?", "file of --weights; null if the costs are not from a file",
          lambda weights: weights.file.name if weights.file else None),
    Field("sha256", "text?", "SHA-256 of this file", lambda weights: weights.file.sha256() if weights.file else None),
)  # fmt: skip
HISTORY: Final = row(
    Field("source", get_kind("texts", minItems=1), "files of the history"),
    Field("sha256", many(get_kind("text", pattern="^[0-9a-f]{64}$")), "SHA-256 of each source, in the same order",
          lambda history: [file.sha256() for file in history.files]),
    Field("format", "text", "file format, such as matsum"),
    Field("channel", "text", "channel that is used as internal energy"),
    Field("parts", maybe(many(PART)), "parts whose energies were added; null for the whole model, or for columns"),
    Field("states", get_kind("integer", minimum=3), "number of states", lambda history: int(history.time.size)),
    Field("time_start", "number", "time of the first state", lambda history: history.start),
    Field("time_end", "number", "time of the last state", lambda history: history.end),
    Field("complete", "flag", "false if the file ends within a state"),
    Field("notes", "texts", "what was left out or assumed when the files were read"),
    Field("energy_unit", "text", "unit of the energies; empty if no file contains it", later=True),
    name="history",
)  # fmt: skip
_SOURCE: Final = one_of(*SOURCES)
FLIGHT: Final = row(
    Field(
        "start",
        "number?",
        "start of the flight, at the end of the load; null if no flight was found",
    ),
    Field("end", "number?", "time of the next contact; null if none was found"),
    Field(
        "source", maybe(_SOURCE), "evidence for the flight; null if no flight was found"
    ),
    Field(
        "certain",
        "flag",
        "true if the evidence excludes contacts and loads",
    ),
    Field(
        "parts",
        maybe(many(PART)),
        "parts that fly together; null for the whole model, or if the momentum does not show them",
    ),
    name="flight",
)
OSCILLATOR: Final = row(
    Field("omega", "number?", "damped angular frequency of the deformation [1/time]"),
    Field("alpha", "number?", "rate at which the vibration energy decays [1/time]"),
    Field("energy_plastic", "number?", "constant energy of plastic work"),
    Field("preload", "number?", "square root of the preload energy"),
    Field("misfit", "number?", "rms(E - fit)/std(E) in the fitted interval"),
    Field("source", one_of("identified", "given"), "fitted to the record (identified) or given by options"),
    Field("describes_record", "flag", "true if the oscillator describes the record well enough to be used"),
    Field("reason", "text?", "reason why the oscillator does not describe the record; null if it does"),
    name="oscillator",
)  # fmt: skip
# JSON fields with the position error of a rigid body at td, which is estimated from the motion of its parts.
_POSITION: Final = (
    Field("position_error", "size?",
          "position error of a rigid body at td, caused by a part that is frozen in another position [length]; for "
          "several bodies, the largest error; 0 if each body is a single part; null if unknown"),
    Field("position_error_part", "text?", "title of the part that causes the position error; null if there is none"),
    Field("position_error_body", "text?",
          "part numbers of the displaced rigid body, in the form of --part, if the deck defines several bodies; "
          "otherwise null"),
    Field("position_error_assumes", "text?",
          "assumption about the rigid bodies, because there is no deck; null with a deck"),
    Field("position_error_is_lower_bound", "flag?",
          "true if the position error may be larger; null if unknown. The cause is an internal motion with a period "
          "longer than the flight, or bending of the body; both look like a rotation", later=True),
)  # fmt: skip
# All values of a candidate. New values are added at the end, so that the CSV columns keep their order.
CANDIDATE: Final = row(
    Field(
        "rank",
        get_kind("integer", minimum=1),
        "position in the order from best to worst, starting at 1",
    ),
    TR,
    Field(
        "kind",
        KIND,
        "how tr was found. crossing: the energy crosses its level at td. extremum: the energy has an extremum near "
        "this level. match: the deformations of several modes are similar to their deformations at td. start: a "
        "flight in which nothing vibrates starts",
    ),
    Field("energy", "number", "internal energy at tr"),
    Field("level_ratio", "number?", "E(tr)/E(td)"),
    Field(
        "level_error",
        "size?",
        "absolute difference between 1 and the square root of level_ratio",
    ),
    Field("rising", "flag?", "true if the energy increases at tr; null at an extremum"),
    Field(
        "sign_match",
        "flag?",
        "true if the deformations at tr and td have the same direction; null if unknown",
    ),
    Field(
        "lock_in_error",
        "size?",
        "frozen-deformation error L, relative to the vibration amplitude at td",
    ),
    Field(
        "residual",
        "size?",
        "residual R: relative error of the vibration after td; null if unknown",
    ),
    Field("rigid_time", get_kind("number", exclusiveMinimum=0), "td minus tr"),
    Field(
        "rigid_fraction",
        get_kind("number", exclusiveMinimum=0, maximum=1),
        "rigid_time as a fraction of the simulated time",
    ),
    Field(
        "timing_tolerance",
        "size?",
        "time by which tr may be shifted before L grows by 0.05",
    ),
    Field(
        "tr_low",
        "number?",
        "lower bound of tr, from the output interval and the number of digits",
    ),
    Field(
        "tr_high",
        "number?",
        "upper bound of tr, from the output interval and the number of digits",
    ),
    Field(
        "acceptable",
        "flag",
        "true if tr is admissible, and the residual is at most 0.5 or unknown",
    ),
    Field("recommended", "flag", "true for the recommended tr"),
    Field("notes", "texts", "reasons why tr is not admissible, and remarks"),
    Field(
        "run_time_share",
        "size?",
        "estimated CPU time relative to the reference run",
    ),
    Field(
        "same_swing",
        "flag",
        "true if the energy has fewer than two extrema between tr and td, so that the saving is small",
    ),
    Field("residual_high", "size?", "upper bound of the residual"),
    *_POSITION,
    Field(
        "residual_low",
        "size?",
        "lower bound of the residual",
        later=True,
    ),
)
# _OF_TR: keys that explain how tr was chosen, without rating the pair.
# _FIRST: keys of the ratings that ``verify`` shows first, in this order.
_OF_TR: Final = (
    "rank", "tr", "kind", "rising", "tr_low", "tr_high", "acceptable", "recommended", "notes", "same_swing",
)  # fmt: skip
_FIRST: Final = (
    *(
        "energy",
        "level_ratio",
        "level_error",
        "sign_match",
        "lock_in_error",
        "residual",
        "residual_high",
        "residual_low",
    ),
    *(
        "timing_tolerance",
        "rigid_time",
        "rigid_fraction",
        "run_time_share",
    ),
)
MEASURES: Final = (
    *_FIRST,
    *(key for key in CANDIDATE.keys if key not in (*_OF_TR, *_FIRST)),
)
GRADE: Final = maybe(one_of("good", "fair", "poor"))
VERDICT: Final = one_of(USE, USE_WITH_CARE, DO_NOT_USE)
# JSON fields of the decision on a pair.
DECIDED: Final = row(
    Field("verdict", VERDICT, "what to do with the pair"),
    Field("verdict_reason", "text", "reason for the verdict, as text", lambda decision: decision.reason),
    Field("cure", "text", "how to improve the pair, as text; empty for a good pair"),
    Field("expected_after_td", "text", "expected result after td, as text", lambda decision: decision.expected),
    Field("worst_case", "text", "worst possible result after td, as text"),
    Field("worst_residual", get_kind("number", minimum=0),
          "worst possible residual; 2 if the residual is unknown"),
)  # fmt: skip
# JSON fields of the decision on a pair, for a result that may have no decision.
DECISION: Final = tuple(
    field._replace(kind=maybe(field.kind), later=True)
    for field in DECIDED.of_part(lambda answer: answer.decision)
)
GRADE_OF_PAIR: Final = Field(
    "quality",
    GRADE,
    "grade of the pair; null if there is no pair",
    lambda answer: answer.decision and answer.decision.grade,
)
QUALITY: Final = (
    *DECISION,
    GRADE_OF_PAIR,
    Field("quality_reasons", "texts?", "reasons why the grade is not better",
          lambda answer: answer.quality and answer.quality.reasons),
    Field("motion", GRADE, "grade of the motion: will the parts fly and land as in the reference run?",
          lambda answer: answer.quality and answer.quality.motion.grade, later=True),
    Field("motion_reasons", "texts?", "reasons why the grade is not better",
          lambda answer: answer.quality and answer.quality.motion.reasons, later=True),
    Field("vibration", GRADE, "grade of the vibration after td, which takes the energy of the next contact into "
                              "account",
          lambda answer: answer.quality and answer.quality.vibration.grade, later=True),
    Field("vibration_alone", GRADE, "grade of the vibration by itself",
          lambda answer: answer.quality and answer.quality.alone.grade, later=True),
    Field("vibration_reasons", "texts?", "reasons why the grade of the vibration is not better",
          lambda answer: answer.quality and answer.quality.alone.reasons, later=True),
    Field("vibration_worth", "size?",
          "upper bound of (energy of the vibration error) / (energy of the next contact); null if unknown",
          lambda answer: answer.quality and answer.quality.worth and answer.quality.worth.share, later=True),
    Field("mean_energy_low", "size?", "lower bound of the mean energy after td, divided by the mean energy of the "
                                      "reference run",
          lambda answer: answer.mean_energy_bounds and answer.mean_energy_bounds.low, later=True),
    Field("mean_energy_high", "size?", "upper bound of the mean energy after td, divided by the mean energy of the "
                                       "reference run",
          lambda answer: answer.mean_energy_bounds and answer.mean_energy_bounds.high, later=True),
)  # fmt: skip
EXPECTED: Final = Field("expected", maybe(row(
    Field("mean_energy", "number", "mean of the energy in the flight"),
    Field("resting_energy", get_kind("number", minimum=0), "lowest energy in the flight: an upper bound of the static "
                                                           "energy"),
    Field("kinetic_share", SHARE, "estimated kinetic fraction K at td"),
    Field("ratio", "size?", "mean energy after td divided by the mean energy of the reference run, for the "
                            "recommended tr"),
    Field("ratio_low", "size?", "the same ratio, without static energy"),
    Field("ratio_at_level", "number", "the same ratio, for a tr at which the energy equals the energy at td"),
)), "estimates for a vibration of many modes, if the basis is energy")  # fmt: skip
HEALTH: Final = Field("health", maybe(row(
    Field("hourglass_share", "size?", "hourglass energy of the model"),
    Field("part_hourglass_share", "size?", "hourglass energy of the worst of the chosen parts, relative to the peak "
                                           "internal energy of this part"),
    Field("part", maybe(row(*PART.fields)), "the chosen part with the largest part_hourglass_share"),
    Field("energy_ratio_min", "number?", "smallest ratio of the total energy to the sum of initial energy and "
                                         "external work"),
    Field("energy_ratio_max", "number?", "largest ratio of the total energy to the sum of initial energy and external "
                                         "work"),
    Field("sliding_share", "size?", "contact energy, without friction energy if the file lists it separately"),
    Field("negative_sliding_share", "size?", "largest negative contact energy, as a positive number"),
    Field("eroded_share", "size?", "energy of eroded elements"),
    Field("window", "span?", "interval to which the window_... keys refer: the rigid window, or the flight"),
    Field("window_sliding", "size?", "change of the contact energy in the window, relative to the mean energy of the "
                                     "chosen parts in the window"),
    Field("window_work", "size?", "external work in the window beyond gravity and damping, relative to the mean "
                                  "energy of the chosen parts in the window"),
    Field("window_eroded", "size?", "increase of the eroded energy in the window, relative to the mean energy of the "
                                    "chosen parts in the window"),
    Field("reason", "text?", "reason why values are null although the files contain energies"),
    Field("window_reason", "text?", "reason why the work in the window is not judged"),
    Field("until", "number?", "time up to which the run was checked: td, or the end of the run for info"),
    name="health", later=("part_hourglass_share", "part", "until"),
)), "health of the reference run: info checks the whole record, the other commands check it up to td. Energies are "
    "relative to the peak internal energy of the model; null if the files do not contain them")  # fmt: skip


class Read(Protocol):
    """An input file."""

    @property
    def name(self) -> str:
        """File name as given by the user."""

    def sha256(self) -> str:
        """Return the SHA-256 digest of the content."""


def _list_files_once(files: Iterable[Read]) -> dict[str, Read]:
    """Return the files by name. A file that is included twice is listed once."""
    return {file.name: file for file in files}


FILES: Final = (
    Field(
        "source",
        "texts",
        "files of the deck, main file first",
        lambda answer: _list_files_once(answer.files),
    ),
    Field(
        "sha256",
        "texts",
        "SHA-256 of each source, in the same order",
        lambda answer: [
            file.sha256() for file in _list_files_once(answer.files).values()
        ],
    ),
)


def _get_history_holder(answer: Any) -> RunPlan | Situation:
    """Return the plan or situation of an answer, which contains the history and the settings."""
    holder: RunPlan | Situation = (
        answer if hasattr(answer, "settings") else answer.situation
    )
    return holder


def _get_weights(answer: Any) -> Weights | None:
    used = _get_history_holder(answer).settings.by_deck
    return used.weights if used else None


# Fields at the beginning of the JSON output of every answer about a history.
FRAME: Final = (
    WARNINGS,
    Field("history", HISTORY, "history that the answer is based on",
          lambda answer: _get_history_holder(answer).history),
    Field("deck", maybe(row(*FILES, closed=True)),
          "files of the deck that the answer is based on, main file first; null without --deck, or if nothing in the "
          "deck is used",
          lambda answer: _get_history_holder(answer).settings.by_deck),
    Field("weights", maybe(row(*WEIGHTS, closed=True)),
          "element costs that the estimate of the CPU time uses; null if it uses none", _get_weights),
)  # fmt: skip


def _get_oscillator(situation: Situation) -> dict[str, Any] | None:
    """Return the fitted oscillator as JSON values; None if none was fitted."""
    fit = situation.evidence.fit
    if fit is None:
        return None
    numbers = ("omega", "alpha", "energy_plastic", "preload")
    return {
        **{name: getattr(fit.mode, name) if fit.mode else None for name in numbers},
        "misfit": fit.misfit,
        "source": "given" if situation.settings.oscillator else "identified",
        "describes_record": fit.describes_record,
        "reason": fit.reason,
    }


def _get_modes(situation: Situation) -> list[dict[str, float]] | None:
    """Return the modes on which the choice is based as JSON values; None if it is not based on modes."""
    modal = situation.vibration.modal
    return [mode._asdict() for mode in modal.modes_at(situation.td)] if modal else None


_MODE: Final = row(
    Field("omega", "number", "damped angular frequency of the deformation [1/time]"),
    Field("alpha", "number", "rate at which the energy of the mode decays [1/time]"),
    Field("vibration_energy_td", "number", "vibration energy of the mode at td"),
)
# JSON fields that describe the vibration and the flight at td.
MECHANICS: Final = row(
    Field("energy_td", "number", "internal energy at td"),
    Field("kinetic_share", maybe(SHARE), "kinetic fraction K: fraction of the vibration energy that is kinetic at td"),
    Field("kinetic_share_estimated", "flag",
          "true if kinetic_share is estimated from counted cycles, not computed with a vibration model",
          lambda now: now.vibration.estimated is not None),
    Field("basis", BASIS, "model of the vibration on which the choice is based"),
    Field("flight", FLIGHT, "free flight"),
    Field("oscillator", maybe(OSCILLATOR), "fit of one oscillator to the record; null if none was fitted",
          _get_oscillator),
    Field("modes", maybe(many(_MODE)),
          "modes of basis modal, sorted by angular frequency; null for other bases", _get_modes),
)  # fmt: skip
