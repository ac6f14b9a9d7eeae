"""Fields that several results share: of a candidate and its measures, the history, its health, the situation at td.

Tests hold the schemas in ``d2rpick/schemas`` against these tables: ``python -m tests.generated_schemas`` writes them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final, Protocol

from d2rpick.report.fields import (
    FLAG,
    INTEGER,
    NUMBER,
    SIZE,
    SOME,
    SOME_FLAG,
    SOME_TEXT,
    SPAN,
    TEXT,
    TEXTS,
    Field,
    many,
    maybe,
    one_of,
    row,
)  # fmt: skip

if TYPE_CHECKING:
    from collections.abc import Iterable

    from d2rpick.choice.cost import Weights
    from d2rpick.choice.plan import Plan
    from d2rpick.choice.situation import Situation

SHARE: Final = NUMBER.within(minimum=0, maximum=1)
BASIS: Final = one_of("parts", "oscillator", "swings", "energy")
KIND: Final = one_of("crossing", "start", "extremum", "match")

WARNING: Final = row(Field("code", TEXT.within(pattern="^[a-z0-9-]+$")), Field("message", TEXT), name="warning")
WARNINGS: Final = Field("warnings", many(WARNING), get=lambda answer: answer.cautions)
PART: Final = row(Field("id", INTEGER), Field("title", TEXT), name="part")
TIMES: Final = row(Field("tr", NUMBER), Field("td", NUMBER))
PAIR: Final = row(Field("td", NUMBER), Field("tr", NUMBER), Field("residual", SIZE))
WINDOW: Final = row(Field("start", NUMBER), Field("end", NUMBER), Field("share", NUMBER, "of the flight up to td"))


class Read(Protocol):
    """A file that was read."""

    @property
    def name(self) -> str:
        """Name that the user gave it."""

    def sha256(self) -> str:
        """SHA-256 of what was read."""


def _once(files: Iterable[Read]) -> dict[str, Read]:
    """Files by their names: one that is included twice once."""
    return {file.name: file for file in files}


FILES: Final = (
    Field("source", TEXTS, get=lambda read: _once(read.files)),
    Field("sha256", TEXTS, get=lambda read: [file.sha256() for file in _once(read.files).values()]),
)
WEIGHTS: Final = (
    Field("source", TEXT, "where they come from, in words"),
    Field("file", SOME_TEXT, "the file of --weights; null where they were not read from one",
          lambda weights: weights.file.name if weights.file else None),
    Field("sha256", SOME_TEXT, "of that file", lambda weights: weights.file.sha256() if weights.file else None),
)  # fmt: skip
HISTORY: Final = row(
    Field("source", TEXTS.within(minItems=1)),
    Field("sha256", many(TEXT.within(pattern="^[0-9a-f]{64}$")), "of each source, in its order",
          lambda history: [file.sha256() for file in history.files]),
    Field("format", TEXT),
    Field("channel", TEXT, "what was taken for the internal energy"),
    Field("parts", maybe(many(PART)), "whose energies were added, null for the whole model or columns"),
    Field("states", INTEGER.within(minimum=3), get=lambda history: int(history.time.size)),
    Field("time_start", NUMBER, get=lambda history: float(history.time[0])),
    Field("time_end", NUMBER, get=lambda history: float(history.time[-1])),
    Field("complete", FLAG, "false when the input ends within a state"),
    Field("notes", TEXTS),
    name="history",
)  # fmt: skip


def _asked(answer: Any) -> Plan | Situation:
    """Give what knows the history of an answer, and the settings."""
    known: Plan | Situation = answer if hasattr(answer, "settings") else answer.situation
    return known


def _weights(answer: Any) -> Weights | None:
    used = _asked(answer).settings.by_deck
    return used.weights if used else None


# What the JSON of an answer about a history begins with.
FRAME: Final = (
    WARNINGS,
    Field("history", HISTORY, get=lambda answer: _asked(answer).history),
    Field("deck", maybe(row(*FILES, closed=True)),
          "the files of the deck that the answer rests on, the main file first; null without --deck, and where "
          "nothing of it is used",
          lambda answer: _asked(answer).settings.by_deck),
    Field("weights", maybe(row(*WEIGHTS, closed=True)),
          "the cost of elements that the run time rests on; null where it does not rest on any", _weights),
)  # fmt: skip

_SOURCE: Final = one_of("given", "momentum", "contact-energy", "energy-balance", "oscillator", "energy")
FLIGHT: Final = row(
    Field("start", SOME),
    Field("end", SOME, "next contact, null when none was seen"),
    Field("source", maybe(_SOURCE)),
    Field("certain", FLAG, "false where the level of the energy alone shows it, or nothing"),
    Field("parts", maybe(many(PART)), "seen to fly together, null for the whole model or where momentum did not tell"),
    name="flight",
)


def _oscillator(situation: Situation) -> dict[str, Any] | None:
    """Give the one oscillator that was fitted, or None; where several describe the record, that one does not."""
    fit = situation.evidence.fit
    if fit is None:
        return None
    several = fit.mode is not None and len(fit.mode.modes) > 1
    numbers = ("omega", "alpha", "energy_plastic", "preload")
    return {
        **{name: getattr(fit.mode, name) if fit.mode and not several else None for name in numbers},
        "misfit": fit.misfit,
        "source": "given" if situation.settings.oscillator else "identified",
        "describes_record": fit.describes_record and not several,
        "reason": "several modes describe the record" if several else fit.reason,
    }


def _modes(situation: Situation) -> list[dict[str, float]] | None:
    """Give the modes whose sum describes the record, or None where one or none does."""
    modes = situation.vibration.whole.mode.modes if situation.vibration.whole.mode else ()
    if len(modes) < 2:
        return None
    return [
        {"omega": one.omega, "alpha": one.alpha, "vibration_energy_td": float(one.vibration_energy(situation.td))}
        for one in modes
    ]


OSCILLATOR: Final = row(
    Field("omega", SOME), Field("alpha", SOME), Field("energy_plastic", SOME),
    Field("preload", SOME, "square root of energy"),
    Field("misfit", SOME, "rms(E - fit)/std(E) over the fitted window"),
    Field("source", one_of("identified", "given")),
    Field("describes_record", FLAG),
    Field("reason", SOME_TEXT),
    name="oscillator",
)  # fmt: skip
# What is known at td; of a situation.
MECHANICS: Final = row(
    Field("energy_td", NUMBER),
    Field("kinetic_share", maybe(SHARE)),
    Field("kinetic_share_estimated", FLAG,
          "kinetic_share is the sum over the modes found in each part: no oscillator describes the whole",
          lambda now: now.vibration.estimated is not None),
    Field("basis", BASIS),
    Field("flight", FLIGHT, "window of free flight"),
    Field("oscillator", maybe(OSCILLATOR), get=_oscillator),
    Field("modes", maybe(many(row(*(Field(key, NUMBER) for key in ("omega", "alpha", "vibration_energy_td"))))),
          "two or three whose energies add up to the record; null where one oscillator or none describes it", _modes),
    Field("unsigned_parts", maybe(many(row(Field("name", TEXT), Field("reason", TEXT)))),
          "parts whose deformation has no sign; null where energies of single parts are not known",
          lambda now: now.evidence.parts and now.evidence.parts.unsigned),
)  # fmt: skip

# Where a rigid body will be at td, as far as single parts tell.
_POSITION: Final = (
    Field("position_error", SIZE,
          "how far a rigid body will be out of place at td since a part is frozen elsewhere, the largest of several "
          "bodies [length]; 0 where each is a single part, in which nothing is seen to move; null where unknown"),
    Field("position_error_part", SOME_TEXT, "title of the part that causes it; null where nothing is frozen elsewhere"),
    Field("position_error_body", SOME_TEXT,
          "numbers of the parts of the rigid body that is off, as --part takes them, where the deck tells several; "
          "else null"),
    Field("position_error_assumes", SOME_TEXT,
          "what is taken for granted since no deck tells which parts become one rigid body; null with a deck"),
    Field("position_error_is_lower_bound", SOME_FLAG,
          "whether the body may be further off: inner motion that is slower than the flight, or that bends the body, "
          "passes for its rotation; null where nothing is known"),
)  # fmt: skip
# What is said of a candidate beside its parts; in CSV the notes come last.
CANDIDATE: Final = row(
    Field("rank", INTEGER.within(minimum=1)),
    Field("tr", NUMBER),
    Field("kind", KIND),
    Field("energy", NUMBER),
    Field("energy_ratio", SOME),
    Field("level_error", SIZE),
    Field("rising", SOME_FLAG, "null at an extremum"),
    Field("sign_match", SOME_FLAG),
    Field("lock_in_error", SIZE),
    Field("residual", SIZE),
    Field("part_mismatch", SIZE),
    Field("rigid_time", NUMBER.within(exclusiveMinimum=0)),
    Field("rigid_fraction", NUMBER.within(exclusiveMinimum=0, maximum=1)),
    Field("timing_tolerance", SIZE),
    Field("tr_low", SOME),
    Field("tr_high", SOME),
    Field("acceptable", FLAG),
    Field("recommended", FLAG),
    Field("notes", TEXTS),
    Field("run_time_share", SIZE, "expected run time over that of the reference, with --cost-share"),
    Field("same_swing", FLAG, "the energy turns less than twice from tr to td: hardly anything is saved"),
    Field("residual_high", SIZE),
    *_POSITION,
)
# Of these those that measure a pair of times, in the order in which ``verify`` shows them.
MEASURES: Final = (
    *("energy", "energy_ratio", "level_error", "sign_match", "lock_in_error", "residual", "residual_high"),
    *("part_mismatch", "timing_tolerance", "rigid_time", "rigid_fraction", "run_time_share"),
    *("position_error", "position_error_part", "position_error_body", "position_error_assumes"),
    "position_error_is_lower_bound",
)
# Keys that came later than the schemas that have them.
LATER: Final = ("run_time_share", "same_swing", "residual_high", *(field.key for field in _POSITION))

MATCHES: Final = Field("parts", many(row(
    Field("name", TEXT),
    Field("sign_match", SOME_FLAG),
    Field("share", maybe(SHARE), "in the square of the part mismatch"),
    Field("reason", SOME_TEXT),
    name="part_match",
)))  # fmt: skip
GRADE: Final = maybe(one_of("good", "fair", "poor"))
QUALITY: Final = (
    Field("quality", GRADE, "of the pair; null without one", lambda answer: answer.quality and answer.quality.grade),
    Field("quality_reasons", maybe(TEXTS), "why it is none better",
          lambda answer: answer.quality and answer.quality.reasons),
)  # fmt: skip
EXPECTED: Final = Field("expected", maybe(row(
    Field("mean_energy", NUMBER, "mean of the energy in the flight"),
    Field("resting_energy", NUMBER.within(minimum=0), "lowest energy in the flight: what does not vibrate"),
    Field("kinetic_share", SHARE),
    Field("ratio", SIZE, "mean energy after td over the reference's, for the recommended tr"),
    Field("ratio_low", SIZE, "the same if nothing is at rest"),
    Field("ratio_at_level", NUMBER, "the same for a tr with the energy of td"),
)), "estimates on basis energy, for a vibration of many modes")  # fmt: skip
HEALTH: Final = Field("health", maybe(row(
    Field("hourglass_share", SIZE),
    Field("part_hourglass_share", SIZE, "of part, the worst of those to be switched"),
    Field("part", maybe(row(*PART.fields))),
    Field("energy_ratio_min", SOME, "total energy over initial energy and external work"),
    Field("energy_ratio_max", SOME),
    Field("sliding_share", SIZE, "energy of contacts, without friction where that is told apart"),
    Field("negative_sliding_share", SIZE),
    Field("eroded_share", SIZE),
    Field("window", maybe(SPAN)),
    Field("window_sliding", SIZE, "change in the window, as a share of the mean energy of the chosen parts there"),
    Field("window_work", SIZE, "external work beyond gravity and damping"),
    Field("window_eroded", SIZE),
    Field("reason", SOME_TEXT),
    Field("window_reason", SOME_TEXT, "why the work in the window is not judged"),
    Field("until", SOME, "the run was judged up to here: td, or its end in info"),
    name="health", later=("part_hourglass_share", "part", "until"),
)), "of the reference run up to td; shares of the peak internal energy of the model, null for what the files do not "
    "have")  # fmt: skip
