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

TIME_UNITS = frozenset(
    {"s", "sec", "second", "seconds", "ms", "msec", "us", "µs", "μs", "ns", "min", "h"}
)
_ENERGY_UNITS = frozenset(
    {"j", "kj", "mj", "gj", "µj", "μj", "uj", "nj", "joule", "joules", "nm", "nmm", "n*m", "n*mm", "n.m", "n.mm", "n·m",
     "n·mm", "n-mm", "n-m", "knm", "knmm", "kn*mm", "kn.mm", "kn·mm", "kn*m", "kn-mm", "kn-m", "erg", "lbf*in",
     "lbf-in", "lbf·in", "in-lbf", "in*lbf", "ft-lbf", "ft*lbf"}
)  # fmt: skip
_UNITS = TIME_UNITS | _ENERGY_UNITS
# A unit in brackets: symbols with prefixes, and what joins them ("kg mm^2/ms^2", "N·mm", "-").
_PREFIXED: Final = "[pnuµμmckdhgt]?(?:j|n|m|g|s|pa|wh?|ev|cal)"
_SYMBOL: Final = rf"(?:{_PREFIXED}|m?sec|min|h|joules?|seconds?|kg|tonnes?|tons?|t|lbf?|in|ft|erg|slug)"
_UNIT: Final = rf"(?i:(?:1/)?{_SYMBOL}(?:[\s*·⋅.\-/^]*(?:{_SYMBOL}|[-+]?\d))*|-|%|)"

# Names are `normalised`, and taken whole.
TIME_NAMES: Final = frozenset(
    {"time", "t", "times", "timewhole", "zeit", "temps", "tempo", "tiempo", "tijd", "tid", "czas", "时间", "時間",
     "시간", "время"}
)  # fmt: skip
INTERNAL_ENERGY: Final = frozenset(
    {"internalenergy", "energyinternal", "internal", "ie", "allie", "inten", "eint", "eintern", "einternal",
     "enint", "inte", "intenergy", "energyint", "internalen", "intenergie", "innereenergie", "innereenergy",
     "innerenergy", "interneenergie", "internenergie", "internenergi", "inreenergi", "innenenergie",
     "inwendigeenergie", "energieinterne", "energiainterna", "energiainternal", "energiawewnetrzna",
     "внутренняяэнергия", "内部エネルギー", "内能", "내부에너지"}
)  # fmt: skip

# What else a history of the whole model holds, and what it is called: by glstat and binout of LS-DYNA, by Radioss and
# its th_to_csv, Abaqus, Exodus, frames of lasso-python and d2rpick; in other languages.  Energies [energy], momentum
# and velocity of the centre of mass along an axis [momentum], [velocity], and the mass of what moves [mass].
# The artificial energy of Abaqus is a part of its internal energy; the hourglass energy of others is beside it.
QUANTITIES: Final[Mapping[str, frozenset[str]]] = {
    "kinetic_energy": frozenset(
        {"kineticenergy", "energykinetic", "kinetic", "ke", "allke", "kinen", "kinenergy", "energykin", "kine", "ekin",
         "ekinetic", "enkin", "ek", "kinetische", "kinetischeenergie", "kinenergie", "energiekin", "bewegungsenergie",
         "energiecinetique", "cinetique", "energiacinetica", "cinetica", "kinetiskenergi", "energiakinetyczna",
         "кинетическаяэнергия", "运动能", "动能", "動能", "運動エネルギー", "운동에너지"}
    ),
    "total_energy": frozenset(
        {"totalenergy", "energytotal", "etotal", "etot", "totenergy", "totalen", "gesamtenergie", "totaleenergie",
         "energietotale", "energiatotal", "energiatotale", "totaalenergie", "полнаяэнергия", "总能量", "总能",
         "全エネルギー", "총에너지"}
    ),
    "external_work": frozenset(
        {"externalwork", "workexternal", "extwork", "allwk", "wext", "externalforcework", "workofexternalforces",
         "externalenergy", "aussererarbeit", "ausserearbeit", "externearbeit", "travailexterne", "lavoroesterno",
         "trabajoexterno", "外力功", "外力仕事"}
    ),
    "contact_energy": frozenset(
        {"contactenergy", "energycontact", "slidinginterfaceenergy", "slidingenergy", "slidinginterface", "sliding",
         "contacte", "kontaktenergie", "energiedecontact", "energiadicontatto", "energiadecontacto"}
    ),
    "frictional_contact_energy": frozenset({"frictionalcontactenergy"}),
    "hourglass_energy": frozenset(
        {"hourglassenergy", "energyhourglass", "hourglasse", "hourglass", "hourglassing", "hourglassingenergy", "hgeng",
         "hgenergy", "sanduhrenergie"}
    ),
    "artificial_energy": frozenset({"allae", "artificialenergy", "artificialstrainenergy", "artificialstrain"}),
    "damping_energy": frozenset({"dampingenergy", "systemdampingenergy", "systemdamping", "dampfungsenergie"}),
    "eroded_internal_energy": frozenset({"erodedinternalenergy", "erodedinternal"}),
    "energy_ratio": frozenset({"totalenergyinitialenergy", "energyratio", "energieverhaltnis"}),
    "x_momentum": frozenset({"xmomentum", "momentumx", "xmom", "px", "ximpuls", "impulsx"}),
    "y_momentum": frozenset({"ymomentum", "momentumy", "ymom", "py", "yimpuls", "impulsy"}),
    "z_momentum": frozenset({"zmomentum", "momentumz", "zmom", "pz", "zimpuls", "impulsz"}),
    "x_velocity": frozenset({"globalxvelocity", "xvelocity", "xrigidbodyvelocity"}),
    "y_velocity": frozenset({"globalyvelocity", "yvelocity", "yrigidbodyvelocity"}),
    "z_velocity": frozenset({"globalzvelocity", "zvelocity", "zrigidbodyvelocity"}),
    "mass": frozenset({"mass", "totalmass", "masse", "gesamtmasse"}),
}  # fmt: skip

_BRACKETS = re.compile(r"[(\[]\s*([^()\[\]]*?)\s*[)\]]")
_TAIL = re.compile(r"^(.*[^/_,\s])\s*[/_,\s]\s*([^/_,\s]+)$")
_TWO_WORD_UNIT = re.compile(r"[/_,\s]\s*(k?N\s+m{1,2})$")


def unit_of(name: str) -> str:
    """Return the unit a column's name ends with: in brackets, after ``in``, ``/``, ``_``, ``,`` or a blank.

    Examples
    --------
    >>> [unit_of(name) for name in ("Time (ms)", "t/ms", "time_s", "t in ms", "Internal Energy [J]", "time", "part_3")]
    ['ms', 'ms', 's', 'ms', 'J', '', '']
    """
    name = name.strip()
    brackets = [match for match in _BRACKETS.finditer(name) if match.end() == len(name)]
    if brackets:
        return brackets[0][1] if re.fullmatch(_UNIT, brackets[0][1]) else ""
    two_words = _TWO_WORD_UNIT.search(name)
    if two_words:
        return two_words[1]
    tail = _TAIL.match(name)
    return tail[2] if tail and tail[2].casefold() in _UNITS else ""


def without_unit(name: str) -> str:
    """Return a name without its unit and the word before it; a bracket that holds no unit stays.

    Examples
    --------
    >>> [without_unit(name) for name in ("t in ms", "Energy(J): ALLKE", "Energy (kinetic) [N mm]", "KE_kJ")]
    ['t', 'Energy: ALLKE', 'Energy (kinetic)', 'KE']
    """
    name = _BRACKETS.sub(_drop_unit, name).strip()
    unit = unit_of(name)
    if unit and name.endswith(unit):
        name = name[: -len(unit)].rstrip(" /_,\t")
    return name.removesuffix(" in")


def _drop_unit(brackets: re.Match[str]) -> str:
    return "" if re.fullmatch(_UNIT, brackets[1]) else brackets[0]


@lru_cache(maxsize=1 << 16)  # the same names are asked for again and again
def normalised(name: str) -> str:
    """Reduce a name to its letters and digits, in small letters and without its unit.

    Examples
    --------
    >>> [normalised(name) for name in ("Internal_Energy (J)", "t/ms", "IE_J", "E int")]
    ['internalenergy', 't', 'ie', 'eint']
    """
    return "".join(
        letter for letter in without_unit(name).casefold() if letter.isalnum()
    )


def is_unit(cell: str) -> bool:
    """Return True if a cell of a row of units may read like this: ``ms``, ``in mJ``, ``[J]``, ``(-)``, nothing."""
    cell = cell.removeprefix("in ")
    return cell.casefold() in _UNITS | {"", "-", "1"} or (
        bool(cell) and cell[0] + cell[-1] in ("()", "[]")
    )


def meant(wanted: str, known: Sequence[str]) -> list[int]:
    """Places of the names that are meant: as it stands, in other case, or but for blanks, underscores and units."""
    spellings: tuple[Callable[[str], str], ...] = (
        str.strip,
        lambda text: text.strip().casefold(),
        normalised,
    )
    alike = (
        [place for place, own in enumerate(known) if key(own) == key(wanted)]
        for key in spellings
    )
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
        raise FormatError(
            f"{where}: no {wanted!r}{near_miss(wanted, known)}; there are: {listing(known)}"
        )
    if len(same) > 1:
        raise FormatError(
            f"{where}: {wanted!r} may be any of these: {listing(same)}; choose one as it is written"
        )
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
    return (
        int(number)
        if 2 <= len(number) <= 9 and number.isascii() and number.isdigit()
        else None
    )


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


def select_parts(
    wanted: Sequence[str], known: Sequence[Part], where: str
) -> tuple[Part, ...]:
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
        raise FormatError(
            f"{where}: no parts with histories of their own; add the matsum, binout or T01 of the run"
        )
    titled: dict[str, list[Part]] = {}
    for part in known:
        titled.setdefault(part.title.strip().casefold(), []).append(part)
    titled[""] = []  # is none
    found = dict.fromkeys(
        part for text in wanted for part in _meant(text, known, titled, where)
    )
    return tuple(part for part in known if part in found)


def _meant(
    text: str, known: Sequence[Part], titled: Mapping[str, Sequence[Part]], where: str
) -> Iterator[Part]:
    whole = titled.get(text.strip().casefold())
    if whole and "," in text:  # a title may hold a comma
        yield _only(whole, text, where)
        return
    for piece in text.split(","):
        yield from _piece(
            piece.strip(), known, titled.get(piece.strip().casefold()), where
        )


def _piece(
    piece: str, known: Sequence[Part], titled: Sequence[Part] | None, where: str
) -> Sequence[Part]:
    numbers = re.fullmatch(_RANGE, piece)
    if not numbers:
        if not titled:
            near = near_miss(piece, [part.title for part in known])
            raise FormatError(
                f"{where}: no part {piece!r}{near}; there are: {menu(known)}"
            )
        return [_only(titled, piece, where)]
    low, high = int(numbers[1]), int(numbers[2] or numbers[1])
    inside = [part for part in known if low <= part.id <= high]
    if titled and titled != inside:
        found = f"{where}: {piece!r} is the title of part {titled[0].id}, as a number it means {menu(inside) or 'none'}"
        raise FormatError(
            f"{found}; choose by a number or title that is one part's only"
        )
    if not inside:
        raise FormatError(f"{where}: no part {piece}; there are: {menu(known)}")
    return inside


def _only(titled: Sequence[Part], text: str, where: str) -> Part:
    if len(titled) > 1:
        raise FormatError(
            f"{where}: {text!r} is the title of several parts, choose by number: {menu(titled)}"
        )
    return titled[0]


def menu(parts: Sequence[Part]) -> str:
    """Parts for a message: number and title."""
    return listing(
        [f"{part.id} {part.title!r}" if part.title else str(part.id) for part in parts]
    )


def asks_for_recommended(texts: Sequence[str], parts: Iterable[Part]) -> bool:
    """Whether texts hold the word "recommended", and no part has it for its title."""
    titles = {part.title.strip().casefold() for part in parts}
    return "recommended" in {text.strip().casefold() for text in texts} - titles
