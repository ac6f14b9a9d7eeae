"""Questions of `deciding_numbers`: frozen answers, random records, and commands for the sample files.

Together they rest on energies, momenta, contact forces, health, parts, limits, finished switched runs and many runs.
"""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
from click.testing import CliRunner

import d2rpick
from d2rpick.choice.question import Settings
from d2rpick.choice.td.flights import find_flights
from d2rpick.cli import d2rpick as d2rpick_command
from d2rpick.histories.history import History
from tests.benchmarks import falls, flights, promise_parts
from tests.benchmarks.promise import CLASSES, write_record
from tests.choice import test_same_answers
from tests.command import ROOT
from tests.written_runs import FALL_WRITERS, as_matsum

# Answer to a question: a JSON value with rounded numbers.
Answer = Any
Question = Callable[[], Answer]

# Decimals to which residuals are compared, and digits to which times are compared.
_DECIMALS, _DIGITS = 3, 5
# Significant digits and decimals to which numbers in a JSON document are compared.
_JSON_DIGITS, _JSON_DECIMALS = 4, 6
# Keys of a JSON document that repeat the question or the program.
_REPEATED: Final = {"command", "version", "settings", "arguments", "seconds"}
# States of a fall.
_STATES = 300

# Command lines for the sample data; {data} is the folder of the computed runs of the tests.
_COMMANDS: Final = """
info sample_data/rollover_box.matsum
info sample_data/rolloverT01.gz
info sample_data/energy.glstat
info {data}/carT01.gz
info {data}/drop2T01.gz
suggest --td 0.37 --part box sample_data/rollover_box.binout
suggest --part box sample_data/rollover_box.matsum
suggest --td 0.37 --part box --no-verify sample_data/rollover_box.matsum
suggest --td 0.37 --part box --margin 0.02 sample_data/rollover_box.matsum
suggest --td 0.37 --part box --landing 0.36 --after 0.12 sample_data/rollover_box.matsum
suggest --td 0.37 --part box --tolerance 0.02 sample_data/rollover_box.matsum
suggest --td 0.37 --part box --max-residual 0.1 --max-kinetic-share 0.2 sample_data/rollover_box.matsum
suggest --td 0.064 --max-residual 0.2 sample_data/energy.csv
suggest --td-window 0.06 0.09 --max-kinetic-share 0.05 sample_data/energy.csv
suggest --td 0.3 --part box --strict sample_data/rolloverT01.gz
suggest --part box sample_data/rolloverT01.gz
suggest --deck sample_data/rollover_box.k --part box sample_data/rollover_box.matsum
suggest --part flying {data}/carT01.gz
suggest --td 0.12 --part flying {data}/carT01.gz
suggest --part flying --keep-vibration {data}/carT01.gz
suggest --part flying {data}/drop2T01.gz
suggest --td 0.04 --part flying {data}/drop2T01.gz
suggest --part spring1,spring2 {data}/chain_referenceT01.gz
suggest {data}/oscillator_referenceT01.gz
suggest --energy IE_spring1_J {data}/load_L3_ref.csv.gz
verify --tr 0.1 --td 0.37 --part box sample_data/rollover_box.matsum
verify --tr 0.1 --td 0.37 --part box sample_data/rolloverT01.gz
verify --tr 0.0136 --td 0.0688 sample_data/energy.csv
verify --tr 0.0496 --td 0.1464 --part flying {data}/carT01.gz
verify --part box sample_data/rolloverT01.gz --switched {data}/rollover_r100_T01.gz \
    --switched {data}/rollover_r100_T02.gz --switched {data}/rollover_r100_T03.gz
verify --energy boxIE_J sample_data/rollover.csv --switched {data}/rollover_r20.csv.gz
verify --tr 0.0135867 --td 0.0687534 --energy IE_J {data}/oscillator_ref.csv.gz \
    --switched {data}/oscillator_d2r_13p587_68p753.csv.gz
verify --tr 0.006 --td 0.08 --energy IE_J {data}/oscillator_ref.csv.gz --switched {data}/oscillator_d2r_6_80.csv.gz
verify --part flying {data}/carT01.gz --switched {data}/car_all_T01.gz --switched {data}/car_all_T02.gz \
    --switched {data}/car_all_T03.gz
plan sample_data/energy.csv
plan --part box sample_data/rollover_box.matsum
plan --part box --min-rigid 0.01 sample_data/rollover_box.matsum
plan --part flying {data}/carT01.gz
plan --part flying {data}/drop2T01.gz
plan --deck sample_data/rollover_box.k --part box sample_data/rollover_box.matsum
explore --td 0.064 --steps 20 sample_data/energy.csv
explore --part box --steps 20 sample_data/rollover_box.matsum
parts sample_data/rollover_box.matsum
parts --deck sample_data/rollover_box.k sample_data/rollover_box.matsum
parts sample_data/rolloverT01.gz
parts {data}/carT01.gz
parts {data}/drop2T01.gz
parts {data}/chain_referenceT01.gz
study --jobs 1 --td 0.064 sample_data/energy.csv sample_data/energy.glstat sample_data/oscillator_solver.csv
study --jobs 1 --part box sample_data/rollover_box.matsum sample_data/rolloverT01.gz
check sample_data/switching.k --history sample_data/energy.glstat
"""


def make_questions(records: int, seed: int, folder: Path) -> dict[str, Question]:
    """Make all questions, with this number of records of each class; records are written into the folder."""
    questions: dict[str, Question] = {}
    for name, td, settings, _ in test_same_answers.FROZEN:
        questions[f"{name}, td {td}, {settings}"] = partial(
            _answer_frozen_question, name, td, settings
        )
    for command in _COMMANDS.replace("\\\n", " ").strip().splitlines():
        questions[command] = partial(_answer_command, command)
    questions |= _make_energy_questions(records, seed, folder)
    questions |= _make_fall_questions(records, seed, folder)
    questions |= _make_flight_questions(records, seed)
    questions |= _make_part_questions(records, seed)
    return questions


def _make_energy_questions(
    records: int, seed: int, folder: Path
) -> dict[str, Question]:
    """Make questions about random energies, of each class of `promise`."""
    questions: dict[str, Question] = {}
    for kind, (name, make) in enumerate(CLASSES.items()):
        for number in range(records):
            record = make(np.random.default_rng([seed, number]))
            question_folder = folder / f"energy {kind} {number}"
            question_folder.mkdir()
            path = write_record(record, question_folder)
            questions[f"{name}, record {number}"] = partial(
                _answer_record_question, str(path), record.read, record.suggest
            )
    return questions


def _make_fall_questions(records: int, seed: int, folder: Path) -> dict[str, Question]:
    """Make a plan for each fall, written with momenta in the formats of `falls` and as a matsum."""
    questions: dict[str, Question] = {}
    random = np.random.default_rng([seed, 48])
    writers = FALL_WRITERS | {"matsum": lambda fall, place, **_: as_matsum(fall, place)}
    for number, fall in enumerate(falls.integrate_falls(random, 2 * records, _STATES)):
        for form, write in writers.items():
            question_folder = folder / f"fall {form} {number}"
            question_folder.mkdir()
            path = write(fall.run, question_folder, kinetic=number % 2 == 0)
            questions[f"fall {number}, {form}"] = partial(
                _answer_command, f"plan {shlex.quote(path)}"
            )
    return questions


def _make_flight_questions(records: int, seed: int) -> dict[str, Question]:
    """Ask for the flights of random chains under each load of `flights`."""
    questions: dict[str, Question] = {}
    for kind, (name, load) in enumerate(flights.CLASSES.items()):
        random = np.random.default_rng([seed, kind])
        chains = flights.compute_runs(
            random,
            2 * records,
            load(random, 2 * records),
            falling=name != "friction",
        )
        for number, chain in enumerate(chains):
            for form in flights.FORMS:
                questions[f"{name} {number}, {form}"] = partial(
                    _answer_flight_question, flights.make_history(chain, form)
                )
    return questions


def _make_part_questions(records: int, seed: int) -> dict[str, Question]:
    """Ask for pairs of several parts, of each class of `promise_parts`."""
    return {
        f"{kind}, record {number}": partial(_answer_part_question, record)
        for kind in promise_parts.CLASSES
        for number, record in enumerate(
            promise_parts.draw_records(kind, seed, 2 * records)
        )
    }


def _answer_frozen_question(
    name: str, td: float | tuple[float, float], settings: Mapping[str, float | bool]
) -> Answer:
    suggestion = test_same_answers.suggest_for(name, td, **settings)
    return test_same_answers.summarize(suggestion)._asdict()


def _answer_record_question(
    path: str, reading: Mapping[str, Any], options: Mapping[str, Any]
) -> Answer:
    answer = d2rpick.suggest(d2rpick.read(path, **reading), **options).to_dict()
    pair = answer["recommended"] or {}
    rows = [row for row in answer["candidates"] if row["recommended"]]
    best: Mapping[str, Any] = rows[0] if rows else {}
    return {
        "quality": answer["quality"],
        "basis": answer["basis"],
        "tr": _round_time(pair.get("tr")),
        "td": _round_time(pair.get("td")),
        "residual": _round_size(best.get("residual")),
        "residual_low": _round_size(best.get("residual_low")),
        "residual_high": _round_size(best.get("residual_high")),
    }


def _answer_part_question(record: promise_parts.PartsRecord) -> Answer:
    pair = promise_parts.recommend_pair(record)
    if pair is None:
        return "no pair"
    return {
        "quality": pair.grade,
        "basis": pair.basis,
        "tr": _round_time(pair.tr),
        "td": _round_time(pair.td),
        "residual": _round_size(pair.residual),
        "residual_low": _round_size(pair.low),
        "residual_high": _round_size(pair.high),
    }


def _answer_flight_question(history: History) -> Answer:
    return [
        {
            "start": _round_time(flight.start),
            "end": _round_time(flight.end),
            "unknown_load": flight.unknown_load,
            "source": flight.source,
        }
        for flight in find_flights(history, Settings(replay=False))
    ]


def _answer_command(command: str) -> Answer:
    """Return the JSON document of a command line with rounded numbers, or its error."""
    words = shlex.split(command.format(data=ROOT / "tests" / "data"))
    words = [str(ROOT / word) if word.startswith("sample_") else word for word in words]
    result = CliRunner().invoke(d2rpick_command, [*words, "-q", "-f", "json"])
    if result.exit_code not in (0, 1):
        return re.sub(r"[\d.]+", "#", result.output)
    return _round_document(json.loads(result.stdout))


def _round_document(value: object) -> object:
    """Return a JSON value with rounded numbers, and without the numbers in sentences."""
    if isinstance(value, dict):
        return {
            key: _round_document(inner)
            for key, inner in value.items()
            if key not in _REPEATED
        }
    if isinstance(value, list):
        return [_round_document(inner) for inner in value]
    if isinstance(value, float):
        return float(f"{round(value, _JSON_DECIMALS):.{_JSON_DIGITS}g}")
    if isinstance(value, str):
        return re.sub(r"\d[\d.e+-]*", "#", value)
    return value


def _round_time(time: float | None) -> str | None:
    return None if time is None else f"{time:.{_DIGITS}g}"


def _round_size(size: float | None) -> float | None:
    return None if size is None else round(size, _DECIMALS)
