"""Define the fields shared by several results: of a candidate, the history, its health, and the situation at td.

Tests compare the schemas in ``d2rpick/schemas`` with these tables; ``python -m tests.generated_schemas`` writes them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final, Protocol

from d2rpick.choice.pair.grades import DO_NOT_USE, USE, USE_WITH_CARE
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
    Field("code", get_kind("text", pattern="^[a-z0-9-]+$")),
    Field("message", "text"),
    name="warning",
)
WARNINGS: Final = Field("warnings", many(WARNING), get=lambda answer: answer.cautions)
PART: Final = row(Field("id", "integer"), Field("title", "text"), name="part")
TIMES: Final = row(Field("tr", "number"), Field("td", "number"))
PAIR: Final = row(
    Field("td", "number"), Field("tr", "number"), Field("residual", "size?")
)
WINDOW: Final = row(
    Field("start", "number"),
    Field("end", "number"),
    Field("share", "number", "of the flight up to td"),
)

WEIGHTS: Final = (
    Field("source", "text", "where they come from, in words"),
    Field("file", "text?", "the file of --weights; null where they were not read from one",
          lambda weights: weights.file.name if weights.file else None),
    Field("sha256", "text?", "of that file", lambda weights: weights.file.sha256() if weights.file else None),
)  # fmt: skip
HISTORY: Final = row(
    Field("source", get_kind("texts", minItems=1)),
    Field("sha256", many(get_kind("text", pattern="^[0-9a-f]{64}$")), "of each source, in its order",
          lambda history: [file.sha256() for file in history.files]),
    Field("format", "text"),
    Field("channel", "text", "what was taken for the internal energy"),
    Field("parts", maybe(many(PART)), "whose energies were added, null for the whole model or columns"),
    Field("states", get_kind("integer", minimum=3), get=lambda history: int(history.time.size)),
    Field("time_start", "number", get=lambda history: float(history.time[0])),
    Field("time_end", "number", get=lambda history: float(history.time[-1])),
    Field("complete", "flag", "false when the input ends within a state"),
    Field("notes", "texts"),
    name="history",
)  # fmt: skip
_SOURCE: Final = one_of(
    "given",
    "momentum",
    "contact-force",
    "contact-energy",
    "energy-balance",
    "oscillator",
    "energy",
)
FLIGHT: Final = row(
    Field("start", "number?"),
    Field("end", "number?", "next contact, null when none was seen"),
    Field("source", maybe(_SOURCE)),
    Field(
        "certain",
        "flag",
        "false where the level of the energy alone shows it, or nothing",
    ),
    Field(
        "parts",
        maybe(many(PART)),
        "seen to fly together, null for the whole model or where momentum did not tell",
    ),
    name="flight",
)
OSCILLATOR: Final = row(
    Field("omega", "number?"), Field("alpha", "number?"), Field("energy_plastic", "number?"),
    Field("preload", "number?", "square root of energy"),
    Field("misfit", "number?", "rms(E - fit)/std(E) over the fitted window"),
    Field("source", one_of("identified", "given")),
    Field("describes_record", "flag"),
    Field("reason", "text?"),
    name="oscillator",
)  # fmt: skip
# position of the rigid body at td, estimated from single parts
_POSITION: Final = (
    Field("position_error", "size?",
          "how far a rigid body will be out of place at td since a part is frozen elsewhere, the largest of several "
          "bodies [length]; 0 where each is a single part, in which nothing is seen to move; null where unknown"),
    Field("position_error_part", "text?", "title of the part that causes it; null where nothing is frozen elsewhere"),
    Field("position_error_body", "text?",
          "numbers of the parts of the rigid body that is off, as --part takes them, where the deck tells several; "
          "else null"),
    Field("position_error_assumes", "text?",
          "what is taken for granted since no deck tells which parts become one rigid body; null with a deck"),
    Field("position_error_is_lower_bound", "flag?",
          "whether the body may be further off: inner motion that is slower than the flight, or that bends the body, "
          "passes for its rotation; null where nothing is known", later=True),
)  # fmt: skip
# Values of a candidate besides its parts; in CSV the notes come last. Add a new measure at the end.
CANDIDATE: Final = row(
    Field("rank", get_kind("integer", minimum=1)),
    Field("tr", "number"),
    Field("kind", KIND),
    Field("energy", "number"),
    Field("level_ratio", "number?", "E(tr)/E(td)"),
    Field("level_error", "size?"),
    Field("rising", "flag?", "null at an extremum"),
    Field("sign_match", "flag?"),
    Field("lock_in_error", "size?"),
    Field("residual", "size?"),
    Field("part_mismatch", "size?"),
    Field("rigid_time", get_kind("number", exclusiveMinimum=0)),
    Field("rigid_fraction", get_kind("number", exclusiveMinimum=0, maximum=1)),
    Field("timing_tolerance", "size?"),
    Field("tr_low", "number?"),
    Field("tr_high", "number?"),
    Field("acceptable", "flag"),
    Field("recommended", "flag"),
    Field("notes", "texts"),
    Field(
        "run_time_share",
        "size?",
        "expected run time over that of the reference, with --cost-share",
    ),
    Field(
        "same_swing",
        "flag",
        "the energy turns less than twice from tr to td: hardly anything is saved",
    ),
    Field("residual_high", "size?", "the highest residual that the record allows"),
    *_POSITION,
    Field(
        "residual_low",
        "size?",
        "the lowest residual that the record allows",
        later=True,
    ),
)
# Values that explain tr but do not measure the pair, and the measures that ``verify`` shows first, in order.
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
        "part_mismatch",
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
# Keys added after the first schemas of ``suggest`` and ``verify``, but in the others from the start.
LATER: Final = (
    "run_time_share",
    "same_swing",
    "residual_high",
    *(field.key for field in _POSITION),
)
MATCHES: Final = Field("parts", many(row(
    Field("name", "text"),
    Field("sign_match", "flag?"),
    Field("share", maybe(SHARE), "in the square of the part mismatch"),
    Field("reason", "text?"),
    name="part_match",
)))  # fmt: skip
GRADE: Final = maybe(one_of("good", "fair", "poor"))
VERDICT: Final = one_of(USE, USE_WITH_CARE, DO_NOT_USE)
# values of the decision on a pair
DECIDED: Final = row(
    Field("verdict", VERDICT, "what to do with the pair, by its grade"),
    Field("verdict_reason", "text", "why, in words", lambda decision: decision.reason),
    Field("cure", "text", "what would make it better, in words; empty for a good pair"),
    Field("expected_after_td", "text", "what is expected after td, in words", lambda decision: decision.expected),
    Field("worst_case", "text", "the worst that the record allows after td, in words"),
    Field("worst_residual", get_kind("number", minimum=0),
          "the largest residual that the record allows; 2 if nothing is known of it"),
)  # fmt: skip
# the same values for a result whose decision may be None
DECISION: Final = tuple(
    field._replace(kind=maybe(field.kind), later=True)
    for field in DECIDED.of_part(lambda answer: answer.decision)
)
GRADE_OF_PAIR: Final = Field(
    "quality",
    GRADE,
    "of the pair, as in verdict; null without one",
    lambda answer: answer.decision and answer.decision.grade,
)
QUALITY: Final = (
    *DECISION,
    GRADE_OF_PAIR,
    Field("quality_reasons", "texts?", "why it is none better",
          lambda answer: answer.quality and answer.quality.reasons),
    Field("motion", GRADE, "grade of the motion: will the parts fly and land as without switching",
          lambda answer: answer.quality and answer.quality.motion.grade, later=True),
    Field("motion_reasons", "texts?", "why it is none better",
          lambda answer: answer.quality and answer.quality.motion.reasons, later=True),
    Field("vibration", GRADE, "grade of the vibration after td, by what its error is worth in the next contact",
          lambda answer: answer.quality and answer.quality.vibration.grade, later=True),
    Field("vibration_alone", GRADE, "grade of the vibration by itself",
          lambda answer: answer.quality and answer.quality.alone.grade, later=True),
    Field("vibration_reasons", "texts?", "why that is none better",
          lambda answer: answer.quality and answer.quality.alone.reasons, later=True),
    Field("vibration_worth", "size?",
          "energy of the error of the vibration over that which the next contact puts into the parts, at most; null "
          "where that is not known",
          lambda answer: answer.quality and answer.quality.worth and answer.quality.worth.share, later=True),
    Field("mean_energy_low", "size?", "least mean energy after td that is expected, over the reference's",
          lambda answer: answer.kept and answer.kept.low, later=True),
    Field("mean_energy_high", "size?", "largest mean energy after td that is expected, over the reference's",
          lambda answer: answer.kept and answer.kept.high, later=True),
)  # fmt: skip
EXPECTED: Final = Field("expected", maybe(row(
    Field("mean_energy", "number", "mean of the energy in the flight"),
    Field("resting_energy", get_kind("number", minimum=0), "lowest energy in the flight: what does not vibrate"),
    Field("kinetic_share", SHARE),
    Field("ratio", "size?", "mean energy after td over the reference's, for the recommended tr"),
    Field("ratio_low", "size?", "the same if nothing is at rest"),
    Field("ratio_at_level", "number", "the same for a tr with the energy of td"),
)), "estimates on basis energy, for a vibration of many modes")  # fmt: skip
HEALTH: Final = Field("health", maybe(row(
    Field("hourglass_share", "size?"),
    Field("part_hourglass_share", "size?", "of part, the worst of those to be switched"),
    Field("part", maybe(row(*PART.fields))),
    Field("energy_ratio_min", "number?", "total energy over initial energy and external work"),
    Field("energy_ratio_max", "number?"),
    Field("sliding_share", "size?", "energy of contacts, without friction where that is told apart"),
    Field("negative_sliding_share", "size?"),
    Field("eroded_share", "size?"),
    Field("window", "span?"),
    Field("window_sliding", "size?", "change in the window, as a share of the mean energy of the chosen parts there"),
    Field("window_work", "size?", "external work beyond gravity and damping"),
    Field("window_eroded", "size?"),
    Field("reason", "text?"),
    Field("window_reason", "text?", "why the work in the window is not judged"),
    Field("until", "number?", "the run was judged up to here: td, or its end in info"),
    name="health", later=("part_hourglass_share", "part", "until"),
)), "of the reference run up to td; shares of the peak internal energy of the model, null for what the files do not "
    "have")  # fmt: skip


class Read(Protocol):
    """An input file."""

    @property
    def name(self) -> str:
        """Name as the user gave it."""

    def sha256(self) -> str:
        """Return the SHA-256 digest of the content."""


def _list_files_once(files: Iterable[Read]) -> dict[str, Read]:
    """Return the files by name; a file that is included twice occurs once."""
    return {file.name: file for file in files}


FILES: Final = (
    Field("source", "texts", get=lambda answer: _list_files_once(answer.files)),
    Field(
        "sha256",
        "texts",
        get=lambda answer: [
            file.sha256() for file in _list_files_once(answer.files).values()
        ],
    ),
)


def _get_history_holder(answer: Any) -> RunPlan | Situation:
    """Return the plan or situation of an answer, which holds the history and the settings."""
    holder: RunPlan | Situation = (
        answer if hasattr(answer, "settings") else answer.situation
    )
    return holder


def _get_weights(answer: Any) -> Weights | None:
    used = _get_history_holder(answer).settings.by_deck
    return used.weights if used else None


# fields with which the JSON of every answer about a history begins
FRAME: Final = (
    WARNINGS,
    Field("history", HISTORY, get=lambda answer: _get_history_holder(answer).history),
    Field("deck", maybe(row(*FILES, closed=True)),
          "the files of the deck that the answer rests on, the main file first; null without --deck, and where "
          "nothing of it is used",
          lambda answer: _get_history_holder(answer).settings.by_deck),
    Field("weights", maybe(row(*WEIGHTS, closed=True)),
          "the cost of elements that the run time rests on; null where it does not rest on any", _get_weights),
)  # fmt: skip


def _get_oscillator(situation: Situation) -> dict[str, Any] | None:
    """Return the fitted oscillator, or None if none was searched for."""
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
    """Return the modes on which the choice is based, or None if it is not based on modes."""
    modal = situation.vibration.modal
    return [mode._asdict() for mode in modal.modes_at(situation.td)] if modal else None


# values of a situation at td
MECHANICS: Final = row(
    Field("energy_td", "number"),
    Field("kinetic_share", maybe(SHARE)),
    Field("kinetic_share_estimated", "flag",
          "kinetic_share is that of the modes found in each part or of the counted swings: no oscillator is better",
          lambda now: now.vibration.estimated is not None),
    Field("basis", BASIS),
    Field("flight", FLIGHT, "window of free flight"),
    Field("oscillator", maybe(OSCILLATOR), get=_get_oscillator),
    Field("modes", maybe(many(row(*(Field(key, "number") for key in ("omega", "alpha", "vibration_energy_td"))))),
          "those that basis modal was identified from, by their rates; null on any other basis", _get_modes),
    Field("unsigned_parts", maybe(many(row(Field("name", "text"), Field("reason", "text")))),
          "parts whose deformation has no sign; null where energies of single parts are not known",
          lambda now: now.evidence.parts and now.evidence.parts.unsigned),
)  # fmt: skip
