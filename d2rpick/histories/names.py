"""What columns, units and parts are called, and which of them the user asks for."""

from __future__ import annotations

import re
from collections import Counter
from functools import lru_cache
from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import FormatError, listing
from d2rpick.base.tuples import NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

TIME_UNITS = frozenset({"s", "sec", "second", "seconds", "ms", "msec", "us", "µs", "μs", "ns", "min", "h"})
_ENERGY_UNITS = frozenset(
    {"j", "kj", "mj", "gj", "µj", "μj", "uj", "nj", "joule", "nm", "nmm", "n*m", "n*mm", "n.m", "n.mm", "n·m",
     "n·mm", "n-mm", "n-m", "knm", "knmm", "kn*mm", "kn.mm", "kn·mm", "kn*m", "erg", "lbf*in", "lbf-in",
     "lbf·in", "in-lbf", "in*lbf", "ft-lbf", "ft*lbf"}
)  # fmt: skip
_UNITS = TIME_UNITS | _ENERGY_UNITS

# Normalised, see `normalised`.
_TIME_NAMES = frozenset(
    {"time", "t", "times", "simtime", "simulationtime", "zeit", "temps", "tempo", "tiempo", "時間", "时间", "시간"}
)
_INTERNAL_NAMES = frozenset(
    {"internalenergy", "internal", "ie", "allie", "inten", "eint", "einternal", "intenergy", "internalen",
     "innereenergie", "innereenergy", "energieinterne", "énergieinterne", "energiainterna", "energíainterna",
     "内部エネルギー", "内能", "내부에너지"}
)  # fmt: skip

# What else a history of the whole model may tell, and what it is called: LS-DYNA's glstat and binout, Radioss and its
# th_to_csv, Abaqus, frames of lasso-python, d2rpick.  Energies [energy], momentum and velocity of the centre of mass
# along an axis [momentum], [velocity], and the mass of what moves [mass].  Names are normalised and taken whole.
QUANTITIES: Final[Mapping[str, frozenset[str]]] = {
    "kinetic_energy": frozenset({"kineticenergy", "kinetic", "ke", "allke", "kinen", "ekin", "ketotal"}),
    "total_energy": frozenset({"totalenergy", "etotal", "etot"}),
    "external_work": frozenset({"externalwork", "extwork", "allwk", "wext", "externalforcework"}),
    "contact_energy": frozenset(
        {"contactenergy", "slidinginterfaceenergy", "slidingenergy", "slidinginterface", "sliding", "contacte"}
    ),
    "frictional_contact_energy": frozenset({"frictionalcontactenergy"}),
    "hourglass_energy": frozenset({"hourglassenergy", "hourglasse", "hourglass", "hgeng", "allae"}),
    "damping_energy": frozenset({"dampingenergy", "systemdampingenergy", "systemdamping"}),
    "eroded_internal_energy": frozenset({"erodedinternalenergy", "erodedinternal"}),
    "energy_ratio": frozenset({"totalenergyinitialenergy", "energyratio"}),
    "x_momentum": frozenset({"xmomentum", "momentumx", "xmom", "px"}),
    "y_momentum": frozenset({"ymomentum", "momentumy", "ymom", "py"}),
    "z_momentum": frozenset({"zmomentum", "momentumz", "zmom", "pz"}),
    "x_velocity": frozenset({"globalxvelocity", "xvelocity", "xrigidbodyvelocity"}),
    "y_velocity": frozenset({"globalyvelocity", "yvelocity", "yrigidbodyvelocity"}),
    "z_velocity": frozenset({"globalzvelocity", "zvelocity", "zrigidbodyvelocity"}),
    "mass": frozenset({"mass", "totalmass"}),
}

_BRACKETS = re.compile(r"[(\[]\s*([^()\[\]]*?)\s*[)\]]\s*$")
_TAIL = re.compile(r"^(.*[^/_,\s])\s*[/_,\s]\s*([^/_,\s]+)$")

# An internal energy among others: of a part, a total.  This and the next are compiled where they are needed.
_SOME_INTERNAL = r"(?i:internal|allie|inten)|(?<![A-Z])IE(?![A-Za-z])"

# Words that name another quantity; KE in capitals only, since "make" and "spoke" hold it too.
_OTHER = (
    r"(?i:kinetic|kinen|\ball(?:ke|pd|se|ae|wk|fd|vd|cd|dmd|mw)|etotal|total.?energy|hourglass|hgeng|eroded"
    r"|dissipat|plastic|damping|sliding|contact|friction|external|work|stonewall|rigidwall"
    r"|accel|veloc|displac|moment|force|pressure|stress|strain(?!.?en)|temperature|ratio|mass|time.?step)"
    r"|(?<![A-Z])KE(?![A-Z])"
)


def unit_of(name: str) -> str:
    """Read the unit a column's name ends with, in brackets or behind ``/``, ``_``, ``,`` or a blank.

    Examples
    --------
    >>> [unit_of(name) for name in ("Time (ms)", "t/ms", "time_s", "Internal Energy [J]", "time", "part_3")]
    ['ms', 'ms', 's', 'J', '', '']
    """
    if brackets := _BRACKETS.search(name):
        return brackets[1]
    tail = _TAIL.match(name)
    return tail[2] if tail and tail[2].casefold() in _UNITS else ""


@lru_cache(maxsize=1 << 16)  # the same names are asked for again and again
def normalised(name: str) -> str:
    """Reduce a name to its letters and digits, in small letters and without its unit.

    Examples
    --------
    >>> [normalised(name) for name in ("Internal_Energy (J)", "t/ms", "IE_J", "E int")]
    ['internalenergy', 't', 'ie', 'eint']
    """
    name = _BRACKETS.sub("", name).strip()
    tail = _TAIL.match(name)
    if tail and tail[2].casefold() in _UNITS:
        name = tail[1]
    return "".join(letter for letter in name.casefold() if letter.isalnum())


def is_time(name: str) -> bool:
    """Whether a column of this name is a time."""
    return normalised(name) in _TIME_NAMES


def is_internal_energy(name: str) -> bool:
    """Whether a column of this name is the internal energy, without addition."""
    return normalised(name) in _INTERNAL_NAMES


def is_some_internal_energy(name: str) -> bool:
    """Whether a name speaks of an internal energy: ``IE_total_J``, ``box IE``, not ``eroded internal``."""
    return bool(re.search(_SOME_INTERNAL, name)) and not re.search(_OTHER, name)


def internal_energies(names: Sequence[str]) -> list[int]:
    """Places of the names that say internal energy without addition or, where there are none, that speak of one."""
    plain = [place for place, name in enumerate(names) if is_internal_energy(name)]
    return plain or [place for place, name in enumerate(names) if is_some_internal_energy(name)]


def quantity_of(name: str) -> str | None:
    """Which of `QUANTITIES` a channel of this name is; of a path its last step counts.

    Examples
    --------
    >>> [quantity_of(name) for name in ("KINETIC ENERGY", "glstat/global_x_velocity", "momentum_z [N s]", "boxKE_J")]
    ['kinetic_energy', 'x_velocity', 'z_momentum', None]
    """
    spellings = {normalised(name), normalised(name.rpartition("/")[2])}
    return next((quantity for quantity, names in QUANTITIES.items() if not names.isdisjoint(spellings)), None)


def is_unit(cell: str) -> bool:
    """Whether a cell of a units row may read like this: ``ms``, ``[J]``, ``(-)``, nothing."""
    return cell.casefold() in _UNITS | {"", "-", "1"} or (bool(cell) and cell[0] + cell[-1] in ("()", "[]"))


def quantity_note(channel: str) -> tuple[str, ...]:
    """Say that a channel's name speaks of something else than internal energy, if it does.

    Examples
    --------
    >>> quantity_note("boxIE_J")
    ()
    >>> quantity_note("ALLKE for Whole Model")
    ("'ALLKE for Whole Model' is not an internal energy by its name (ALLKE); it was used as it is",)
    """
    if channel.replace("_", "").casefold() in _INTERNAL_NAMES:  # as mostly
        return ()
    word = re.search(_OTHER, channel)
    if not word:
        return ()
    return (f"{channel!r} is not an internal energy by its name ({word[0]}); it was used as it is",)


def refuse_other_quantity(channel: str, where: str) -> None:
    """FormatError if the only column or curve of a file is called something else than an internal energy."""
    word = re.search(_OTHER, channel)
    if word:
        found = f"{where}: the only values are {channel!r}, by its name not an internal energy ({word[0]})"
        raise FormatError(f"{found}; choose with `energy` what to take for it")


def meant(wanted: str, known: Sequence[str]) -> list[int]:
    """Places of the names that are meant: as it stands, in other case, or but for blanks, underscores and units."""
    spellings: tuple[Callable[[str], str], ...] = (str.strip, lambda text: text.strip().casefold(), normalised)
    alike = ([place for place, own in enumerate(known) if key(own) == key(wanted)] for key in spellings)
    return next(filter(None, alike), [])


def resolve(wanted: str, known: Sequence[str], where: str) -> str:
    """Find the one name that is `meant`; FormatError, with near misses and what there is, when none or several are.

    Examples
    --------
    >>> resolve("internal energy", ["kinetic_energy", "internal_energy"], "binout")
    'internal_energy'
    """
    same = [known[place] for place in meant(wanted, known)]
    if not same:
        raise FormatError(f"{where}: no {wanted!r}{near_miss(wanted, known)}; there are: {listing(known)}")
    if len(same) > 1:
        raise FormatError(f"{where}: {wanted!r} may be any of these: {listing(same)}; choose one as it is written")
    return same[0]


def in_seconds(text: str) -> float | None:
    """Read a time that is given with its unit [s]; None where it is none.

    Examples
    --------
    >>> in_seconds("64ms"), in_seconds("0.064 s"), in_seconds("64"), in_seconds("forms")
    (0.064, 0.064, None, None)
    """
    found = re.fullmatch(r"\s*(\d+\.?\d*|\.\d+)\s*(s|ms|us|µs)\s*", text, re.ASCII)
    sizes = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6}
    return float(f"{float(found[1]) * sizes[found[2]]:.12g}") if found else None


def near_miss(wanted: str, known: Sequence[str], likeness: float = 0.6) -> str:
    """Ask for the name that was perhaps meant, or say nothing; ``likeness`` from 0 to 1 is the least that counts."""
    import difflib

    folded = {name.casefold(): name for name in known}
    close = difflib.get_close_matches(wanted.casefold(), folded, n=1, cutoff=likeness)
    return f" (did you mean {folded[close[0]]!r}?)" if close else ""


def plain_text(raw: bytes) -> str:
    r"""Text of a fixed field: without padding, and with blanks for bytes that are no text.

    Examples
    --------
    >>> plain_text(b" shell \xe9 \n\0\0  ")
    'shell é'
    """
    try:
        text = raw.decode("utf-8")
    except UnicodeDecodeError:
        text = raw.decode("latin-1")
    return "".join(letter if letter.isprintable() else " " for letter in text).strip()


def number_in_family(name: str, first: str) -> int | None:
    """Give the number that the name of a file has behind that of the first one of its family; None where it has none.

    Examples
    --------
    >>> number_in_family("run/d3plot07", "run/d3plot"), number_in_family("run/d3plotaa", "run/d3plot")
    (7, None)
    """
    number = name[len(first) :] if name.startswith(first) else ""
    return int(number) if 2 <= len(number) <= 9 and number.isascii() and number.isdigit() else None


class Part(NamedTuple):
    """A part of the model, by the number and the title that the solver gives it."""

    id: int
    title: str

    @property
    def name(self) -> str:
        """What to call it: its title, or its number."""
        return self.title or f"part {self.id}"


class Namesake(Part):
    """A part whose title another one has too, which its number tells apart."""

    __slots__ = ()

    @property
    def name(self) -> str:
        """Title and number."""
        return f"{self.title} ({self.id})"


def with_namesakes(parts: Iterable[Part]) -> tuple[Part, ...]:
    """Let parts of one title be told apart by number.

    Examples
    --------
    >>> [part.name for part in with_namesakes([Part(1, "shell"), Part(2, "door"), Part(7, "shell"), Part(9, "")])]
    ['shell (1)', 'door', 'shell (7)', 'part 9']
    """
    every = tuple(parts)
    times = Counter(part.title for part in every if part.title)
    return tuple(Namesake(*part) if times[part.title] > 1 else part for part in every)


# More digits than any number of a part has are a title.
_RANGE = r"(\d{1,18})(?:\s*-\s*(\d{1,18}))?"  # compiled where it is needed


class Selection(NamedTuple):
    """Columns or labels by name, columns also by 1-based number; parts by number, range or title.

    Nothing asked: the time and the internal energy of the whole model.  Several energies, and the energies of
    several parts, are added.  ``flying`` are the parts that are known to fly together with these.  ``channels`` are
    pairs of a quantity (a key of `d2rpick.histories.names.QUANTITIES`) and the name of the channel that holds it, where
    this is not one of the usual names.  ``springs`` are the numbers of the parts that are springs or dampers, None
    where the energies are to tell.
    """

    time: str | None = None
    energy: tuple[str, ...] = ()
    parts: tuple[str, ...] = ()
    flying: tuple[str, ...] = ()
    channels: tuple[tuple[str, str], ...] = ()
    springs: tuple[str, ...] | None = None


def select_parts(wanted: Sequence[str], known: Sequence[Part], where: str) -> tuple[Part, ...]:
    """Find the parts that are meant by numbers (``3``, ``3,7``), ranges (``10-19``) and titles.

    Raises
    ------
    FormatError
        If a number or title is no part's, a range holds none, or a title is that of several; ``where`` is named.

    Examples
    --------
    >>> select_parts(["roof", "2-9"], [Part(1, "roof"), Part(2, "door"), Part(7, "seat, left")], "run1")
    (Part(id=1, title='roof'), Part(id=2, title='door'), Part(id=7, title='seat, left'))
    """
    if not known:
        raise FormatError(f"{where}: no parts with histories of their own; add the matsum, binout or T01 of the run")
    titled: dict[str, list[Part]] = {}
    for part in known:
        titled.setdefault(part.title.strip().casefold(), []).append(part)
    titled[""] = []  # is none
    found = dict.fromkeys(part for text in wanted for part in _meant(text, known, titled, where))
    return tuple(part for part in known if part in found)


def _meant(text: str, known: Sequence[Part], titled: Mapping[str, Sequence[Part]], where: str) -> Iterator[Part]:
    whole = titled.get(text.strip().casefold())
    if whole and "," in text:  # a title may hold a comma
        yield _only(whole, text, where)
        return
    for piece in text.split(","):
        yield from _piece(piece.strip(), known, titled.get(piece.strip().casefold()), where)


def _piece(piece: str, known: Sequence[Part], titled: Sequence[Part] | None, where: str) -> Sequence[Part]:
    numbers = re.fullmatch(_RANGE, piece)
    if not numbers:
        if not titled:
            near = near_miss(piece, [part.title for part in known])
            raise FormatError(f"{where}: no part {piece!r}{near}; there are: {menu(known)}")
        return [_only(titled, piece, where)]
    low, high = int(numbers[1]), int(numbers[2] or numbers[1])
    inside = [part for part in known if low <= part.id <= high]
    if titled and titled != inside:
        found = f"{where}: {piece!r} is the title of part {titled[0].id}, as a number it means {menu(inside) or 'none'}"
        raise FormatError(f"{found}; choose by a number or title that is one part's only")
    if not inside:
        raise FormatError(f"{where}: no part {piece}; there are: {menu(known)}")
    return inside


def _only(titled: Sequence[Part], text: str, where: str) -> Part:
    if len(titled) > 1:
        raise FormatError(f"{where}: {text!r} is the title of several parts, choose by number: {menu(titled)}")
    return titled[0]


def menu(parts: Sequence[Part]) -> str:
    """Parts for a message: number and title."""
    return listing([f"{part.id} {part.title!r}" if part.title else str(part.id) for part in parts])


def asks_for_recommended(texts: Sequence[str], parts: Iterable[Part]) -> bool:
    """Whether texts hold the word "recommended", and no part has it for its title."""
    titles = {part.title.strip().casefold() for part in parts}
    return "recommended" in {text.strip().casefold() for text in texts} - titles
