"""Read the control words and other words of LS-DYNA's d3plot and d3thdt, in 4 or 8 bytes and either byte order.

The control words at the start of the first file keep the names of their source: "LS-DYNA Database Binary Output
Files" of LSTC.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.errors import FormatError
from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.names import clean_text

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from d2rpick.histories.content import Content

# Number that marks the end of the geometry, of the titles, and of the states in each file.
END: Final = -999999.0
HEAD: Final = 512  # Length of the control words if each word has 8 bytes [bytes].
# Number of control words in every file. The control word ``extra`` gives the number of further words.
CONTROL: Final = 64

_PLACES: Final = {
    "filetype": 11, "ndim": 15, "numnp": 16, "nglbv": 18, "it": 19, "iu": 20, "iv": 21, "ia": 22, "nel8": 23,
    "nummat8": 24, "nv3d": 27, "nel2": 28, "nummat2": 29, "nv1d": 30, "nel4": 31, "nummat4": 32, "nv2d": 33,
    "maxint": 36, "nmsph": 37, "ngpsph": 38, "narbs": 39, "nelt": 40, "nummatt": 41, "nv3dt": 42, "ialemat": 47,
    "nadapt": 50, "nmmat": 51, "npefg": 54, "nel48": 55, "idtdt": 56, "extra": 57, "nel20": 64, "nt3d": 65,
    "nel27": 66, "nel21p": 68, "nel15t": 69, "nel20t": 71, "nel40p": 72, "nel64": 73, "quadr": 74, "cubic": 75,
    "penout": 78, "engout": 79,
}  # fmt: skip
_SIGNED: Final = ("nel8", "maxint")  # Control words whose sign is used as a flag.
# Index of the word with the release name; the next word contains the release number.
_RELEASE: Final = 13
_FAMILIES: Final = {1: "d3plot", 3: "d3thdt", 5: "d3part"}
LONG_IDS: Final = 1000  # Number that is added to the file type if the ids have 8 bytes.
_DIMENSIONS: Final = range(2, 10)


class Form(NamedTuple):
    """The number format of a file: the bytes per word, and the byte order as a `struct` character."""

    width: int
    order: str

    @property
    def real(self) -> np.dtype[Any]:
        """Numpy type of the real numbers."""
        return np.dtype(f"{self.order}f{self.width}")

    @property
    def integer(self) -> np.dtype[Any]:
        """Numpy type of the integers."""
        return np.dtype(f"{self.order}i{self.width}")


def detect_form(head: bytes) -> Form | None:
    """Return the number format of a file with these first bytes; None if it is not a d3plot, d3thdt or d3part."""
    for form in (Form(width, order) for width in (4, 8) for order in "<>"):
        if len(head) < CONTROL * form.width:
            continue
        words = np.frombuffer(head[: CONTROL * form.width], form.integer)
        counts = words[[_PLACES[name] for name in ("numnp", "nglbv", "nmmat")]]
        kind = int(words[_PLACES["filetype"]])
        dimensions = int(words[_PLACES["ndim"]])
        is_known = kind % LONG_IDS in _FAMILIES and kind // LONG_IDS in (0, 1)
        if is_known and dimensions in _DIMENSIONS and (counts >= 0).all():
            return form
    return None


def detect_family(head: bytes) -> str | None:
    """Return the file family (d3plot, d3thdt or d3part) of a file with these first bytes; None for any other file."""
    form = detect_form(head)
    if form is None:
        return None
    words = np.frombuffer(head[: CONTROL * form.width], form.integer)
    return _FAMILIES[int(words[_PLACES["filetype"]]) % LONG_IDS]


class Words:
    """The words of a file, counted from 0."""

    def __init__(self, content: Content, form: Form, source: str) -> None:
        self._content, self.form, self.source = content, form, source

    def control(self) -> dict[str, int]:
        """Return the control words, keyed by name; a word that an older file lacks is 0."""
        words = self.integers(0, CONTROL)
        length = CONTROL + max(0, words[_PLACES["extra"]])
        words += self.integers(
            CONTROL, min(length, max(_PLACES.values()) + 1) - CONTROL
        )
        control = {
            name: words[index] if index < len(words) else 0
            for name, index in _PLACES.items()
        }
        for name, count in control.items():
            if count < 0 and name not in _SIGNED:
                raise self.damaged(f"a count of {count} ({name}) in its head")
        return control

    def release(self) -> float:
        """Return the number of the release, such as 971."""
        number = self.bytes((_RELEASE + 1) * self.form.width, self.form.width)
        return float(np.frombuffer(number, self.form.real)[0])

    @property
    def is_named(self) -> bool:
        """True if the release name begins with R (R920, R12); older releases have only a number."""
        return self.bytes(_RELEASE * self.form.width, 4).strip().startswith(b"R")

    def version(self) -> str:
        """Return the solver name and release, such as LS-DYNA R920. Older files contain no release name."""
        name = clean_text(self.bytes(_RELEASE * self.form.width, 4))
        return f"LS-DYNA {name}" if name.isalnum() else "LS-DYNA"

    def integers(self, word: int, count: int) -> tuple[int, ...]:
        """Return ``count`` integers that start at a word."""
        data = self.bytes(word * self.form.width, count * self.form.width)
        return tuple(np.frombuffer(data, self.form.integer).tolist())

    def ends_at(self, at: int) -> bool:
        """Return True if an end mark begins at the byte offset ``at``."""
        data = self._content[at : at + self.form.width]
        if len(data) < self.form.width:
            return False
        return bool(np.frombuffer(data, self.form.real)[0] == END)

    def has(self, at: int, size: int) -> bool:
        """Return True if the file has at least ``size`` bytes after the offset ``at``."""
        return at + size <= len(self._content)

    def damaged(self, content: str) -> FormatError:
        """Return the error for a file whose content contradicts its header."""
        cure = "the file is damaged, or of an unknown release; name the glstat, matsum or binout of the run"
        return FormatError(f"{self.source}: it has {content}; {cure}")

    def bytes(self, at: int, size: int) -> bytes:
        """Return ``size`` bytes from the offset ``at``; raise FormatError if the file ends earlier."""
        if at < 0 or size < 0 or not self.has(at, size):
            problem = f"{self.source}: the file has {len(self._content)} bytes, its head goes on beyond them"
            raise FormatError(f"{problem}; it is cut or damaged, copy it again")
        return self._content[at : at + size]


def count_dimensions(control: Mapping[str, int]) -> int:
    """Return the number of coordinates per node. A control word above 3 contains flags as well."""
    return min(control["ndim"], 3)
