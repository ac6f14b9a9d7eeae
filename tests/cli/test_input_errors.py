"""Every message on the page about errors in the input is printed by a command, in one line, with exit code 2."""

import re
import shutil
from pathlib import Path
from typing import Final

import pytest

from tests.command import BOX, DECK, ENERGY, GLSTAT, MATSUM, ROOT, run
from tests.examples import read_page

PAGE: Final = "docs/how-to/input-errors.md"
SAMPLES: Final = ROOT / "sample_data"
BOX_DECK: Final = str(SAMPLES / "rollover_box.k")
BOX_GLSTAT: Final = str(SAMPLES / "rollover_box.glstat")
# Tables of time and internal energy that d2rpick rejects.
TABLES: Final = {
    "word.csv": "0,1\n1,2\n2,******\n3,4",
    "unsorted.csv": "0,1\n1,2\n0.2,3\n0.1,4",
    "curves.csv": "0,1\n1,2\ntime,internal_energy\n0,4\n1,2",
    "short.csv": "0,1\n1,2",
}
# For each message, a command that prints it.
COMMANDS: Final = {
    "no such file": ("info", "absent.csv"),
    "no glstat, matsum, binout, d3plot or T01 in this folder": ("plan", "empty"),
    "this is a deck, but an energy history was expected": ("plan", BOX_DECK),
    "binary data of no known format": ("plan", "random"),
    "this is a zip archive": ("plan", "archive.zip"),
    "do all files belong to the same run?": ("plan", MATSUM, GLSTAT),
    "restart segments of one run were expected": ("plan", MATSUM, "later.matsum"),
    "were written by different solvers": ("plan", MATSUM, BOX),
    "main decks (...); name the deck of the run with --deck": ("plan", "decks"),
    "a number was expected; repair or delete the line": ("suggest", "word.csv"),
    "is missing, cut or doubled in this state": ("plan", "cut.matsum"),
    "damaged gzip data": ("plan", "damaged.gz"),
    "it is damaged or cut, copy it again": ("plan", "damaged.h5"),
    "at least 3 were expected; write the energies more often": ("suggest", "short.csv"),
    "time steps back from ... to ...": ("suggest", "unsorted.csv"),
    "a second header, another curve begins here": ("suggest", "curves.csv"),
    "lies outside the record": ("suggest", "--td", "0.9", MATSUM),
    "the unit of time is not known from": ("suggest", "--td", "370ms", MATSUM),
    "is not before td": ("verify", "--tr", "0.3", "--td", "0.2", MATSUM),
    "no part ... (expected part ids, not set ids); there are:": (
        "plan", "--part", "99", MATSUM,
    ),
    "no part ... (did you mean ...?)": ("plan", "--part", "bx", MATSUM),
    "a glstat has no parts; add the matsum of the run": (
        "plan", "--part", "1", BOX_GLSTAT,
    ),
    "no column is named like an internal energy; choose with --energy": (
        "suggest", "unnamed.csv",
    ),
    "no column ...; there are:": ("suggest", "--energy", "absent", ENERGY),
    "needs --deck": ("plan", "--part", "recommended", MATSUM),
    "No such option": ("suggest", "--tolerence", "0.1", ENERGY),
    "missing: --part IDS": ("card", "--tr", "0.1", "--td", "0.3"),
}  # fmt: skip


@pytest.fixture(autouse=True)
def _input_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Write the faulty files to an empty folder."""
    monkeypatch.chdir(tmp_path)
    for name, rows in TABLES.items():
        Path(name).write_text(f"time,internal_energy\n{rows}\n")
    Path("unnamed.csv").write_text("time,a,b\n0,1,1\n1,2,2\n2,1,3\n3,2,1\n")
    Path("random").write_bytes(bytes(range(256)) * 9)
    Path("archive.zip").write_bytes(b"PK\x03\x04" + bytes(40))
    Path("damaged.gz").write_bytes(b"\x1f\x8b\x08\x00" + bytes(range(200)))
    hdf5 = next(SAMPLES.rglob("*.h5")).read_bytes()
    Path("damaged.h5").write_bytes(hdf5[: len(hdf5) // 2])
    text = Path(MATSUM).read_text("utf-8")
    Path("cut.matsum").write_text(re.sub(r"inten=.*", "", text[:9000], count=1))
    Path("later.matsum").write_text(
        text.replace("0.0000E+00     kinen", "9.0000E+02     kinen")
    )
    Path("empty").mkdir()
    Path("decks").mkdir()
    for deck in (BOX_DECK, DECK, MATSUM):
        shutil.copy(deck, "decks")


@pytest.mark.parametrize("message", COMMANDS)
def test_a_message_on_the_page_is_printed(message: str) -> None:
    result = run(*COMMANDS[message])
    assert result.exit_code == 2
    *notes, error = result.stderr.strip().splitlines()
    assert all(note.startswith(("note: ", "warning: ")) for note in notes)
    assert re.search(re.escape(message).replace(r"\.\.\.", ".+"), error)


def test_every_message_on_the_page_has_a_command() -> None:
    rows = re.findall(r"^\| (`[^|]+`) \|", read_page(PAGE), re.MULTILINE)
    messages = [message for row in rows for message in re.findall("`([^`]+)`", row)]
    assert messages == [*COMMANDS]
