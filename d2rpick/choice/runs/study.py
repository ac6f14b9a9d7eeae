"""Answer one question for many runs: the tr of each run, whether they agree, one tr for all runs, and outliers."""

from __future__ import annotations

import hashlib
import os
from collections import Counter
from dataclasses import field, replace
from pathlib import Path
from statistics import median, median_high
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from d2rpick.base import __version__
from d2rpick.base.data_classes import dataclass
from d2rpick.base.errors import (
    FORESEEN,
    INTERNAL_ERROR,
    Caution,
    D2RPickError,
    RangeError,
    format_in_one_line,
    list_names,
    name_units,
)
from d2rpick.choice.answers import decide_with_better_pair, suggest_in_run
from d2rpick.choice.pair.grades import GRADES, POOR
from d2rpick.choice.pair.quality import EQUALLY_GOOD, grade_residual
from d2rpick.choice.pair.windows import (
    count_coverage,
    cut_before_td,
    find_acceptable_windows,
    find_alike_windows,
    find_common_windows,
    interpolate_error,
    make_error_profile,
)
from d2rpick.choice.parts.deck_of_run import is_different_title
from d2rpick.choice.question import read_reference
from d2rpick.histories.digits import format_distinctly
from d2rpick.histories.names import Selection
from d2rpick.histories.samples import draw_outline
from d2rpick.histories.source import expand

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.choice.answers import PairSuggestion
    from d2rpick.choice.pair.decision import Decision
    from d2rpick.choice.question import Settings
    from d2rpick.histories.history import History, Samples

# Status of a run; only runs with one of the first two values were judged.
OK, NONE, UNREADABLE, OUT_OF_RANGE, FAILED = (
    "ok",
    "none",
    "unreadable",
    "out-of-range",
    "failed",
)
# Distance of Tukey's fences from the quartiles, in interquartile ranges [-]; outliers lie beyond the fences.
_FENCE: Final = 1.5
# Largest number of runs that are named in a sentence.
NAMED: Final = 3
# Rounding tr to fewer digits may shorten the rigid time by at most this fraction [-].
_ROUNDED: Final = 0.001
# Codes of warnings about single runs that a study does not repeat, because the row of the run shows them.
_NOT_REPEATED = ("no-candidate",)
# A record is complete if it ends no earlier than this fraction of the median end time of all runs [-].
_WHOLE: Final = 0.99
# Largest difference of two times that are taken as equal but for their unit, relative to the times [-].
_SAME_TIME: Final = 0.02
# Number of intervals into which a curve is divided; only the lowest and highest energy of each interval are drawn.
_STRETCHES = 200


_DEFAULT = Selection()


@dataclass(frozen=True)
class Question:
    """The question that is asked of every run; ``td`` is a time, a time range, or None for the longest flight.

    If ``curve`` is True, an outline of the energy is kept for drawing.
    """

    td: float | tuple[float, float] | None
    settings: Settings
    selection: Selection = _DEFAULT
    input_format: str = "auto"
    curve: bool = False
    tool_version: str = __version__


class Stamp(NamedTuple):
    """Size in bytes and modification time in nanoseconds of a file when its run was read."""

    name: str
    size: int
    mtime_ns: int


@dataclass(frozen=True, eq=False)
class StudyRow:
    """The answer for one run, with times in the unit of its history; None if a value is unknown.

    ``status`` is "ok", "none" (no pair can be recommended), "unreadable", "out-of-range" (the record does not reach td
    or is too short), "failed" (its process died), or "internal-error" (the program failed). ``message`` gives the
    reason for a status other than "ok"; ``warnings`` contains codes. The fields from ``quality`` to ``cure`` are those
    of the suggestion for this run. ``td`` is that of this run, and ``better_td`` that of a better pair. ``acceptable``
    contains the windows of acceptable tr, shape (n, 2), and ``alike`` the windows in which the error exceeds that of
    the run's own tr by at most 0.05. ``profile`` contains the errors, shape (2, m). ``files`` were read up to
    ``record_end`` [time]. ``curve`` is an outline of the energy, shape (2, k), if it was requested. ``energy`` is the
    name of the energy by which the run was judged. ``parts`` contains the ids of the parts to which it belongs; None
    for the whole model or a column. ``is_unchosen`` is True if it is the energy of the whole model because no part or
    energy was chosen, although the files show which parts fly. ``parts_in_files`` contains the id and title of each
    part in the files of the run.
    """

    source: str
    status: str
    message: str | None = None
    tr: float | None = None
    tr_low: float | None = None
    tr_high: float | None = None
    energy_td: float | None = None
    residual: float | None = None
    basis: str | None = None
    time_unit: str = ""
    energy_unit: str = ""
    warnings: tuple[str, ...] = ()
    td: float | None = None
    record_end: float | None = None
    quality: str | None = None
    verdict: str | None = None
    verdict_reason: str | None = None
    cure: str | None = None
    better_td: float | None = None
    energy: str | None = None
    parts: tuple[int, ...] | None = None
    is_unchosen: bool | None = None
    parts_in_files: tuple[str, ...] = ()
    acceptable: Samples = field(default_factory=lambda: np.zeros((0, 2)))
    alike: Samples = field(default_factory=lambda: np.zeros((0, 2)))
    profile: Samples | None = None
    files: tuple[Stamp, ...] = ()
    curve: Samples | None = None

    @property
    def judged(self) -> bool:
        """True if the run could be read and judged."""
        return self.status in (OK, NONE)


class Common(NamedTuple):
    """The tr for all judged runs, with the window that all runs share [time]; None, with a reason, if no tr suits all.

    ``keeps_tolerance`` is True if tr lies within the timing tolerance of every run, so that no error exceeds the error
    at the run's own tr by more than 0.05. ``errors`` contains the error of each run at this tr [-]; None if the run was
    not judged. It is a residual or, if only the energy is known, a level error.
    """

    tr: float | None
    window: tuple[float, float] | None
    reason: str | None
    keeps_tolerance: bool | None = None
    errors: tuple[float | None, ...] = ()


class Spread(NamedTuple):
    """Smallest, median and largest recommended tr of the runs [time]."""

    min: float
    median: float
    max: float


@dataclass(frozen=True)
class StudyOfRuns:
    """The answer of ``study``; ``agree`` is True if the tr intervals of all runs overlap, None if there is no tr.

    ``td`` is None if each run has a td of its own, which is chosen in ``td_window`` or, if this is None, in the longest
    flight of the run.
    """

    td: float | None
    td_window: tuple[float, float] | None
    runs: tuple[StudyRow, ...]
    spread: Spread | None
    agree: bool | None
    common: Common
    cautions: tuple[Caution, ...]

    @property
    def judged(self) -> int:
        """Number of runs that could be read and judged."""
        return sum(row.judged for row in self.runs)

    @property
    def energy_unit(self) -> str:
        """Unit of the energies; empty if the units of the judged runs differ."""
        units = {row.energy_unit for row in self.runs if row.judged}
        return units.pop() if len(units) == 1 else ""

    @property
    def grade(self) -> str | None:
        """Grade of the common tr: the worst grade of any run's pair, or of its error at this tr; None if unknown."""
        if self.common.tr is None:
            return None
        grades = [row.quality for row in self.runs if row.quality]
        for row, error in zip(self.runs, self.common.errors, strict=True):
            if error is None or row.residual is None or row.basis == "energy":
                continue
            # The grade at the common tr is used only if it is worse than the grade at the run's own tr.
            at_common_tr = grade_residual(error)
            if GRADES.index(at_common_tr) < GRADES.index(grade_residual(row.residual)):
                grades.append(at_common_tr)
        return min(grades, key=GRADES.index, default=None)

    @property
    def objection(self) -> bool:
        """True if a run has no tr, if there is no common tr, or if td was chosen and the common tr cannot be used."""
        is_incomplete = any(row.status != OK for row in self.runs)
        return self.common.tr is None or is_incomplete or self.is_choice_refused

    @property
    def is_choice_refused(self) -> bool:
        """True if td was chosen and the common tr cannot be used; for a given td, the best tr is always accepted."""
        return self.td is None and self.grade == POOR


def judge_run(question: Question, source: str) -> StudyRow:
    """Read and judge one run. Its row reports any error.

    Raises
    ------
    D2RPickError
        If the question comes from another version of this program.
    """
    if question.tool_version != __version__:
        raise D2RPickError(
            f"d2rpick {question.tool_version} asks d2rpick {__version__}; install the same version everywhere"
        )
    files = stamp_files(source)
    end = None
    try:
        reference = read_reference([source], question.selection, question.input_format)
        end = reference.history.end
        answer = suggest_in_run(
            reference, question.td, question.settings, with_better=False
        )
    except (D2RPickError, OSError) as error:
        status = OUT_OF_RANGE if isinstance(error, RangeError) else UNREADABLE
        if isinstance(error, OSError) and error.strerror:
            text = f"{source}: {error.strerror}"
        else:
            text = str(error)
        return StudyRow(source, status, text, files=files, record_end=end)
    time = reference.history.time
    energy = reference.history.energy
    curve = draw_outline(time, energy, _STRETCHES) if question.curve else None
    is_chosen = bool(question.selection.energy or question.selection.parts)
    shows_parts = answer.situation.flight.by_parts
    return replace(
        make_row(source, answer),
        files=files,
        curve=curve,
        record_end=end,
        is_unchosen=shows_parts and not is_chosen,
        parts_in_files=tuple(
            f"{part.id} {part.title}".rstrip() for part in reference.run.parts
        ),
    )


def make_row(source: str, answer: PairSuggestion) -> StudyRow:
    """Return the row of a study for one run from the answer for this run."""
    best = answer.chosen
    situation = answer.situation
    acceptable = cut_before_td(
        situation,
        find_acceptable_windows(
            situation, answer.candidates, best.tr if best else None
        ),
    )
    messages = {caution.code: caution.message for caution in answer.cautions}
    alike = acceptable
    if best:
        alike = find_alike_windows(situation, answer.candidates, best, acceptable)
    row = StudyRow(
        source=source,
        status=NONE,
        message=messages.get("no-candidate"),
        energy_td=situation.energy_td,
        basis=situation.basis,
        warnings=tuple(code for code in messages if code not in _NOT_REPEATED),
        time_unit=situation.history.time_unit,
        energy_unit=situation.history.energy_unit,
        energy=situation.history.energy_name,
        parts=_list_part_ids(situation.history),
        td=situation.td,
        acceptable=acceptable,
        alike=alike,
        profile=make_error_profile(situation, answer.candidates, acceptable),
    )
    if best is None:
        return row
    return replace(
        row,
        status=OK,
        tr=best.tr,
        tr_low=best.tr_low,
        tr_high=best.tr_high,
        residual=best.residual,
        **_list_decision_fields(_decide(answer)),
    )


def _list_part_ids(history: History) -> tuple[int, ...] | None:
    """Return the ids of the parts to which an energy belongs, without the springs; None for the whole model."""
    if history.parts is None:
        return None
    return tuple(part.id for part in history.parts if part not in history.springs)


def _decide(answer: PairSuggestion) -> Decision | None:
    """Return the verdict on the pair of a run; for a given td, it names the same better pair as ``suggest``."""
    return answer.decision if answer.td_window else decide_with_better_pair(answer)


def _list_decision_fields(decision: Decision | None) -> dict[str, Any]:
    """Return the verdict on the pair of a run as fields of its row."""
    if decision is None:
        return {}
    return {
        "quality": decision.grade,
        "better_td": decision.better.td if decision.better else None,
        "verdict": decision.verdict,
        "verdict_reason": decision.reason,
        "cure": decision.cure,
    }


def make_failed_row(source: str, error: BaseException) -> StudyRow:
    """Return the row of a run whose process ended without an answer."""
    status = FAILED if isinstance(error, FORESEEN) else INTERNAL_ERROR
    return StudyRow(source, status, f"{source}: {format_in_one_line(error)}")


def stamp_files(source: str) -> tuple[Stamp, ...]:
    """Return the size and modification time of each file of a run, by absolute name; empty if there are no files."""
    try:
        states = [
            (os.path.realpath(name), Path(name).stat()) for name in expand([source])
        ]
    except (D2RPickError, OSError):  # The error is reported when the run is read.
        return ()
    return tuple(
        Stamp(path, state.st_size, state.st_mtime_ns) for path, state in states
    )


def compare_rows(
    td: float | tuple[float, float] | None, rows: Sequence[StudyRow]
) -> StudyOfRuns:
    """Compare the rows of a study; ``td`` is the requested td, or the requested range for td."""
    times, low, high = _find_common_interval(rows)
    spread = Spread(min(times), median(times), max(times)) if times else None
    agree = low <= high if times else None
    common = choose_common_tr(rows)
    td_of_all, td_window = (None, td) if isinstance(td, tuple) else (td, None)
    return StudyOfRuns(
        td_of_all,
        td_window,
        tuple(rows),
        spread,
        agree,
        common,
        tuple(_warn_about_runs(rows, common)),
    )


def _find_common_interval(rows: Sequence[StudyRow]) -> tuple[list[float], float, float]:
    """Return the tr of all runs, and the interval within the accuracy of every tr (empty if low > high)."""
    chosen = [(row.tr, row.tr_low, row.tr_high) for row in rows if row.tr is not None]
    low = max((bound for _, bound, _ in chosen if bound is not None), default=np.inf)
    high = min((bound for _, _, bound in chosen if bound is not None), default=-np.inf)
    return [tr for tr, _, _ in chosen], low, high


def find_cut_runs(rows: Sequence[StudyRow]) -> list[StudyRow]:
    """Return the runs that were cut off: their files end within a state, or their records are unusually short."""
    read_to = [(row, row.record_end) for row in rows if row.record_end is not None]
    # A run that could not be judged does not show how long the runs of the study should be.
    judged = [end for row, end in read_to if row.judged]
    whole = median_high(judged) if judged else 0.0
    return [
        row
        for row, end in read_to
        if (end < _WHOLE * whole and not _find_unit_ratio(end, whole))
        or "truncated-input" in row.warnings
    ]


def describe_other_unit(rows: Sequence[StudyRow]) -> str:
    """Return that the times of some runs are 1000 or 1,000,000 times those of others; empty if none are."""
    ended = [row for row in rows if row.record_end and row.tr]
    for row in ended:
        first = ended[0]
        ratio = _find_unit_ratio(first.record_end or 0.0, row.record_end or 0.0)
        if ratio and ratio == _find_unit_ratio(first.tr or 0.0, row.tr or 0.0):
            return _compare_units(row, first, ratio)
        ratio = _find_unit_ratio(row.record_end or 0.0, first.record_end or 0.0)
        if ratio and ratio == _find_unit_ratio(row.tr or 0.0, first.tr or 0.0):
            return _compare_units(first, row, ratio)
    return ""


def _compare_units(later: StudyRow, earlier: StudyRow, ratio: float) -> str:
    """Return that the times of two runs seem to have different units."""
    return (
        f"the times of {later.source} are {ratio:g} times those of {earlier.source}, so they seem to be in another "
        "unit; convert the runs to one unit of time"
    )


def _find_unit_ratio(time: float, later: float) -> float:
    """Return 1000 or 1,000,000 if ``later`` is about this multiple of ``time``; 0 otherwise."""
    return next(
        (
            size
            for size in (1e3, 1e6)
            if abs(later - size * time) <= _SAME_TIME * size * time
        ),
        0.0,
    )


def describe_end_of_record(row: StudyRow) -> str:
    """Describe how the record of a cut-off run ends: within a state, or earlier than most other records."""
    if "truncated-input" in row.warnings:
        return f"cut at {row.record_end:g}"
    return f"ends early, at {row.record_end:g}"


def find_repeated_runs(rows: Sequence[StudyRow]) -> tuple[list[StudyRow], ...]:
    """Return the groups of judged runs that were read from the same files or from files with equal content."""
    # File contents are compared only if the file sizes and the answers for the runs are equal.
    alike: dict[tuple[Any, ...], list[StudyRow]] = {}
    for row in rows:
        if row.judged and row.files:
            sizes = tuple(stamp.size for stamp in row.files)
            key = sizes, row.td, row.tr, row.energy_td, row.record_end
            alike.setdefault(key, []).append(row)
    by_content: dict[tuple[bytes, ...], list[StudyRow]] = {}
    for group in alike.values():
        if len(group) > 1:
            for row in group:
                by_content.setdefault(_digest_files(row), []).append(row)
    return tuple(group for group in by_content.values() if len(group) > 1)


def _digest_files(row: StudyRow) -> tuple[bytes, ...]:
    """Return a digest of each file of a run, or of the file's name if the file can no longer be read."""
    digests = []
    for stamp in row.files:
        try:
            with Path(stamp.name).open("rb") as file:
                digests.append(hashlib.file_digest(file, "sha256").digest())
        except OSError:
            digests.append(os.fsencode(stamp.name))
    return tuple(digests)


def _warn_about_runs(rows: Sequence[StudyRow], common: Common) -> Iterator[Caution]:
    """Yield the warnings about single runs, and warnings about repeated, omitted and dissimilar runs."""
    judged = [row for row in rows if row.judged]
    yield from _warn_about_unusual_files(rows)
    if common.keeps_tolerance is False:
        text = f"tr = {common.tr:g} is admissible in all runs, but no tr is within the timing tolerance of every run"
        yield Caution(
            "timing-tolerance",
            f"{text}: in at least one run the error grows by more than 0.05",
        )
    yield from _warn_about_difference(
        "mixed-units",
        "the runs have different units of time, but td has only one",
        [row.time_unit for row in judged],
    )
    if in_other_unit := describe_other_unit(judged):
        yield Caution("mixed-units", in_other_unit)
    yield from _warn_about_difference(
        "mixed-bases",
        "the basis of the choice differs between the runs",
        [row.basis for row in judged],
    )
    yield from _warn_about_difference(
        "mixed-parts",
        "the runs were judged by the energies of different parts, so the common tr belongs to different switches",
        [_name_parts(row) for row in judged],
    )
    if difference := describe_other_model(judged):
        yield Caution("mixed-models", difference)
    for code in dict.fromkeys(code for row in judged for code in row.warnings):
        sources = [row.source for row in judged if code in row.warnings]
        yield Caution(
            code,
            f"in {len(sources)} of {format_number_of_runs(len(judged))}: {list_names(sources, most=NAMED)}",
        )


def describe_other_model(rows: Sequence[StudyRow]) -> str:
    """Return how the parts of a run differ from those of the first run with parts; empty if all have the same parts."""
    with_parts = [row for row in rows if row.parts_in_files]
    for row in with_parts[1:]:
        if difference := _compare_parts(with_parts[0], row):
            return f"the runs seem to belong to different models: {difference}; a study compares runs of one model"
    return ""


def _compare_parts(first: StudyRow, other: StudyRow) -> str:
    """Return the first part that only one of two runs has, or whose title differs; empty if there is none."""
    titles, titles_of_other = (
        dict(part.partition(" ")[::2] for part in row.parts_in_files)
        for row in (first, other)
    )
    for run, parts, others in (
        (first, titles, titles_of_other),
        (other, titles_of_other, titles),
    ):
        for id_, title in parts.items():
            if id_ not in others:
                named = f"{id_} {title!r}" if title else id_
                return f"of {first.source} and {other.source}, only {run.source} has part {named}"
    for id_, title in titles.items():
        if is_different_title(title, titles_of_other[id_]):
            return (
                f"part {id_} is {title!r} in {first.source} and {titles_of_other[id_]!r} in "
                f"{other.source}"
            )
    return ""


def _warn_about_unusual_files(rows: Sequence[StudyRow]) -> Iterator[Caution]:
    """Yield warnings about runs that were given twice, could not be judged, or end early."""
    repeated = find_repeated_runs(rows)
    if repeated:
        names = list_names([row.source for group in repeated for row in group], NAMED)
        judged_count = sum(row.judged for row in rows)
        different_count = judged_count - sum(len(group) - 1 for group in repeated)
        yield Caution(
            "repeated-runs",
            f"the same content was given more than once ({names}), so the study rests on {different_count} of "
            f"{format_number_of_runs(judged_count)}; give each run once",
        )
    left_out = [row.source for row in rows if not row.judged]
    if left_out and len(left_out) < len(rows):
        text = (
            f"{len(left_out)} of {format_number_of_runs(len(rows))} could not be judged"
        )
        first = next(row for row in rows if not row.judged)
        if len(left_out) == 1:
            which = f"is left out: {explain_left_out(first)}"
        else:
            which = f"are left out: {list_names(left_out, most=NAMED)}; the first: {explain_left_out(first)}"
        yield Caution("runs-left-out", f"{text} and {which}")
    cut = [
        f"{row.source} ({describe_end_of_record(row)})" for row in find_cut_runs(rows)
    ]
    if cut:
        count = f"{len(cut)} of {format_number_of_runs(len(rows))}"
        yield Caution(
            "cut-runs",
            f"{count} were cut, or end earlier than the others: {list_names(cut, most=NAMED)}",
        )


def explain_left_out(row: StudyRow) -> str:
    """Return why a run could not be judged, with the name of the run once."""
    message = row.message or row.status
    return message if row.source in message else f"{row.source}: {message}"


def _name_parts(row: StudyRow) -> str:
    """Return the parts by whose energy a run was judged, in words."""
    return "the whole model" if row.parts is None else name_units(row.parts)


def _warn_about_difference(
    code: str, sentence: str, kinds: Sequence[str | None]
) -> Iterator[Caution]:
    """Yield a warning if the runs have different ``kinds``, e.g. of units, with the number of runs of each kind."""
    counted = Counter(kind or "not named" for kind in kinds)
    if len(counted) > 1:
        counts = [
            f"{kind} in {format_number_of_runs(n)}" for kind, n in counted.most_common()
        ]
        yield Caution(code, f"{sentence}: {', '.join(counts)}")


def choose_common_tr(rows: Sequence[StudyRow]) -> Common:
    """Choose one tr for all judged runs: the median if the tr agree, otherwise the earliest tr that suits all runs.

    A tr suits all runs if it lies within the timing tolerance of every run. If no tr does, the result is the earliest
    tr that is acceptable in all runs and for which the largest error increase of any run is hardly larger than
    necessary. Unless the tr of the runs agree, the result is rounded to few digits, which costs at most 1/1000 of the
    rigid time.
    """
    judged = [row for row in rows if row.judged]
    if not judged:
        return Common(None, None, "no run could be judged")
    shared = find_common_windows([row.acceptable for row in judged])
    if not shared.size:
        return Common(None, None, _explain_why_no_common(judged))
    keeping = find_common_windows([row.alike for row in judged])
    low, high = keeping[0] if keeping.size else _find_least_loss(judged, shared)
    td = min(row.td for row in judged if row.td is not None)
    tr = _find_agreed_tr(judged, keeping)
    if tr is None:
        tr = find_fewest_digits(low, min(high, low + _ROUNDED * (td - low)))
    (window,) = shared[(shared[:, 0] <= tr) & (tr <= shared[:, 1])].tolist()
    errors = tuple(_find_error(row, tr) for row in rows)
    return Common(tr, tuple(window), None, bool(keeping.size), errors)


def _find_error(row: StudyRow, tr: float) -> float | None:
    """Return the error of a run at tr [-]; None if the run was not judged.

    At the run's own tr, it is the residual that ``suggest`` gives. Elsewhere it is interpolated.
    """
    if tr == row.tr and row.residual is not None:
        return row.residual
    return None if row.profile is None else interpolate_error(row.profile, tr)


def _find_agreed_tr(judged: Sequence[StudyRow], keeping: Samples) -> float | None:
    """Return the median tr, moved into the interval common to all runs; None if the runs do not agree."""
    tr_of_runs, low, high = _find_common_interval(judged)
    if len(tr_of_runs) < len(judged) or low > high:
        return None
    tr = float(np.clip(median(tr_of_runs), low, high))
    return tr if _is_in_windows(keeping, tr) else None


def _find_least_loss(
    judged: Sequence[StudyRow], shared: Samples
) -> tuple[float, float]:
    """Return the first interval of the shared windows in which a common tr loses least, within 0.02.

    The loss at a common tr is the largest increase of the error over all runs, compared with the own tr of each run.
    """
    profiles = [row.profile for row in judged if row.profile is not None]
    times = np.unique(
        np.concatenate([shared.ravel(), *(profile[0] for profile in profiles)])
    )
    begun = np.searchsorted(shared[:, 0], times, "right")
    ended = np.searchsorted(shared[:, 1], times)
    times = times[begun > ended]
    worst = np.full(times.size, -np.inf)
    for row, profile in zip(judged, profiles, strict=True):
        own_error = 0.0 if row.tr is None else interpolate_error(profile, row.tr)
        worst = np.maximum(worst, np.interp(times, *profile) - own_error)
    first = int(np.argmax(worst <= worst.min() + EQUALLY_GOOD))
    holder = shared[np.searchsorted(shared[:, 0], times[first], "right") - 1]
    following = times[min(first + 1, times.size - 1)]
    return float(times[first]), float(min(following, holder[1]))


def find_fewest_digits(low: float, high: float) -> float:
    """Return the number with the fewest digits from ``low`` to ``high``: 0, or the number nearest to the mean.

    Examples
    --------
    >>> find_fewest_digits(0.0128717, 0.0128989), find_fewest_digits(0.0, 0.00027)
    (0.01289, 0.0)
    """
    if low <= 0.0 <= high:
        return 0.0
    middle = (low + high) / 2
    rounded = (float(f"{middle:.{digits}g}") for digits in range(1, 18))
    return float(next((number for number in rounded if low <= number <= high), low))


def format_number_of_runs(number: int) -> str:
    """Return a number of runs in words, e.g. "1 run" or "2 runs"."""
    return "1 run" if number == 1 else f"{number} runs"


def _explain_why_no_common(judged: Sequence[StudyRow]) -> str:
    """Describe the tr that is acceptable in most runs, and name the runs in which it is not."""
    stretches, counts = count_coverage([row.acceptable for row in judged])
    if not counts.size:
        if len(judged) > 1:
            which = f"any of {format_number_of_runs(len(judged))}"
        else:
            which = "the run that was judged"
        return f"no tr is admissible in {which}"
    tr = find_fewest_digits(*stretches[np.argmax(counts)])
    unsuited = [row.source for row in judged if not _is_in_windows(row.acceptable, tr)]
    suited = len(judged) - len(unsuited)
    return (
        f"no tr is admissible in all of {format_number_of_runs(len(judged))}; tr = {tr:.6g} is in {suited}, "
        f"not in {list_names(unsuited, most=NAMED)}: {_explain_why_apart(judged, unsuited[0])}"
    )


def _explain_why_apart(judged: Sequence[StudyRow], unsuited: str) -> str:
    """Return why a run named ``unsuited`` shares no tr with all the others.

    Only this run is compared with the others, because comparing every two of many runs would take long.
    """
    without = [row.source for row in judged if not row.acceptable.size]
    if without:
        return f"no tr at all is admissible in {list_names(without, most=NAMED)}"
    if in_other_unit := describe_other_unit(judged):
        return in_other_unit
    apart = next(row for row in judged if row.source == unsuited)
    for row in judged:
        if not find_common_windows([apart.acceptable, row.acceptable]).size:
            return (
                f"tr is admissible in {_describe_intervals(apart)} and in {_describe_intervals(row)}: they do not "
                "overlap"
            )
    return f"the intervals of {unsuited} overlap those of each other run, but at different times"


def _describe_intervals(row: StudyRow) -> str:
    """Return the number and the extent of the intervals of admissible tr of a run, in words."""
    count = len(row.acceptable)
    intervals = "1 interval" if count == 1 else f"{count} intervals"
    first, last = format_distinctly((row.acceptable[0, 0], row.acceptable[-1, 1]))
    return f"{intervals} of {row.source} from {first} to {last}"


def _is_in_windows(windows: Samples, time: float) -> bool:
    """Return True if a time lies in one of the windows."""
    return bool(np.any((windows[:, 0] <= time) & (time <= windows[:, 1])))


def find_outliers(rows: Sequence[StudyRow]) -> tuple[StudyRow, ...]:
    """Return the outliers: first the judged runs without any tr, then the runs whose tr lies beyond Tukey's fences.

    The runs whose tr is farthest from the median come first.
    """
    without = [row for row in rows if row.judged and row.tr is None]
    chosen = [(row, row.tr) for row in rows if row.tr is not None]
    if not chosen:
        return tuple(without)
    low, middle, high = np.quantile(
        [tr for _, tr in chosen], [0.25, 0.5, 0.75]
    ).tolist()
    reach = _FENCE * (high - low)
    far = [
        (row, abs(tr - middle))
        for row, tr in chosen
        if not low - reach <= tr <= high + reach
    ]
    return (
        *without,
        *(
            row
            for row, _ in sorted(far, key=lambda run_and_distance: -run_and_distance[1])
        ),
    )
