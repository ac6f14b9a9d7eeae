"""Relations between answers: how a choice must follow a known change of its history.

A seed and a number define a history: a load, then a flight in which one or two modes vibrate, then a landing.  A
`Relation` writes it twice, unchanged and changed.  Both are read and asked for the same choice.  The second answer must
be the first one, moved and scaled as the change requires: exactly if the reader gets the same numbers, otherwise within
the stated ``+-`` of both.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import compress
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Final, NamedTuple

import h5py
import numpy as np

from d2rpick.api.runs import extract_columns, read as open_files
from d2rpick.choice.answers import suggest_in_run
from d2rpick.choice.pair.candidates import Candidate, judge_times
from d2rpick.choice.question import Settings, read_reference
from d2rpick.histories.history import Samples
from d2rpick.histories.names import Selection
from tests.made_binout import LsdaWriter
from tests.made_t01 import MadePart, write_head
from tests.text_files import make_glstat_text, make_matsum_text

_IDS: Final = (7, 3)  # part ids: the first part vibrates, the second is elsewhere
_ROUNDED: Final = (
    1e-9  # relative change of a time or residual that rounding causes in other units
)
_TEXTS: Final = {
    ",": ".",
    ";": ",",
    "\t": ".",
}  # separators of a table with their decimal signs


class MadeRun(NamedTuple):
    """Run: times (n,), internal and kinetic energy of the vibrating part, energy of another part, and td.

    ``states_per_period`` counts the states in a period of the energy of the fastest mode.
    """

    time: Samples
    internal: Samples
    kinetic: Samples
    other: Samples
    load_end: float
    landing: float
    td: float
    states_per_period: float


class Asked(NamedTuple):
    """Files of a run, and the choice that is requested for them."""

    names: list[str]
    td: float
    after: float
    landing: float | None = None
    parts: int | None = None


class Relation(NamedTuple):
    """Relation whose ``change`` writes a run twice into a folder.

    Times of the second answer are ``scale`` times those of the first, and later by ``shift`` record lengths.  If it is
    ``exact``, everything must be equal except for rounding.  If it ``may_lose`` information, the second history may be
    too coarse to choose from, or to choose on the same basis, and a tr before the first state that is left in the
    flight may give way to another tr of the first answer.  If the second history ``shows_other`` evidence than the
    first, equally good pairs may change places: states that are left out and the band of a second energy decide among
    them.  The second answer then either has the same tr, or a tr that is acceptable in the first history as well, with
    the residual of the tr chosen there within the stated ``+-`` of both.  The first history has at least
    ``fewest_states`` in a period of the energy of its fastest mode.
    """

    change: Callable[[MadeRun, Path, Random], tuple[Asked, Asked]]
    exact: bool = True
    scale: float = 1.0
    shift: float = 0.0
    may_lose: bool = False
    shows_other: bool = False
    fewest_states: float = 0.0


class Chosen(NamedTuple):
    """Values of an answer that are compared; None if unknown.

    ``listed`` are all tr of the answer; ``acceptable`` are those that it would recommend.  ``as_good`` are the tr,
    listed or requested, whose residual is that of the chosen one within the ``+-`` of both.
    """

    tr: float | None
    half_width: float
    residual: float | None
    residual_width: float
    grade: str
    basis: str
    as_good: tuple[float, ...] = ()
    listed: tuple[float, ...] = ()
    acceptable: tuple[float, ...] = ()


def is_among(tr: float, others: Sequence[float], room: float) -> bool:
    """Return True if one of the ``others`` lies within ``room`` of tr [time]."""
    return any(abs(tr - other) <= room for other in others)


def make_run(random: Random, fewest_states: float = 0.0) -> MadeRun:
    """Draw runs until one has at least ``fewest_states`` in a period of the energy of its fastest mode."""
    run = _draw_run(random)
    while run.states_per_period < fewest_states:
        run = _draw_run(random)
    return run


def _draw_run(random: Random) -> MadeRun:
    """Draw a run with random vibration, load and sampling; the energy has two periods per vibration period."""
    mode_count = random.choice((1, 1, 2))
    period = 10 ** random.uniform(-3, 0)
    flight = random.uniform(3, 8) * period
    load = random.uniform(0.5, 3) * period
    step = period / random.choice((20, 30, 50, 80))
    states = math.ceil((load + 1.3 * flight) / step)
    time: Samples = np.linspace(0.0, step * (states - 1), states)
    energy = 10 ** random.uniform(-2, 6)
    damping = random.uniform(0.0, 0.6) / flight
    internal, kinetic = np.zeros_like(time), np.zeros_like(time)
    fastest = 0.0
    for mode in range(mode_count):
        size = energy * (1.0 if mode == 0 else random.uniform(0.02, 0.3))
        phase = random.uniform(0, 2 * math.pi)
        rate = 2 * math.pi / period * (1.0 if mode == 0 else random.uniform(1.3, 3.5))
        fastest = max(fastest, rate)
        angle = rate * (time - load) + phase
        envelope = size * np.exp(-damping * np.maximum(time - load, 0.0))
        internal += envelope * np.sin(angle) ** 2
        kinetic += envelope * np.cos(angle) ** 2
    loaded = np.clip(time / load, 0.0, 1.0)
    landing = load + flight
    pushed = energy * 3 * np.maximum(time - landing, 0.0) / flight
    internal = internal * np.sin(math.pi / 2 * loaded) ** 2 + pushed
    second_energy = energy * 0.2 * np.sin(math.pi / 2 * loaded) ** 2
    return MadeRun(
        time,
        internal,
        kinetic,
        second_energy,
        load,
        landing,
        load + random.uniform(0.5, 0.95) * flight,
        math.pi / (fastest * step),
    )


# Writers of a run.


def write_csv(
    folder: Path,
    columns: Mapping[str, Samples],
    name: str = "run.csv",
    separator: str = ",",
) -> list[str]:
    """Write columns with all digits; return the file names."""
    rows = (
        separator.join(map(repr, row))
        for row in zip(*(column.tolist() for column in columns.values()), strict=True)
    )
    text = "\n".join([separator.join(columns), *rows, ""])
    file = folder / name
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(
        text if _TEXTS[separator] == "." else text.replace(".", _TEXTS[separator])
    )
    return [str(file)]


def list_columns(run: MadeRun) -> dict[str, Samples]:
    return {"time": run.time, "internal_energy": run.internal}


def write_hdf5(folder: Path, columns: Mapping[str, Samples]) -> list[str]:
    with h5py.File(folder / "run.h5", "w") as file:
        for name, column in columns.items():
            file[name] = column
    return [str(folder / "run.h5")]


def put(folder: Path, name: str, content: bytes) -> list[str]:
    (folder / name).write_bytes(content)
    return [str(folder / name)]


def make_question(run: MadeRun, names: list[str], *, parts: int | None = None) -> Asked:
    return Asked(names, run.td, run.load_end, run.landing, parts)


def round_run(run: MadeRun, digits: int) -> MadeRun:
    """Return a run as a text with this number of digits stores it."""

    def printed(column: Samples) -> Samples:
        return np.array([float(f"{value:.{digits - 1}E}") for value in column])

    return run._replace(
        time=printed(run.time), internal=printed(run.internal), other=printed(run.other)
    )


def store_in_single_precision(run: MadeRun) -> MadeRun:
    """Return a run as a file in single precision stores it."""

    def stored(column: Samples) -> Samples:
        return column.astype(np.float32).astype(float)

    return run._replace(
        time=stored(run.time), internal=stored(run.internal), other=stored(run.other)
    )


def write_binout(folder: Path, run: MadeRun) -> list[str]:
    """Write the energies of two parts as LS-DYNA does in a binout in single precision; return the file names."""
    writer = LsdaWriter()
    writer.cd("/matsum/metadata")
    writer.put("ids", _IDS, "i4")
    for state, time in enumerate(run.time):
        writer.cd(f"/matsum/d{state + 1:06d}")
        writer.put("time", [time], "f4")
        writer.put("internal_energy", [run.internal[state], run.other[state]], "f4")
    writer.table()
    return put(folder, "binout", bytes(writer.data))


def write_time_history(folder: Path, run: MadeRun) -> list[str]:
    """Write the energies of two parts as Radioss does; return the file names."""
    parts = [MadePart(id_, f"part {id_}", (1,)) for id_ in _IDS]
    writer = write_head(parts, globals_=2)
    for time, internal, second_energy in zip(
        run.time, run.internal, run.other, strict=True
    ):
        writer.state(time, [internal + second_energy, 0.0], [internal, second_energy])
    return put(folder, "runT01", bytes(writer.data))


def write_matsum(
    folder: Path, run: MadeRun, ids: Sequence[int] = _IDS, name: str = "matsum"
) -> list[str]:
    energies = dict(zip(_IDS, (run.internal, run.other), strict=True))
    return put(
        folder,
        name,
        make_matsum_text(
            run.time, ids, np.stack([energies[id_] for id_ in ids], axis=1)
        ),
    )


# Changes that must not change the answer, or must change it in a known way.


def same_numbers(
    write: Callable[[Path, MadeRun], list[str]],
    as_stored: Callable[[MadeRun], MadeRun],
    parts: int | None = None,
) -> Callable[[MadeRun, Path, Random], tuple[Asked, Asked]]:
    """Return a change that writes a table and another format with the same numbers."""

    def change(run: MadeRun, folder: Path, _: Random) -> tuple[Asked, Asked]:
        table = write_csv(folder, list_columns(as_stored(run)))
        return make_question(run, table), make_question(
            run, write(folder, run), parts=parts
        )

    return change


def in_single_precision(run: MadeRun, folder: Path, _: Random) -> tuple[Asked, Asked]:
    return make_question(run, write_csv(folder, list_columns(run))), make_question(
        run,
        write_csv(folder, list_columns(store_in_single_precision(run)), "single.csv"),
    )


def other_order_of_parts(run: MadeRun, folder: Path, _: Random) -> tuple[Asked, Asked]:
    turned = write_matsum(folder, run, _IDS[::-1], "matsum_turned")
    return make_question(run, write_matsum(folder, run), parts=_IDS[0]), make_question(
        run, turned, parts=_IDS[0]
    )


def further_columns(run: MadeRun, folder: Path, random: Random) -> tuple[Asked, Asked]:
    extra_columns = {
        "pressure": np.array([random.gauss(0, 1) for _ in run.time]),
        **list_columns(run),
        "status": run.other,
    }
    in_front = {"time": run.time, **extra_columns}
    return make_question(run, write_csv(folder, list_columns(run))), make_question(
        run, write_csv(folder, in_front, "more.csv")
    )


def kinetic_energy_too(run: MadeRun, folder: Path, _: Random) -> tuple[Asked, Asked]:
    extra_columns = {**list_columns(run), "kinetic_energy": run.kinetic}
    return make_question(run, write_csv(folder, list_columns(run))), make_question(
        run, write_csv(folder, extra_columns, "more.csv")
    )


def scaled(
    time: float, energy: float, shift: float = 0.0
) -> Callable[[MadeRun, Path, Random], tuple[Asked, Asked]]:
    """Return a change of the units of time and energy, and of the time origin by ``shift`` record lengths."""

    def change(run: MadeRun, folder: Path, _: Random) -> tuple[Asked, Asked]:
        later = shift * float(run.time[-1])
        columns = {
            "time": time * run.time + later,
            "internal_energy": energy * run.internal,
        }
        again = Asked(
            write_csv(folder, columns, "other.csv"), time * run.td + later, time * run.load_end + later,
            time * run.landing + later,
        )  # fmt: skip
        return make_question(run, write_csv(folder, list_columns(run))), again

    return change


def doubled_last_state(run: MadeRun, folder: Path, _: Random) -> tuple[Asked, Asked]:
    doubled = {
        name: np.append(column, column[-1])
        for name, column in list_columns(run).items()
    }
    return make_question(run, write_csv(folder, list_columns(run))), make_question(
        run, write_csv(folder, doubled, "doubled.csv")
    )


def cut_after_the_landing(
    run: MadeRun, folder: Path, random: Random
) -> tuple[Asked, Asked]:
    end = np.searchsorted(run.time, run.landing) + random.randrange(1, 6)
    cut = {name: column[:end] for name, column in list_columns(run).items()}
    return make_question(run, write_csv(folder, list_columns(run))), make_question(
        run, write_csv(folder, cut, "cut.csv")
    )


def legs_in_another_order(
    run: MadeRun, folder: Path, random: Random
) -> tuple[Asked, Asked]:
    cuts = sorted(random.sample(range(5, len(run.time) - 5), 2))
    names = []
    for number, (begin, end) in enumerate(
        zip([0, *cuts], [*cuts, len(run.time)], strict=True)
    ):
        leg = {
            name: column[max(begin - 2, 0) : end]
            for name, column in list_columns(run).items()
        }
        names += write_csv(folder, leg, f"leg{number}.csv")
    turned = random.sample(names, len(names))
    return make_question(run, names), make_question(run, turned)


def every_second_state(run: MadeRun, folder: Path, _: Random) -> tuple[Asked, Asked]:
    thinned = {name: column[::2] for name, column in list_columns(run).items()}
    return make_question(run, write_csv(folder, list_columns(run))), make_question(
        run, write_csv(folder, thinned, "thinned.csv")
    )


def other_names(run: MadeRun, folder: Path, random: Random) -> tuple[Asked, Asked]:
    name = random.choice(
        (
            "a b/glstat.csv",
            "Läufe/T01",
            "--td/1.csv",
            "x" * 200,
            "=cmd/matsum.txt",
            ".hidden",
        )
    )
    return make_question(run, write_csv(folder, list_columns(run))), make_question(
        run, write_csv(folder, list_columns(run), name)
    )


def other_signs(run: MadeRun, folder: Path, random: Random) -> tuple[Asked, Asked]:
    other_file = write_csv(
        folder, list_columns(run), "other.txt", random.choice((";", "\t"))
    )
    return make_question(run, write_csv(folder, list_columns(run))), make_question(
        run, other_file
    )


def extracted_table(run: MadeRun, folder: Path, _: Random) -> tuple[Asked, Asked]:
    names = write_matsum(folder, run)
    table, _notes = extract_columns(
        open_files(names).files, Selection(parts=(str(_IDS[0]),))
    )
    columns = {name: table[name] for name in ("time", "internal_energy")}
    return make_question(run, names, parts=_IDS[0]), make_question(
        run, write_csv(folder, columns)
    )


RELATIONS: Final[Mapping[str, Relation]] = {
    "hdf5": Relation(
        same_numbers(
            lambda folder, run: write_hdf5(folder, list_columns(run)), lambda run: run
        )
    ),
    "glstat": Relation(
        same_numbers(
            lambda folder, run: put(
                folder, "glstat", make_glstat_text(run.time, run.internal)
            ),
            lambda run: round_run(run, 6),
        ),
        exact=False,
    ),
    "matsum": Relation(
        same_numbers(write_matsum, lambda run: round_run(run, 5), _IDS[0]), exact=False
    ),
    "binout": Relation(
        same_numbers(write_binout, store_in_single_precision, _IDS[0]), exact=False
    ),
    "radioss-th": Relation(
        same_numbers(write_time_history, store_in_single_precision, _IDS[0]),
        exact=False,
    ),
    "single precision": Relation(in_single_precision, exact=False),
    "order of parts": Relation(other_order_of_parts),
    "further columns": Relation(further_columns),
    "kinetic energy too": Relation(kinetic_energy_too, exact=False, shows_other=True),
    "time later": Relation(scaled(1.0, 1.0, shift=1.0), exact=False, shift=1.0),
    "time in ms": Relation(scaled(1e3, 1.0), exact=False, scale=1e3),
    "time times 64": Relation(scaled(64.0, 1.0), scale=64.0),
    "energy in mJ": Relation(scaled(1.0, 1e3), exact=False),
    "energy over 1024": Relation(scaled(1.0, 2.0**-10)),
    "extracted table": Relation(extracted_table, exact=False),
    "doubled last state": Relation(doubled_last_state),
    "cut after the landing": Relation(cut_after_the_landing),
    "order of legs": Relation(legs_in_another_order),
    # With fewer than two states per period (the sampling theorem), a record is that of another, slower vibration.
    "every second state": Relation(
        every_second_state,
        exact=False,
        may_lose=True,
        shows_other=True,
        fewest_states=4.0,
    ),
    "other names": Relation(other_names),
    "other signs": Relation(other_signs),
}


def choose(question: Asked, requested: Sequence[float] = ()) -> Chosen:
    """Read the files and choose tr; the ``requested`` tr are compared with it if they are acceptable."""
    parts = () if question.parts is None else (str(question.parts),)
    settings = Settings(after=question.after, landing=question.landing, margin=0.0)
    answer = suggest_in_run(
        read_reference(question.names, Selection(parts=parts)),
        question.td,
        settings,
        with_better=False,
    )
    best = answer.chosen
    grade = answer.quality.grade if answer.quality else ""
    if best is None:
        return Chosen(None, 0.0, None, 0.0, grade, answer.basis)
    half_width = (
        (best.tr_high - best.tr_low) / 2
        if best.tr_low is not None and best.tr_high is not None
        else 0.0
    )
    judged = judge_times(answer.situation, list(requested))
    as_good = tuple(
        candidate.tr
        for candidate in (*answer.candidates, *compress(judged, judged.recommendable))
        if candidate.residual is not None
        and best.residual is not None
        and abs(candidate.residual - best.residual)
        <= get_residual_width(candidate) + get_residual_width(best)
    )
    return Chosen(
        best.tr,
        half_width,
        best.residual,
        get_residual_width(best),
        grade,
        answer.basis,
        as_good,
        tuple(candidate.tr for candidate in answer.candidates),
        tuple(candidate.tr for candidate in answer.candidates if candidate.acceptable),
    )


def get_residual_width(candidate: Candidate) -> float:
    """Return by how much the residual may exceed its stated value."""
    return max((candidate.residual_high or 0.0) - (candidate.residual or 0.0), 0.0)


def find_difference(
    relation: Relation, run: MadeRun, first: Chosen, second: Chosen
) -> str:
    """Describe how the second answer breaks the relation; empty if it does not."""
    if relation.may_lose and (second.tr is None or second.basis != first.basis):
        return ""
    if (first.tr is None) != (second.tr is None):
        return f"tr {first.tr} became {second.tr}"
    if first.tr is not None and second.tr is not None:
        span = relation.scale * float(run.time[-1])
        moved = relation.scale * first.tr + relation.shift * float(run.time[-1])
        stated = (
            0.0
            if relation.exact
            else relation.scale * first.half_width + second.half_width
        )
        room = stated + _ROUNDED * span
        is_kept = is_among(moved, second.acceptable, room)
        if _has_lost_first_state(relation, run, first) and not is_kept:
            is_known = is_among(second.tr, first.listed, room)
            return "" if is_known else f"tr {second.tr:.9g} is new"
        is_alike = relation.shows_other and is_among(second.tr, first.as_good, room)
        if abs(second.tr - moved) > room and not is_alike:
            return f"tr {moved:.9g} became {second.tr:.9g}, stated to {stated:.2g}"
    if first.residual is not None and second.residual is not None:
        stated = 0.0 if relation.exact else first.residual_width + second.residual_width
        if abs(second.residual - first.residual) > stated + 1e-6:
            return f"residual {first.residual:.6g} became {second.residual:.6g}, stated to {stated:.2g}"
    if relation.exact and (first.grade, first.basis) != (second.grade, second.basis):
        return f"{first.grade} by {first.basis} became {second.grade} by {second.basis}"
    return ""


def _has_lost_first_state(relation: Relation, run: MadeRun, first: Chosen) -> bool:
    """Return True if tr is so close to the end of the load that every state before it must be kept in the flight."""
    if not relation.may_lose or first.tr is None:
        return False
    return first.tr - run.load_end < 2 * float(run.time[1] - run.time[0])


def check_relation(name: str, random: Random) -> bool:
    """Check a relation for one history; return True if a tr was chosen.

    Raises AssertionError if the second answer does not follow.
    """
    relation = RELATIONS[name]
    run = make_run(random, relation.fewest_states)
    with TemporaryDirectory() as folder:
        questions = relation.change(run, Path(folder), random)
        first, second = map(choose, questions)
        fault = find_difference(relation, run, first, second)
        if fault and relation.shows_other and second.tr is not None:
            # An answer lists only minima of the error, but other tr may be as good.
            first = choose(questions[0], [second.tr])
            fault = find_difference(relation, run, first, second)
    assert not fault, fault
    return first.tr is not None and second.tr is not None
