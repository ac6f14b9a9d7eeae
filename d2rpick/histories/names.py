"""Interpret the names of columns, units and parts, and find the names that the user selects."""

from __future__ import annotations

import os
import re
from collections import Counter
from functools import lru_cache
from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import FormatError, list_names
from d2rpick.base.tuples import NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

# Smallest similarity of a suggested file name [-]; it is high, because equal suffixes alone make names similar.
_LIKENESS: Final = 0.8
TIME_UNITS = frozenset(
    {"s", "sec", "second", "seconds", "ms", "msec", "us", "µs", "μs", "ns", "min", "h"}
)
_ENERGY_UNITS = frozenset(
    {"j", "kj", "mj", "gj", "µj", "μj", "uj", "nj", "joule", "joules", "nm", "nmm", "n*m", "n*mm", "n.m", "n.mm", "n·m",
     "n·mm", "n-mm", "n-m", "knm", "knmm", "kn*mm", "kn.mm", "kn·mm", "kn*m", "kn-mm", "kn-m", "erg", "lbf*in",
     "lbf-in", "lbf·in", "in-lbf", "in*lbf", "ft-lbf", "ft*lbf"}
)  # fmt: skip
_UNITS = TIME_UNITS | _ENERGY_UNITS
# Pattern of a unit in brackets: symbols with prefixes, and signs between the symbols ("N·mm", "-").
_PREFIXED: Final = "[pnuµμmckdhgt]?(?:j|n|m|g|s|pa|wh?|ev|cal)"
_SYMBOL: Final = rf"(?:{_PREFIXED}|m?sec|min|h|joules?|seconds?|kg|tonnes?|tons?|t|lbf?|in|ft|erg|slug)"
_UNIT: Final = rf"(?i:(?:1/)?{_SYMBOL}(?:[\s*·⋅.\-/^]*(?:{_SYMBOL}|[-+]?\d))*|-|%|)"

# Names that denote a time, in normalised form.
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

# Normalised names of other quantities of the whole model: energies, momentum, velocity and mass.
# The names of quantities come from LS-DYNA, Radioss, Abaqus, Exodus, lasso-python and several languages.
# In Abaqus, the internal energy contains the artificial energy; other solvers list the hourglass energy separately.
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

# These patterns are compiled on first use to keep start-up fast.
_BRACKETS: Final = r"[(\[]\s*([^()\[\]]*?)\s*[)\]]"
_TAIL: Final = r"^(.*[^/_,\s])\s*[/_,\s]\s*([^/_,\s]+)$"
_TWO_WORD_UNIT: Final = r"[/_,\s]\s*(k?N\s+m{1,2})$"

# Smallest number of leading letters that can identify a name.
_SHORTEST_BEGINNING: Final = 3
# Pattern of a part id or a range of part ids; a string with more digits is treated as a title.
_RANGE = r"(\d{1,18})(?:\s*-\s*(\d{1,18}))?"


def find_unit(name: str) -> str:
    """Return the unit at the end of a column name: in brackets, or after ``in``, ``/``, ``_``, ``,`` or a space.

    Examples
    --------
    >>> [find_unit(name) for name in ("Time (ms)", "t/ms", "time_s", "t in ms")]
    ['ms', 'ms', 's', 'ms']
    >>> [find_unit(name) for name in ("Internal Energy [J]", "time", "part_3")]
    ['J', '', '']
    """
    name = name.strip()
    brackets = [
        match for match in re.finditer(_BRACKETS, name) if match.end() == len(name)
    ]
    if brackets:
        return brackets[0][1] if re.fullmatch(_UNIT, brackets[0][1]) else ""
    two_words = re.search(_TWO_WORD_UNIT, name)
    if two_words:
        return two_words[1]
    tail = re.match(_TAIL, name)
    return tail[2] if tail and tail[2].casefold() in _UNITS else ""


def find_energy_unit(name: str) -> str:
    """Return the unit at the end of an energy name; empty if there is none, or if it is not an energy unit.

    Examples
    --------
    >>> [find_energy_unit(name) for name in ("Internal energy [mJ]", "IE_kJ", "energy_s", "ratio (-)")]
    ['mJ', 'kJ', '', '']
    """
    return check_energy_unit(find_unit(name))


def check_energy_unit(unit: str) -> str:
    """Return a unit unchanged if it is an energy unit, otherwise an empty string.

    Examples
    --------
    >>> check_energy_unit("N*mm"), check_energy_unit("ms")
    ('N*mm', '')
    """
    return unit if unit.casefold().replace(" ", "*") in _ENERGY_UNITS else ""


def remove_unit(name: str) -> str:
    """Return a name without its unit and without the word before the unit. Brackets that contain no unit are kept.

    Examples
    --------
    >>> [remove_unit(name) for name in ("t in ms", "Energy(J): ALLKE", "Energy (kinetic) [N mm]", "KE_kJ")]
    ['t', 'Energy: ALLKE', 'Energy (kinetic)', 'KE']
    """
    name = re.sub(_BRACKETS, _drop_unit, name).strip()
    unit = find_unit(name)
    if unit and name.endswith(unit):
        name = name[: -len(unit)].rstrip(" /_,\t")
    return name.removesuffix(" in")


def _drop_unit(brackets: re.Match[str]) -> str:
    """Return a text in brackets, or an empty string if the text contains a unit."""
    return "" if re.fullmatch(_UNIT, brackets[1]) else brackets[0]


@lru_cache(maxsize=1 << 16)  # The same names are looked up repeatedly.
def normalise_name(name: str) -> str:
    """Reduce a name to its letters and digits, in lower case and without the unit.

    Examples
    --------
    >>> [normalise_name(name) for name in ("Internal_Energy (J)", "t/ms", "IE_J", "E int")]
    ['internalenergy', 't', 'ie', 'eint']
    """
    return "".join(
        letter for letter in remove_unit(name).casefold() if letter.isalnum()
    )


def is_unit(cell: str) -> bool:
    """Return True if a cell may belong to a row of units: ``ms``, ``in mJ``, ``[J]``, ``(-)``, or empty."""
    cell = cell.removeprefix("in ")
    if cell.casefold() in _UNITS | {"", "-", "1"}:
        return True
    return cell[:1] + cell[-1:] in ("()", "[]")


def match_names(wanted: str, names: Sequence[str]) -> list[int]:
    """Return the indices of the names that match ``wanted`` exactly or, if none do, apart from case and unit."""
    spellings: tuple[Callable[[str], str], ...] = (
        str.strip,
        lambda text: text.strip().casefold(),
        normalise_name,
    )
    for spelling in spellings:
        indices = [
            index
            for index, name in enumerate(names)
            if spelling(name) == spelling(wanted)
        ]
        if indices:
            return indices
    return []


def resolve_name(wanted: str, names: Sequence[str], where: str) -> str:
    """Return the only matching name. If no name or several names match, raise a FormatError with similar names.

    Examples
    --------
    >>> resolve_name("internal energy", ["kinetic_energy", "internal_energy"], "binout")
    'internal_energy'
    """
    same = [names[index] for index in match_names(wanted, names)]
    if not same:
        raise FormatError(
            f"{where}: no {wanted!r}{suggest_name(wanted, names)}; there are: {list_names(names)}"
        )
    if len(same) > 1:
        raise FormatError(
            f"{where}: {wanted!r} may be any of these: {list_names(same)}; choose one as it is written"
        )
    return same[0]


def suggest_name(wanted: str, names: Sequence[str], likeness: float = 0.6) -> str:
    """Return a question that suggests the most similar name; empty if no similarity reaches ``likeness`` (0 to 1).

    If no name is similar, the only name that begins with the wanted string is proposed.

    Examples
    --------
    >>> suggest_name("kinetic", ["kinetic_energy", "x_momentum"])
    " (did you mean 'kinetic_energy'?)"
    """
    import difflib

    folded = {name.casefold(): name for name in names}
    beginning = wanted.casefold()
    close = difflib.get_close_matches(beginning, folded, n=1, cutoff=likeness)
    if not close and len(beginning) >= _SHORTEST_BEGINNING:
        longer_names = [name for name in folded if name.startswith(beginning)]
        close = longer_names if len(longer_names) == 1 else []
    return f" (did you mean {folded[close[0]]!r}?)" if close else ""


def suggest_file(name: str) -> str:
    """Return a question that suggests a file or folder with a similar name in the same folder; empty if none is."""
    folder, wanted = os.path.split(name)
    try:
        siblings = os.listdir(folder or ".")  # noqa: PTH208  pathlib would slow down start-up
    except OSError:
        return ""
    with_space = [name for name in siblings if wanted and name.startswith(f"{wanted} ")]
    if len(with_space) == 1:
        return (
            f" (did you mean {with_space[0]!r}? Put quotes around a name with spaces)"
        )
    return suggest_name(wanted, siblings, _LIKENESS)


def clean_text(raw: bytes) -> str:
    r"""Return the text of a fixed-width field without padding; bytes that are not text become spaces.

    Examples
    --------
    >>> clean_text(b" shell \xe9 \n\0\0  ")
    'shell é'
    """
    try:
        text = raw.decode("utf-8")
    except UnicodeDecodeError:
        text = raw.decode("latin-1")
    return "".join(letter if letter.isprintable() else " " for letter in text).strip()


def number_in_family(name: str, first: str) -> int | None:
    """Return the number that a file name appends to the name of its family's first file; None if it appends none.

    Examples
    --------
    >>> number_in_family("run/d3plot07", "run/d3plot"), number_in_family("run/d3plotaa", "run/d3plot")
    (7, None)
    """
    number = name[len(first) :] if name.startswith(first) else ""
    is_number = number.isascii() and number.isdigit()
    return int(number) if is_number and 2 <= len(number) <= 9 else None


class Part(NamedTuple):
    """A part of the model, with its number and title in the solver files."""

    id: int
    title: str

    @property
    def name(self) -> str:
        """Title of the part; if it has no title, its number."""
        return self.title or f"part {self.id}"


class Namesake(Part):
    """A part whose title is not unique, so that its name contains its number."""

    __slots__ = ()

    @property
    def name(self) -> str:
        """Title and number of the part."""
        return f"{self.title} ({self.id})"


def mark_namesakes(parts: Iterable[Part]) -> tuple[Part, ...]:
    """Add the number to the names of parts with the same title.

    Examples
    --------
    >>> [part.name for part in mark_namesakes([Part(1, "shell"), Part(2, "door"), Part(7, "shell"), Part(9, "")])]
    ['shell (1)', 'door', 'shell (7)', 'part 9']
    """
    listed = tuple(parts)
    counts = Counter(part.title for part in listed if part.title)
    return tuple(Namesake(*part) if counts[part.title] > 1 else part for part in listed)


class Selection(NamedTuple):
    """The selected columns (by name, number or label) and parts (by number, range or title).

    An empty selection stands for the time and the internal energy of the whole model. If several energies or parts are
    selected, their energies are added. ``flying`` contains the parts that are known to fly together with the selected
    ones. ``channels`` contains pairs of a quantity (a key of `d2rpick.histories.names.QUANTITIES`) and the name of its
    channel if this is not a usual name. ``springs`` contains the numbers of the parts that are springs or dampers; None
    if they are to be found from their energies.
    """

    time: str | None = None
    energy: tuple[str, ...] = ()
    parts: tuple[str, ...] = ()
    flying: tuple[str, ...] = ()
    channels: tuple[tuple[str, str], ...] = ()
    springs: tuple[str, ...] | None = None


def select_parts(
    wanted: Sequence[str], parts: Sequence[Part], where: str
) -> tuple[Part, ...]:
    """Return the parts selected by numbers (``3``, ``3,7``), ranges (``10-19``) and titles.

    Raises
    ------
    FormatError
        If no part has a given number or title, a range contains no part, or several parts have the same title; the
        message names ``where``.

    Examples
    --------
    >>> select_parts(["roof", "2-9"], [Part(1, "roof"), Part(2, "door"), Part(7, "seat, left")], "run1")
    (Part(id=1, title='roof'), Part(id=2, title='door'), Part(id=7, title='seat, left'))
    """
    if not parts:
        raise FormatError(
            f"{where}: no parts with histories of their own; add the matsum, binout or T01 of the run"
        )
    titled: dict[str, list[Part]] = {}
    for part in parts:
        titled.setdefault(part.title.strip().casefold(), []).append(part)
    titled[""] = []  # An empty title selects no part.
    selected: set[Part] = set()
    for text in wanted:
        selected.update(_match_parts(text, parts, titled, where))
    return tuple(part for part in parts if part in selected)


def _match_parts(
    text: str, parts: Sequence[Part], titled: Mapping[str, Sequence[Part]], where: str
) -> Iterator[Part]:
    """Yield the parts that a string selects: one title, or numbers, ranges and titles separated by commas."""
    whole = titled.get(text.strip().casefold())
    if whole and "," in text:  # A title may contain a comma.
        yield _choose_only_part(whole, text, where)
        return
    for piece in text.split(","):
        yield from _match_piece(
            piece.strip(), parts, titled.get(piece.strip().casefold()), where
        )


def _match_piece(
    piece: str, parts: Sequence[Part], titled: Sequence[Part] | None, where: str
) -> Sequence[Part]:
    """Return the parts selected by a number, range or title; ``titled`` are the parts with this string as title."""
    numbers = re.fullmatch(_RANGE, piece)
    if not piece and not titled:
        raise FormatError(
            f"{where}: the id or title of a part is missing; there are: {list_parts(parts)}"
        )
    if not numbers:
        if not titled:
            near = suggest_name(piece, [part.title for part in parts])
            if re.fullmatch(r"\d+( +\d+)+", piece):
                near = f" (separate parts by commas: {','.join(piece.split())})"
            raise FormatError(
                f"{where}: no part {piece!r}{near}; there are: {list_parts(parts)}"
            )
        return [_choose_only_part(titled, piece, where)]
    low = int(numbers[1])
    high = int(numbers[2] or numbers[1])
    inside = [part for part in parts if low <= part.id <= high]
    if titled and titled != inside:
        problem = f"{where}: {piece!r} is the title of part {titled[0].id}, as a number it means"
        raise FormatError(
            f"{problem} {list_parts(inside) or 'none'}; choose by a number or title that is one part's only"
        )
    if high < low:
        raise FormatError(
            f"{where}: the range {piece} runs backwards; write {high}-{low}"
        )
    if not inside:
        raise FormatError(
            f"{where}: no part {piece} (expected part ids, not set ids); there are: {list_parts(parts)}"
        )
    return inside


def _choose_only_part(titled: Sequence[Part], text: str, where: str) -> Part:
    """Return the only part with a given title; raise FormatError if there are several."""
    if len(titled) > 1:
        raise FormatError(
            f"{where}: {text!r} is the title of several parts, choose by number: {list_parts(titled)}"
        )
    return titled[0]


def list_parts(parts: Sequence[Part]) -> str:
    """Return the numbers and titles of parts for a message."""
    return list_names(
        [f"{part.id} {part.title!r}" if part.title else str(part.id) for part in parts]
    )


def has_recommended(texts: Sequence[str], parts: Iterable[Part]) -> bool:
    """Return True if one of the strings is the word "recommended" and no part has this title."""
    titles = {part.title.strip().casefold() for part in parts}
    return "recommended" in {text.strip().casefold() for text in texts} - titles
