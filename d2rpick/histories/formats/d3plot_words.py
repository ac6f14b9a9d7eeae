"""The words of LS-DYNA's d3plot and d3thdt: of 4 or 8 bytes, in either byte order, and what the first of them say.

The control words at the beginning of the first file keep the names of their source: "LS-DYNA Database Binary Output
Files" of LSTC.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.errors import FormatError
from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.names import plain_text

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from d2rpick.histories.content import Content

END: Final = -999999.0  # ends the geometry, the titles, and the states of each file
HEAD: Final = 512  # bytes of the control words of the wider form
CONTROL: Final = 64  # words, before as many as ``extra`` says

_PLACES: Final = {
    "filetype": 11, "ndim": 15, "numnp": 16, "nglbv": 18, "it": 19, "iu": 20, "iv": 21, "ia": 22, "nel8": 23,
    "nummat8": 24, "nv3d": 27, "nel2": 28, "nummat2": 29, "nv1d": 30, "nel4": 31, "nummat4": 32, "nv2d": 33,
    "maxint": 36, "nmsph": 37, "ngpsph": 38, "narbs": 39, "nelt": 40, "nummatt": 41, "nv3dt": 42, "ialemat": 47,
    "nadapt": 50, "nmmat": 51, "npefg": 54, "nel48": 55, "idtdt": 56, "extra": 57, "nel20": 64, "nt3d": 65,
    "nel27": 66, "nel21p": 68, "nel15t": 69, "nel20t": 71, "nel40p": 72, "nel64": 73, "quadr": 74, "cubic": 75,
    "penout": 78, "engout": 79,
}  # fmt: skip
_SIGNED: Final = ("nel8", "maxint")  # whose sign is a flag
_RELEASE: Final = 13  # place of its name, before that of its number
_FAMILIES: Final = {1: "d3plot", 3: "d3thdt", 5: "d3part"}
LONG_IDS: Final = 1000  # is added to the type of a file whose ids have 8 bytes
_DIMENSIONS: Final = range(2, 10)


class Form(NamedTuple):
    """How numbers are written: bytes of a word, and their order as `struct` says it."""

    width: int
    order: str

    @property
    def real(self) -> np.dtype[Any]:
        """Type of a real."""
        return np.dtype(f"{self.order}f{self.width}")

    @property
    def integer(self) -> np.dtype[Any]:
        """Type of an integer."""
        return np.dtype(f"{self.order}i{self.width}")


def form_of(head: bytes) -> Form | None:
    """Find how the numbers of a file of the family are written that begins like this; None where it is none."""
    for form in (Form(width, order) for width in (4, 8) for order in "<>"):
        if len(head) < CONTROL * form.width:
            continue
        words = np.frombuffer(head[: CONTROL * form.width], form.integer)
        counts = words[[_PLACES[name] for name in ("numnp", "nglbv", "nmmat")]]
        kind, dimensions = int(words[_PLACES["filetype"]]), int(words[_PLACES["ndim"]])
        is_known = kind % LONG_IDS in _FAMILIES and kind // LONG_IDS in (0, 1)
        if is_known and dimensions in _DIMENSIONS and (counts >= 0).all():
            return form
    return None


def family_of(head: bytes) -> str | None:
    """Name the family, d3plot, d3thdt or d3part, of a file that begins like this; None where it is of none."""
    form = form_of(head)
    if form is None:
        return None
    words = np.frombuffer(head[: CONTROL * form.width], form.integer)
    return _FAMILIES[int(words[_PLACES["filetype"]]) % LONG_IDS]


class Words:
    """Words of a file by their place, counted from 0."""

    def __init__(self, content: Content, form: Form, source: str) -> None:
        self._content, self.form, self.source = content, form, source

    def control(self) -> dict[str, int]:
        """Read the control words by their names; those that an older file has not are 0."""
        words = self.integers(0, CONTROL)
        length = CONTROL + max(0, words[_PLACES["extra"]])
        words += self.integers(
            CONTROL, min(length, max(_PLACES.values()) + 1) - CONTROL
        )
        found = {
            name: words[place] if place < len(words) else 0
            for name, place in _PLACES.items()
        }
        negative = [
            name for name, count in found.items() if count < 0 and name not in _SIGNED
        ]
        if negative:
            raise self.damaged(
                f"a count of {found[negative[0]]} ({negative[0]}) in its head"
            )
        return found

    def release(self) -> float:
        """Read the number of the release, as 971."""
        return float(
            np.frombuffer(
                self.bytes((_RELEASE + 1) * self.form.width, self.form.width),
                self.form.real,
            )[0]
        )

    @property
    def is_named(self) -> bool:
        """Whether the release has a name that begins with R, as R920 and R12, and not a number alone."""
        return self.bytes(_RELEASE * self.form.width, 4).strip().startswith(b"R")

    def version(self) -> str:
        """Read the name of the release, as R920, which older files have not."""
        name = plain_text(self.bytes(_RELEASE * self.form.width, 4))
        return f"LS-DYNA {name}" if name.isalnum() else "LS-DYNA"

    def integers(self, place: int, count: int) -> tuple[int, ...]:
        """Read so many integers."""
        found = self.bytes(place * self.form.width, count * self.form.width)
        return tuple(np.frombuffer(found, self.form.integer).tolist())

    def ends_at(self, at: int) -> bool:
        """Whether the mark of an end stands at a byte."""
        found = self._content[at : at + self.form.width]
        return len(found) == self.form.width and bool(
            np.frombuffer(found, self.form.real)[0] == END
        )

    def has(self, at: int, size: int) -> bool:
        """Whether the file has so many bytes there."""
        return at + size <= len(self._content)

    def damaged(self, found: str) -> FormatError:
        """Say what was found in a file that its head does not describe."""
        cure = "the file is damaged, or of a release that is not known; name the glstat, matsum or binout of the run"
        return FormatError(f"{self.source}: it has {found}; {cure}")

    def bytes(self, at: int, size: int) -> bytes:
        """Read so many bytes; FormatError where the file ends before."""
        if at < 0 or size < 0 or not self.has(at, size):
            found = f"{self.source}: the file has {len(self._content)} bytes, its head goes on beyond them"
            raise FormatError(f"{found}; it is cut or damaged, copy it again")
        return self._content[at : at + size]


def dimensions_of(control: Mapping[str, int]) -> int:
    """Give the coordinates of a node: the word for them has flags above 3."""
    return min(control["ndim"], 3)
