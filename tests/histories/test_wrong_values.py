"""A damaged number in a single state is refused with its place; a contact that lasts a single state is not."""

from pathlib import Path

import numpy as np
import pytest

from d2rpick.base.errors import HistoryError
from d2rpick.choice.question import read_reference
from d2rpick.histories.history import Samples
from d2rpick.histories.names import Selection
from tests.command import put, run

ROOT = Path(__file__).resolve().parents[2]
SAMPLES = ROOT / "sample_data"
STATES = np.linspace(0.0, 1.0, 101)


def damage_line(name: str, number: int, old: str, new: str, folder: Path) -> str:
    """Write a copy of a sample in which a text of one line, counted from 1, is replaced."""
    lines = (SAMPLES / name).read_text().split("\n")
    assert old in lines[number - 1]
    lines[number - 1] = lines[number - 1].replace(old, new)
    return str(put(folder / name, "\n".join(lines).encode()))


def read_all(file: str, *parts: str) -> tuple[object, ...]:
    """Return all that a question reads of a file."""
    history = read_reference([file], Selection(parts=parts)).history
    return history, history.momenta, history.balance


def refuse(file: str, *parts: str) -> str:
    """Return the message of the error that reading a reference run raises."""
    with pytest.raises(HistoryError) as refusal:
        read_all(file, *parts)
    return str(refusal.value).removeprefix(file)


@pytest.mark.parametrize(
    ("energy", "shown"),
    [
        ("1e9", "1e+09"),
        ("1e4", "10000"),
        ("300", "300"),
        ("100", "100"),
        ("-50", "-50"),
    ],
)
def test_a_damaged_energy_of_a_table_is_named_with_its_line(
    energy: str, shown: str, tmp_path: Path
) -> None:
    """Before, plan said "use", because nothing vibrates beside an energy of 1e9."""
    file = damage_line("energy.csv", 502, "0.08340760542299112", energy, tmp_path)
    message = refuse(file)
    assert message == (
        f":502: internal energy is {shown} in the single state at 0.05, but about 0.0839331 (by the total energy of "
        "the neighbouring states) was expected; repair or delete the line"
    )
    for command in ("plan", "info", "explore"):
        answer = run(command, file)
        assert answer.exit_code == 2
        assert message in answer.stderr


def test_an_energy_alone_is_refused_if_it_is_far_beyond_all_others(
    tmp_path: Path,
) -> None:
    energy = np.sin(40 * STATES) ** 2
    energy[50] = 1e9
    rows = "\n".join(
        f"{t!r},{e!r}" for t, e in zip(STATES.tolist(), energy.tolist(), strict=True)
    )
    file = put(tmp_path / "alone.csv", f"time,internal_energy\n{rows}\n".encode())
    assert refuse(str(file)).startswith(":52: internal_energy is 1e+09")


@pytest.mark.parametrize(
    ("old", "new", "line", "name"),
    [
        ("internal", "5.00000E+09", 3592, "internal energy"),
        ("kinetic", "5.00000E+09", 3591, "kinetic energy"),
        ("internal", "5.00000E+09", 10, "internal energy"),
        ("internal", "5.00000E+09", 7570, "internal energy"),
    ],
)
def test_a_damaged_energy_of_a_glstat_is_refused(
    old: str, new: str, line: int, name: str, tmp_path: Path
) -> None:
    written = (SAMPLES / "rollover_box.glstat").read_text().split("\n")[line - 1]
    assert old in written
    file = damage_line(
        "rollover_box.glstat", line, written.split()[-1].lstrip("."), new, tmp_path
    )
    message = refuse(file)
    assert message.startswith(f":{line}: {name} is 5e+09 in the single state at ")
    assert message.endswith("repair or delete the state")


@pytest.mark.parametrize(
    ("line", "label", "name"),
    [
        (2200, "inten=", "internal energy of part box is 5e+09"),
        (2201, "x-mom=", "the x momentum of part box is 5e+09"),
    ],
)
def test_a_damaged_part_of_a_matsum_is_named(
    line: int, label: str, name: str, tmp_path: Path
) -> None:
    written = (SAMPLES / "rollover_box.matsum").read_text().split("\n")[line - 1]
    number = written.split(label)[1].split()[0]
    file = damage_line(
        "rollover_box.matsum", line, f"{label}   {number}", f"{label}   5.0000E+09", tmp_path
    )  # fmt: skip
    assert refuse(file, "1", "2").startswith(f":{line}: {name} in the single state")


def test_a_contact_of_a_single_state_is_no_damage(tmp_path: Path) -> None:
    """A stiff body falls and bounces: for one state, its motion becomes internal energy, which returns."""
    internal = np.full(STATES.size, 1e-3)
    kinetic = np.full(STATES.size, 1e-6)
    kinetic[30:70] = 5.0
    for hit in (29, 70):
        internal[hit] = 5.5
    kinetic[:29] = kinetic[71:] = 5.0
    rows = "\n".join(
        f"{t!r},{e!r},{k!r}"
        for t, e, k in zip(
            STATES.tolist(), internal.tolist(), kinetic.tolist(), strict=True
        )
    )
    head = "time,internal_energy,kinetic_energy"
    file = put(tmp_path / "bounce.csv", f"{head}\n{rows}\n".encode())
    assert read_all(str(file))


@pytest.mark.parametrize(
    ("state", "count", "factor", "column"),
    [
        (500, 1, 0.5, "internal"),
        (500, 2, 0.5, "internal"),
        (500, 1, 3.0, "internal"),
        (500, 2, 3.0, "internal"),
        (512, 1, 3.0, "kinetic"),
        (512, 2, 3.0, "kinetic"),
        (504, 1, 0.0, "internal"),
        (504, 2, 0.0, "internal"),
    ],
)
def test_damaged_energies_below_the_total_energy_do_not_fit_those_beside_them(
    state: int, count: int, factor: float, column: str, tmp_path: Path
) -> None:
    """An energy that is too low, or two damaged states, were not noticed before."""
    energies = {
        "internal": 40 + 30 * np.cos(0.1 * np.arange(1001)),
        "kinetic": 40 - 30 * np.cos(0.1 * np.arange(1001)),
    }
    table = write_energies(energies["internal"], energies["kinetic"])
    assert read_all(str(put(tmp_path / "sound.csv", table)))
    right = energies[column][state]
    energies[column][state : state + count] *= factor
    table = write_energies(energies["internal"], energies["kinetic"])
    message = refuse(str(put(tmp_path / "damaged.csv", table)))
    wrong = energies[column][state]
    assert message.startswith(f":{state + 2}: {column} energy is {wrong:.6g} ")
    assert f", but about {right:.6g} " in message
    assert message.endswith("the line" if count == 1 else "these lines")


def test_a_contact_that_stores_kinetic_energy_in_a_single_state_is_no_damage(
    tmp_path: Path,
) -> None:
    """A contact is a spring, whose energy is neither internal nor kinetic."""
    internal = np.full(STATES.size, 1.0)
    kinetic = np.full(STATES.size, 50.0)
    kinetic[40] = 3.0
    assert read_all(str(put(tmp_path / "hit.csv", write_energies(internal, kinetic))))


def write_energies(internal: Samples, kinetic: Samples) -> bytes:
    """Return a table of two energies at 1, 2, 3, ..."""
    rows = zip(internal.tolist(), kinetic.tolist(), strict=True)
    lines = [f"{t},{i!r},{k!r}" for t, (i, k) in enumerate(rows, start=1)]
    return "\n".join(["time,internal_energy,kinetic_energy", *lines, ""]).encode()


def test_a_place_without_a_line_is_a_state(tmp_path: Path) -> None:
    """The energy of all parts is a sum, which no line of the file contains."""
    written = (SAMPLES / "rollover_box.matsum").read_text().split("\n")[2199]
    number = written.split("inten=")[1].split()[0]
    file = damage_line(
        "rollover_box.matsum", 2200, f"inten=   {number}", "inten=   5.0000E+09", tmp_path
    )  # fmt: skip
    assert refuse(file).startswith(", state 200: internal energy of all parts is 5e+09")
