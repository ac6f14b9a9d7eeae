"""A campaign of damaged inputs over all formats: ``python -m tests.campaign --inputs 1000000 --seed 1``.

Each input is made from the seed and its number alone.  Whatever the damage, a reader gives the numbers that stand in
the file or an error of d2rpick in one line; anything else, a warning and the death of the process among them, is a
fault.  Counts are printed for each format; exit code 1 when there is a fault.  ``--only FORMAT NUMBER`` repeats one.

``--relations`` compares answers instead: a history is changed in a way that must not matter, or must matter in a known
way (`tests.relations`).  A fault is an answer that does not follow.
"""

import argparse
import re
import sys
import warnings
from collections import Counter
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Final

from d2rpick.base.errors import D2RPickError
from d2rpick.base.workers import choose_farm, count_cores
from d2rpick.deck.reader import read_deck
from d2rpick.histories.formats import csv_table, hdf5_file
from d2rpick.histories.formats.d3plot import open_legs
from d2rpick.histories.history import History
from d2rpick.histories.opening import Selection, Source, open_run
from tests.command import DECK
from tests.damaged_files import FILES
from tests.faults import Fault, damage
from tests.hdf5_files import plain, written
from tests.histories.formats import test_curves, test_faults_text
from tests.made_d3plot import D3plotWriter, states
from tests.reading import run_of, states_of
from tests.relations import RELATIONS, check_relation

_CHUNK: Final = 200  # inputs of one task
_FEW: Final = (
    20  # histories of one task of a relation, each of which is chosen from twice
)
_SHOWN: Final = 5  # faults of a format that are printed
_KINDS: Final = ("flip", "cut", "drop", "double", "swap", "insert", "blank")
_LIKELY: Final = b"\n 0123456789.,;E+-*eND\"'\x00\x1b\xff"
_NUMBER: Final = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][+-]?\d+)?")
_D3PLOT_STATES: Final = states([0.125 * state for state in range(6)], walls=1)
_CSV: Final = b"time,internal_energy,kinetic_energy\n" + b"".join(
    b"%.3f,%.5e,%.4f\n" % (state / 8, state**3 - 10, state) for state in range(40)
)


def faults(random: Random) -> list[Fault]:
    """One to three faults anywhere."""
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
    """Damage a glstat; whether it could be read."""
    return test_faults_text.check_glstat(faults(random))


def matsum(random: Random) -> bool:
    """Damage a matsum of three or four lines for each part."""
    return test_faults_text.check_matsum(faults(random), random.choice((3, 4)))


def binout(random: Random) -> bool:
    """Damage the structure of a binout, or lose, double and move its records."""
    return restructured(random, "binout", "long binout")


def time_history(random: Random) -> bool:
    """Damage a T01 like that."""
    return restructured(random, "T01", "T01 as text")


def restructured(random: Random, *names: str) -> bool:
    """Damage one of these files of records."""
    file = FILES[random.choice(names)]
    return bool(file.true(file.restructured(random)))


def csv(random: Random) -> bool:
    """Damage a table; what is read stands in one line."""
    return _table(damage(_CSV, faults(random), []))


def curves(random: Random) -> bool:
    """Damage a file of curves."""
    text = random.choice((test_curves.CURVEPLOT, test_curves.T_HIS)).encode()
    return _table(damage(text, faults(random), []))


def hdf5(random: Random) -> bool:
    """Damage an HDF5 file; its numbers bear no mark of their own."""
    data = damage(_hdf5(), faults(random), [])
    return bool(_read(lambda: run_of(hdf5_file, data).history(Selection())))


def d3plot(random: Random) -> bool:
    """Damage a d3plot of one file or two; the numbers bear no mark of their own, but there are not more states."""
    contents = [
        _d3plot().together(_D3PLOT_STATES[:3]),
        _d3plot().file(_D3PLOT_STATES[3:]),
    ]
    place = random.randrange(2)
    contents[place] = damage(contents[place], faults(random), [])
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
    """Damage a deck."""
    with TemporaryDirectory() as folder:
        file = Path(folder, "deck.k")
        file.write_bytes(damage(Path(DECK).read_bytes(), faults(random), []))
        return bool(_read(lambda: list(read_deck(str(file)).cards)))


def companions(random: Random) -> bool:
    """Damage one or both of a glstat and the matsum of the same run."""
    with TemporaryDirectory() as folder:
        contents = {
            "glstat": test_faults_text.GLSTAT,
            "matsum": test_faults_text.MATSUM[4],
        }
        for name in random.choice((("glstat",), ("matsum",), ("glstat", "matsum"))):
            contents[name] = damage(contents[name], faults(random), [])
        for name, content in contents.items():
            Path(folder, name).write_bytes(content)
        parts = random.choice(((), ("12",), ("1", "12", "13")))
        selection = Selection(parts=parts)
        return bool(_read(lambda: open_run([folder], selection).history(selection)))


FORMATS: Final[dict[str, Callable[[Random], bool]]] = {
    "glstat": glstat, "matsum": matsum, "binout": binout, "radioss-th": time_history, "hdf5": hdf5, "csv": csv,
    "d3plot": d3plot, "curves": curves, "deck": deck, "companions": companions,
}  # fmt: skip


CHECKS: Final[dict[str, Callable[[Random], bool]]] = {
    **FORMATS,
    **{name: partial(check_relation, name) for name in RELATIONS},
}


def case(form: str, seed: int, number: int) -> str:
    """What became of one input, or of one history and a relation: ``read``, ``refused``, or the fault."""
    return outcome(CHECKS[form], Random(f"{form} {seed} {number}"), number)


def outcome(read: Callable[[Random], bool], random: Random, number: int) -> str:
    """The same of an input that is made from random numbers and read."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            return "read" if read(random) else "refused"
        except Exception as error:  # noqa: BLE001  whatever it is, it is a fault
            return f"number {number}: {type(error).__name__}: {' '.join(str(error).split())[:150]}"


def chunk(seed: int, task: tuple[str, range]) -> tuple[str, Counter[str]]:
    """Outcomes of some inputs of one format."""
    form, numbers = task
    return form, Counter(case(form, seed, number) for number in numbers)


def main() -> int:
    """Run the campaign."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--inputs", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", nargs=2, metavar=("FORMAT", "NUMBER"))
    parser.add_argument("--relations", action="store_true")
    options = parser.parse_args()
    if options.only:
        print(case(options.only[0], options.seed, int(options.only[1])))
        return 0
    forms = [*(RELATIONS if options.relations else FORMATS)]
    each = -(-options.inputs // len(forms))
    size = _FEW if options.relations else _CHUNK
    tasks = [
        (form, range(at, min(at + size, each)))
        for at in range(0, each, size)
        for form in forms
    ]
    found: dict[str, Counter[str]] = {form: Counter() for form in forms}
    with choose_farm(count_cores(), "tests.faults") as farm:
        for answer in farm.answers(partial(chunk, options.seed), tasks):
            form, numbers = tasks[answer.number]
            found[form] += (
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
    for form, counts in found.items():
        wrong = [what for what in counts if what not in ("read", "refused")]
        print(
            f"{form:<22} {each:>9} {counts['read']:>9} {counts['refused']:>9} {len(wrong):>9}"
        )
        print(
            *(f"  {what}" for what in wrong[:_SHOWN]),
            sep="\n",
            end="\n" if wrong else "",
        )
    return int(any(counts.keys() - {"read", "refused"} for counts in found.values()))


def _read(read: Callable[[], object]) -> object:
    """What is read; None for an error of ours in one line."""
    try:
        return read() or True
    except D2RPickError as error:
        message = str(error)
    assert "\n" not in message, "an error of several lines"
    return None


def _table(data: bytes) -> bool:
    """Read a table; whether it could be.  A state must stand in one line, whatever the decimal sign."""
    history = _read(lambda: run_of(csv_table, data).history(Selection()))
    if not isinstance(history, History):
        return False
    text = data.decode("latin-1")
    lines = [set(_numbers(line)) for line in re.split(r"[\r\n]+", text)]
    for time, energy in states_of(history):
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
    return written(plain).getvalue()


if __name__ == "__main__":
    sys.exit(main())
