"""Feed damaged inputs of all formats to the readers: ``python -m tests.campaign --inputs 1000000 --seed 1``.

Each input depends only on the seed and its number.  For any damage a reader must either return numbers that are in the
file or raise a d2rpick error of one line; a settings file with any value is used or refused with one line.  Anything
else is a fault, including a warning and the death of the process.  The campaign prints counts for each format; the exit
code is 1 if there is a fault.  ``--only FORMAT NUMBER`` repeats one input.

``--relations`` compares answers instead: it changes a history in a way that must not change the answer, or must change
it in a known way (`tests.relations`).  An answer that does not follow is a fault.
"""

import argparse
import re
import sys
import warnings
from collections import Counter
from collections.abc import Callable
from contextlib import chdir
from functools import cache, partial
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Final

from d2rpick.base.errors import D2RPickError
from d2rpick.base.workers import choose_farm, count_cores
from d2rpick.cli import COMMANDS
from d2rpick.deck.reader import read_deck
from d2rpick.histories.formats import csv_table, hdf5_file
from d2rpick.histories.formats.d3plot import open_legs
from d2rpick.histories.history import History
from d2rpick.histories.opening import Selection, Source, open_run
from tests.cli.test_settings_files import ask_with_settings, list_options
from tests.command import DECK
from tests.damaged_files import FILES
from tests.faults import Fault, damage
from tests.hdf5_files import plain, write_hdf5
from tests.histories.formats import test_curves, test_faults_text
from tests.made_d3plot import D3plotWriter, make_states
from tests.reading import list_states, open_contents
from tests.relations import RELATIONS, check_relation

_CHUNK: Final = 200  # inputs per task
_FEW: Final = 20  # histories per task of a relation; each is read and judged twice
_SHOWN: Final = 5  # faults that are printed per format
_KINDS: Final = ("flip", "cut", "drop", "double", "swap", "insert", "blank")
_LIKELY: Final = b"\n 0123456789.,;E+-*eND\"'\x00\x1b\xff"
_NUMBER: Final = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][+-]?\d+)?")
_D3PLOT_STATES: Final = make_states([0.125 * state for state in range(6)], walls=1)
_CSV: Final = b"time,internal_energy,kinetic_energy\n" + b"".join(
    b"%.3f,%.5e,%.4f\n" % (state / 8, state**3 - 10, state) for state in range(40)
)


def draw_faults(random: Random) -> list[Fault]:
    """Draw one to three faults at random places in a file."""
    return [
        (
            random.choice(_KINDS),
            random.random(),
            random.random(),
            random.choice([random.randrange(256), *_LIKELY]),
        )
        for _ in range(random.randint(1, 3))
    ]


def glstat(random: Random) -> bool:
    """Damage a glstat; return True if it could be read."""
    return test_faults_text.check_glstat(draw_faults(random))


def matsum(random: Random) -> bool:
    """Damage a matsum with three or four lines for each part; return True if it could be read."""
    return test_faults_text.check_matsum(draw_faults(random), random.choice((3, 4)))


def binout(random: Random) -> bool:
    """Damage the structure of a binout, or lose, duplicate and move its records; return True if it could be read."""
    return restructured(random, "binout", "long binout")


def time_history(random: Random) -> bool:
    """Damage a T01 in the same way as a binout; return True if it could be read."""
    return restructured(random, "T01", "T01 as text")


def restructured(random: Random, *names: str) -> bool:
    """Damage the structure of one of the files with these names; return True if it could be read."""
    file = FILES[random.choice(names)]
    return bool(file.true(file.restructured(random)))


def csv(random: Random) -> bool:
    """Damage a table; return True if it could be read. Each state that is read must be in one line of the table."""
    return _table(damage(_CSV, draw_faults(random), []))


def curves(random: Random) -> bool:
    """Damage a file of curves; return True if it could be read."""
    text = random.choice((test_curves.CURVEPLOT, test_curves.T_HIS)).encode()
    return _table(damage(text, draw_faults(random), []))


def hdf5(random: Random) -> bool:
    """Damage an HDF5 file; return True if it could be read. Its numbers are not marked, so they are not checked."""
    data = damage(_hdf5(), draw_faults(random), [])
    return bool(_read(lambda: open_contents(hdf5_file, data).history(Selection())))


def d3plot(random: Random) -> bool:
    """Damage a d3plot of one or two files; return True if it could be read. Only the number of states is checked."""
    contents = [
        _d3plot().together(_D3PLOT_STATES[:3]),
        _d3plot().file(_D3PLOT_STATES[3:]),
    ]
    file_number = random.randrange(2)
    contents[file_number] = damage(contents[file_number], draw_faults(random), [])
    sources = [
        Source(name, data)
        for name, data in zip(("d3plot", "d3plot01"), contents, strict=True)
        if data
    ]
    return bool(
        _read(
            lambda: [
                leg.part_channel("internal_energy", ())
                for leg in open_legs(sources, Selection())
            ]
        )
    )


def deck(random: Random) -> bool:
    """Damage a deck; return True if it could be read."""
    with TemporaryDirectory() as folder:
        file = Path(folder, "deck.k")
        file.write_bytes(damage(Path(DECK).read_bytes(), draw_faults(random), []))
        return bool(_read(lambda: list(read_deck(str(file)).cards)))


def companions(random: Random) -> bool:
    """Damage one or both of a glstat and the matsum of the same run; return True if they could be read."""
    with TemporaryDirectory() as folder:
        contents = {
            "glstat": test_faults_text.GLSTAT,
            "matsum": test_faults_text.MATSUM[4],
        }
        for name in random.choice((("glstat",), ("matsum",), ("glstat", "matsum"))):
            contents[name] = damage(contents[name], draw_faults(random), [])
        for name, content in contents.items():
            Path(folder, name).write_bytes(content)
        parts = random.choice(((), ("12",), ("1", "12", "13")))
        selection = Selection(parts=parts)
        return bool(_read(lambda: open_run([folder], selection).history(selection)))


def settings(random: Random) -> bool:
    """Give a setting a value of any TOML type; return True if it was accepted."""
    command = random.choice([*COMMANDS])
    key = random.choice(list_options(command))
    value = draw_toml_value(random, depth=2)
    table = random.choice((f"[{command}]\n", ""))
    with TemporaryDirectory() as folder, chdir(folder):
        return not ask_with_settings(command, f'{table}"{key}" = {value}\n')


def draw_toml_value(random: Random, depth: int) -> str:
    """Draw a value of any TOML type, with arrays and tables up to this ``depth``."""
    kind = random.choice(("text", "whole", "real", "time", "word", "array", "table"))
    if kind in ("array", "table") and depth:
        inner = [draw_toml_value(random, depth - 1) for _ in range(random.randrange(4))]
        if kind == "array":
            return f"[{', '.join(inner)}]"
        return f"{{{', '.join(f'k{row} = {item}' for row, item in enumerate(inner))}}}"
    if kind == "text":
        codes = [random.choice((random.randrange(128), 0x20AC, 0x1F4A9)) for _ in "123"]
        return '"' + "".join(f"\\U{code:08x}" for code in codes) + '"'
    if kind == "real":
        return random.choice(("inf", "-inf", "nan", repr(random.gauss(0, 1) * 1e6)))
    if kind == "time":
        return random.choice(("1979-05-27", "07:32:00.5", "1979-05-27T07:32:00+02:00"))
    if kind == "word":
        return random.choice(("true", "false", "'auto'", "'csv'", "'0.1 0.2'", "'3,7'"))
    return str(random.choice((0, 1, -1, 2**63, 10**400, random.randrange(1000))))


INPUTS: Final[dict[str, Callable[[Random], bool]]] = {
    "glstat": glstat, "matsum": matsum, "binout": binout, "radioss-th": time_history, "hdf5": hdf5, "csv": csv,
    "d3plot": d3plot, "curves": curves, "deck": deck, "companions": companions,
    "settings": settings,
}  # fmt: skip


CHECKS: Final[dict[str, Callable[[Random], bool]]] = {
    **INPUTS,
    **{name: partial(check_relation, name) for name in RELATIONS},
}


def run_case(form: str, seed: int, number: int) -> str:
    """Return the outcome of one input, or of one history and a relation: ``read``, ``refused``, or the fault."""
    return find_outcome(CHECKS[form], Random(f"{form} {seed} {number}"), number)


def find_outcome(check: Callable[[Random], bool], random: Random, number: int) -> str:
    """Return the outcome of one check, which draws an input from random numbers and reads it."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            return "read" if check(random) else "refused"
        except Exception as error:  # noqa: BLE001  any exception is a fault
            return f"number {number}: {type(error).__name__}: {' '.join(str(error).split())[:150]}"


def count_outcomes(seed: int, task: tuple[str, range]) -> tuple[str, Counter[str]]:
    """Count the outcomes of some inputs of one format."""
    form, numbers = task
    return form, Counter(run_case(form, seed, number) for number in numbers)


def main() -> int:
    """Run the campaign and return its exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--inputs", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", nargs=2, metavar=("FORMAT", "NUMBER"))
    parser.add_argument("--relations", action="store_true")
    options = parser.parse_args()
    if options.only:
        print(run_case(options.only[0], options.seed, int(options.only[1])))
        return 0
    forms = [*(RELATIONS if options.relations else INPUTS)]
    inputs_per_format = -(-options.inputs // len(forms))
    size = _FEW if options.relations else _CHUNK
    tasks = [
        (form, range(first_number, min(first_number + size, inputs_per_format)))
        for first_number in range(0, inputs_per_format, size)
        for form in forms
    ]
    outcomes: dict[str, Counter[str]] = {form: Counter() for form in forms}
    with choose_farm(count_cores(), "tests.faults") as farm:
        for answer in farm.answers(partial(count_outcomes, options.seed), tasks):
            form, numbers = tasks[answer.number]
            outcomes[form] += (
                Counter({f"{numbers}: {answer.error}": 1})
                if answer.error
                else answer.result[1]
            )
    heads = (
        ("relation", "histories", "chosen", "none")
        if options.relations
        else ("format", "inputs", "read", "refused")
    )
    print(f"{heads[0]:<22} {heads[1]:>9} {heads[2]:>9} {heads[3]:>9} {'faults':>9}")
    for form, counts in outcomes.items():
        fault_kinds = [
            outcome_name
            for outcome_name in counts
            if outcome_name not in ("read", "refused")
        ]
        print(
            f"{form:<22} {inputs_per_format:>9} {counts['read']:>9} {counts['refused']:>9} {len(fault_kinds):>9}"
        )
        print(
            *(f"  {outcome_name}" for outcome_name in fault_kinds[:_SHOWN]),
            sep="\n",
            end="\n" if fault_kinds else "",
        )
    return int(any(counts.keys() - {"read", "refused"} for counts in outcomes.values()))


def _read(reader: Callable[[], object]) -> object:
    """Return the result of ``reader``, or None if it raises a d2rpick error of one line."""
    try:
        return reader() or True
    except D2RPickError as error:
        message = str(error)
    assert "\n" not in message, "an error of several lines"
    return None


def _table(data: bytes) -> bool:
    """Return True if a table could be read; each state must be in one line, with either decimal sign."""
    history = _read(lambda: open_contents(csv_table, data).history(Selection()))
    if not isinstance(history, History):
        return False
    text = data.decode("latin-1")
    lines = [set(_numbers(line)) for line in re.split(r"[\r\n]+", text)]
    for time, energy in list_states(history):
        assert any({time, energy} <= line for line in lines), (
            f"({time}, {energy}) stands in no line"
        )
    return True


def _numbers(line: str) -> list[float]:
    texts = [*_NUMBER.findall(line), *_NUMBER.findall(line.replace(",", "."))]
    return [float(text.upper().replace("D", "E")) for text in texts]


@cache
def _d3plot() -> D3plotWriter:
    return D3plotWriter(control={"numnp": 2, "nel2": 0, "nelt": 0, "nv2d": 1}, walls=1)


@cache
def _hdf5() -> bytes:
    return write_hdf5(plain).getvalue()


if __name__ == "__main__":
    sys.exit(main())
