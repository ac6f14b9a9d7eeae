"""Recognise the quantity in a column, curve or dataset from its name in tables, HDF5 files and databases.

A name is split into words, without its unit. The phrases of `d2rpick.histories.names` are compared with these words,
longest phrases first. Words that denote the whole model are ignored ("Global Kinetic Energy", "ALLKE for Whole Model").
If there is any other word, the quantity belongs to something else, such as a part ("Kinetic energy of the door").
"""

from __future__ import annotations

import re
from functools import lru_cache
from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import FormatError, list_names
from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.names import (
    INTERNAL_ENERGY,
    QUANTITIES,
    TIME_NAMES,
    normalise_name,
    remove_unit,
)

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping, Sequence

# Ranks of how well a column name matches a quantity, from best to worst.
# The rank depends on the words that a name contains in addition to the quantity.
EXACT: Final = 0
WHOLE_MODEL: Final = 1
OF_SOMETHING_ELSE: Final = 2

# Words that may occur next to the name of a quantity of the whole model.
_WHOLE_MODEL_WORDS: Final = frozenset(
    {"global", "globals", "globale", "total", "totals", "totale", "totaal", "whole", "complete", "entire", "all",
     "model", "modell", "modele", "modelo", "system", "sys", "sum", "summe", "gesamt", "gesamte", "gesamtes",
     "gesamter", "ganzes", "assembly", "assy", "structure", "ensemble", "for", "of", "the", "in", "on", "at", "to",
     "du", "de", "la", "le", "les", "des", "der", "die", "das", "im", "del", "di", "pour", "fur", "glstat",
     "binout", "history", "histories", "hist", "output", "results", "result", "data", "curve", "xy", "value",
     "values", "variable", "variables", "scalar", "observables", "energies", "energien", "energie", "energia",
     "energy", "radioss", "abaqus", "dyna", "lsdyna", "ls", "th", "parts"}
)  # fmt: skip
_ENERGY_WORDS: Final = frozenset(
    {"energy", "energies", "energie", "energien", "energia", "energias", "energi", "energii", "energiya", "en"}
)  # fmt: skip
# Words that may occur in the name of the time of the states, in contrast to "wall", "cpu" and "step".
_TIME_WORDS: Final = frozenset(
    {"total", "simulation", "simulated", "sim", "analysis", "elapsed", "current", "physical", "solution", "whole"}
)  # fmt: skip
# The patterns below are compiled on first use to keep start-up fast.
# Pattern of a number before a name, as in "2. Kinetic energy" or "Curve 2: KE".
_NUMBERING: Final = r"(?i)^\s*(?:(?:curve|plot|line)\s*)?#?\d+\s*[.:)-]\s+"
# Pattern of the name of a Radioss time history file, such as T01.
_SOURCE: Final = r"t\d\d"
# Names of datasets that hold the values of the quantity after which their group is named, as in H5MD.
_UNNAMED_STEPS: Final = frozenset({"value", "values", "data", "res", "y"})
# Names of datasets that are stored next to the values and contain no quantity.
_STEPS_BESIDE: Final = frozenset({"step", "steps", "count", "error", "index", "cycle"})

_WORD: Final = r"[^\W_]+"
_CAMEL_CASE: Final = r"(?<=[a-zà-ÿ])(?=[A-Z])"
# Accented letters and the letters that replace them, because files often lose accents.
_PLAIN_LETTERS: Final = str.maketrans(
    "àáâãäåçèéêëìíîïñòóôõöùúûüýÿąćęłńśźżčšžř", "aaaaaaceeeeiiiinooooouuuuyyacelnszzcszr"
)
_LONGEST_PHRASE: Final = 5  # Largest number of words in the name of a quantity.

# Pattern of words that indicate a quantity other than internal energy. KE must be in capitals (unlike in "make").
_OTHER_QUANTITY: Final = (
    r"(?i:kinetic|kinen|\ball(?:ke|pd|se|ae|wk|fd|vd|cd|dmd|mw)|etotal|total.?energy|hourglass|hgeng|eroded"
    r"|dissipat|plastic|damping|sliding|contact|friction|external|work|stonewall|rigidwall"
    r"|accel|veloc|displac|moment|force|pressure|stress|strain(?!.?en)|temperature|ratio|mass|time.?step)"
    r"|(?<![A-Z])KE(?![A-Z])"
)
# Pattern of a coordinate, velocity or acceleration, and of a unit at the end of a name that no energy has.
_OF_A_MOTION: Final = r"(?i:[uvar]?[xyz])"
_OTHER_UNIT: Final = r"(?i)[\s_/,(\[](?:[kcm]?m|[cm]?mps|[kcm]?m/m?s|deg|rad|k?N|[kMG]?Pa|kg|g|t|%)[)\]]?\s*$"
# Normalised name of the rotational energy, which Radioss writes although the kinetic energy includes it.
ROTATION_ENERGY: Final = "rotationenergy"
# Pattern of other energy names: Abaqus identifiers, and "energy" in other languages without spaces.
_LIKE_AN_ENERGY: Final = (
    r"all[a-z]{2,3}|ke|ie|hge?|e?kin[a-z]*|.*(?:energ|エネルギー|能量|에너지).*"
)

_MOST_NAMED: Final = 6  # Largest number of energies that a note names.


class Meaning(NamedTuple):
    """The meaning of a name: a quantity, the rank of its match, and the words that denote something else."""

    quantity: str
    rank: int
    others: tuple[str, ...] = ()


def _list_phrases() -> Iterator[tuple[str, str]]:
    """Yield each name of a quantity, without accents, together with the quantity."""
    for quantity, names in {"internal_energy": INTERNAL_ENERGY, **QUANTITIES}.items():
        for name in names:
            yield name.translate(_PLAIN_LETTERS), quantity


_PHRASES: Final[Mapping[str, str]] = dict(_list_phrases())


@lru_cache(maxsize=1 << 16)  # The results are cached, because the same names recur.
def find_meaning(name: str) -> Meaning | None:
    """Return the quantity that a name denotes, with the rank of the match; None if it denotes none or several.

    The name may be a path; its last component is used if it denotes a quantity.

    Examples
    --------
    >>> find_meaning("Kinetic energy: ALLKE for Whole Model")
    Meaning(quantity='kinetic_energy', rank=1, others=())
    >>> find_meaning("boxKE_J")
    Meaning(quantity='kinetic_energy', rank=2, others=('box',))
    >>> find_meaning("part_id") is None
    True
    """
    steps = name.split("/")
    while len(steps) > 1 and steps[-1].casefold() in _UNNAMED_STEPS:
        steps.pop()
    whole = _match_words(_split_words("/".join(steps)))
    # The name contains a slash but is not a path, e.g. "total energy / initial energy".
    if len(steps) == 1 or (whole and whole.quantity == "energy_ratio"):
        return whole
    if steps[-1].casefold() in _STEPS_BESIDE or is_time(steps[-1]):
        return None
    last = _match_words(_split_words(steps[-1]))
    return last if last and last.rank < OF_SOMETHING_ELSE else whole


def _split_words(name: str) -> list[str]:
    """Split a name into lower-case words without accents and unit; "totalKineticEnergy" gives three words."""
    text = re.sub(_CAMEL_CASE, " ", remove_unit(re.sub(_NUMBERING, "", name)))
    text = text.casefold().translate(_PLAIN_LETTERS)
    return [word for word in re.findall(_WORD, text) if not re.fullmatch(_SOURCE, word)]


def _match_words(words: Sequence[str]) -> Meaning | None:
    """Return the meaning of the words in a name; None unless they contain exactly one quantity."""
    quantities: set[str] = set()
    other_words: list[str] = []
    rank, position = EXACT, 0
    while position < len(words):
        length = _match_phrase(words, position)
        if length:
            quantities.add(_PHRASES["".join(words[position : position + length])])
        elif words[position] in _WHOLE_MODEL_WORDS:
            rank = max(rank, WHOLE_MODEL)
        else:
            other_words.append(words[position])
            rank = OF_SOMETHING_ELSE
        position += length or 1
    if len(quantities) != 1:
        return None
    return Meaning(quantities.pop(), rank, tuple(other_words))


def _match_phrase(words: Sequence[str], start: int) -> int:
    """Return the number of words of the longest phrase that begins at ``start``; 0 if no phrase begins there."""
    longest = min(_LONGEST_PHRASE, len(words) - start)
    for length in range(longest, 0, -1):
        if "".join(words[start : start + length]) in _PHRASES:
            return length
    return 0


@lru_cache(maxsize=1 << 16)
def is_time(name: str) -> bool:
    """Return True if a column with this name contains the times of the states.

    Examples
    --------
    >>> [name for name in ("Time (ms)", "t in ms", "Zeit [s]", "Total Time", "Time step", "wall time") if is_time(name)]
    ['Time (ms)', 't in ms', 'Zeit [s]', 'Total Time']
    """
    words = _split_words(name)
    if "".join(words) in TIME_NAMES:
        return True
    remaining = [word for word in words if word not in _TIME_WORDS]
    return "".join(remaining) in TIME_NAMES


def is_internal_energy(name: str) -> bool:
    """Return True if a name denotes internal energy and contains no other words."""
    return find_meaning(name) == Meaning("internal_energy", EXACT)


def is_any_internal_energy(name: str) -> bool:
    """Return True if a name denotes an internal energy, whether of the model or of something else."""
    meaning = find_meaning(name)
    return meaning is not None and meaning.quantity == "internal_energy"


def is_total_internal_energy(name: str) -> bool:
    """Return True if a name explicitly denotes the internal energy of the whole model: "Total internal energy"."""
    meaning = find_meaning(name)
    return meaning is not None and meaning[:2] == ("internal_energy", WHOLE_MODEL)


def find_internal_energies(names: Sequence[str]) -> list[int]:
    """Return the indices of the names that denote exactly an internal energy or, failing that, that mention one.

    A total is not preferred to the energies of parts, because only the user knows which energy is to be frozen.
    """
    exact = list[int]()
    inexact = list[int]()
    for index, name in enumerate(names):
        meaning = find_meaning(name)
        if meaning is None or meaning.quantity != "internal_energy":
            continue
        # The name of a different quantity may contain these words, e.g. "dissipated internal energy".
        is_other = re.search(_OTHER_QUANTITY, name)
        if meaning.rank == EXACT:
            exact.append(index)
        elif meaning.rank == WHOLE_MODEL or not is_other:
            inexact.append(index)
    return exact or inexact


def find_quantity(name: str) -> str | None:
    """Return the whole-model quantity in `QUANTITIES` that a name denotes; None for any other name.

    Examples
    --------
    >>> [find_quantity(name) for name in ("KINETIC ENERGY", "glstat/global_x_velocity", "momentum_z [N s]", "boxKE_J")]
    ['kinetic_energy', 'x_velocity', 'z_momentum', None]
    """
    meaning = find_meaning(name)
    if meaning is None or meaning.rank == OF_SOMETHING_ELSE:
        return None
    return meaning.quantity if meaning.quantity in QUANTITIES else None


def find_quantities(names: Sequence[str]) -> dict[str, list[str]]:
    """Return the names that best match each of the `QUANTITIES`, by quantity.

    If the only internal energy belongs to something other than the whole model, this is the subject of the table, and
    its other quantities are used. A column named "total" contains the total energy if there is also a kinetic energy.

    Examples
    --------
    >>> find_quantities(["KE", "Total kinetic energy", "momentum_x", "total"])
    {'kinetic_energy': ['KE'], 'x_momentum': ['momentum_x'], 'total_energy': ['total']}
    >>> find_quantities(["run 7: internal energy", "run 7: kinetic energy", "run 8: kinetic energy"])
    {'kinetic_energy': ['run 7: kinetic energy']}
    """
    subject = _find_subject(names)
    ranked: dict[str, dict[int, list[str]]] = {}
    for name in names:
        meaning = find_meaning(name)
        if meaning is None or meaning.quantity not in QUANTITIES:
            continue
        if meaning.rank < OF_SOMETHING_ELSE or meaning.others == subject:
            names_by_rank = ranked.setdefault(meaning.quantity, {})
            names_by_rank.setdefault(meaning.rank, []).append(name)
    quantities = {
        quantity: names_by_rank[min(names_by_rank)]
        for quantity, names_by_rank in ranked.items()
    }
    if "kinetic_energy" in quantities and "total_energy" not in quantities:
        totals = [name for name in names if _is_bare_total(name)]
        if totals:
            quantities["total_energy"] = totals
    return quantities


def _find_subject(names: Sequence[str]) -> tuple[str, ...]:
    """If exactly one name is that of an internal energy, return the words in it that identify the part or model.

    The result is empty if several names, or none, denote an internal energy.
    """
    indices = find_internal_energies(names)
    meaning = find_meaning(names[indices[0]]) if len(indices) == 1 else None
    return meaning.others if meaning else ()


def _is_bare_total(name: str) -> bool:
    """Return True if a name is "total", possibly together with a word for energy."""
    words = _split_words(name.rpartition("/")[2])
    words = [word for word in words if word not in _ENERGY_WORDS]
    return words == ["total"]


def note_unused_energies(
    channels: Sequence[str], used: Collection[str]
) -> tuple[str, ...]:
    """Return a note on channels that look like energies but are not ``used``; empty if there are none.

    Examples
    --------
    >>> note_unused_energies(["IE", "kinetic energy of the door", "z"], ["IE"])
    ("'kinetic energy of the door' (kinetic_energy?) looks like an energy but is not used; if it is one of the \
whole model, name it with `channel`, as in kinetic_energy=NAME",)
    """
    unused = [
        name for name in channels if name not in used and _has_name_of_energy(name)
    ]
    if not unused:
        return ()
    texts = []
    for name in unused:
        meaning = find_meaning(name)
        texts.append(f"{name!r} ({meaning.quantity}?)" if meaning else repr(name))
    names = list_names(texts, most=_MOST_NAMED)
    if len(unused) == 1:
        problem = f"{names} looks like an energy but is not used; if it is one"
    else:
        problem = f"{names} look like energies but are not used; if one is"
    return (
        f"{problem} of the whole model, name it with `channel`, as in kinetic_energy=NAME",
    )


def _has_name_of_energy(name: str) -> bool:
    """Return True if a name denotes an energy or work, or resembles such a name."""
    # The kinetic energy includes the rotational energy.
    if normalise_name(name) == ROTATION_ENERGY:
        return False
    meaning = find_meaning(name)
    if meaning is not None:
        return meaning.quantity.endswith(("energy", "work"))
    return any(re.fullmatch(_LIKE_AN_ENERGY, word) for word in _split_words(name))


def note_other_quantity(channel: str) -> tuple[str, ...]:
    """Return a note if the channel used as internal energy has the name of a different quantity.

    Examples
    --------
    >>> note_other_quantity("boxIE_J")
    ()
    >>> note_other_quantity("ALLKE for Whole Model")
    ("'ALLKE for Whole Model' is not an internal energy by its name (ALLKE); it was used as it is",)
    """
    word = _find_word_of_other_quantity(channel)
    if not word:
        return ()
    return (
        f"{channel!r} is not an internal energy by its name ({word}); it was used as it is",
    )


def note_missed_energy(
    chosen: Sequence[str], channels: Sequence[str]
) -> tuple[str, ...]:
    """Return a note if a channel without the name of an energy was chosen instead of an internal energy.

    Examples
    --------
    >>> note_missed_energy(["z"], ["z", "internal_energy"])
    ("'z' is not an energy by its name, but it was used; if 'internal_energy' was meant, give it as `energy`",)
    >>> note_missed_energy(["boxIE_J"], ["boxIE_J", "internal_energy"])
    ()
    """
    others = [channels[i] for i in find_internal_energies(channels)]
    odd = [name for name in chosen if not _has_name_of_energy(name)]
    if not odd or not others or {*others} & {*chosen}:
        return ()
    meant = " or ".join(map(repr, others[:_MOST_NAMED]))
    return (
        f"{odd[0]!r} is not an energy by its name, but it was used; if {meant} was meant, give it as `energy`",
    )


def refuse_other_quantity(channel: str, where: str) -> None:
    """Raise FormatError if the only column or curve of a file has the name of a different quantity."""
    word = _find_word_of_other_quantity(channel)
    if word:
        problem = f"{where}: the only data column is {channel!r}, whose name is not an internal energy ({word})"
        raise FormatError(
            f"{problem}; write the internal energy too, or give this name as `energy` if it is one after all"
        )


def may_be_energy(name: str) -> bool:
    """Return False if a name, or the unit at its end, denotes something other than an energy.

    Examples
    --------
    >>> [name for name in ("reference_m", "vz", "Displacement", "strain", "a", "E_kJ", "door") if may_be_energy(name)]
    ['a', 'E_kJ', 'door']
    """
    is_motion = re.fullmatch(_OF_A_MOTION, remove_unit(name)) is not None
    has_other_unit = re.search(_OTHER_UNIT, name) is not None
    return not (is_motion or has_other_unit or _find_word_of_other_quantity(name))


def _find_word_of_other_quantity(channel: str) -> str:
    """Return the word that shows that a name does not denote internal energy; empty if there is none."""
    meaning = find_meaning(channel)
    is_known = meaning is not None and meaning.rank < OF_SOMETHING_ELSE
    if meaning and meaning.quantity == "internal_energy" and is_known:
        return ""
    word = re.search(_OTHER_QUANTITY, channel)
    if word:
        return word[0]
    if meaning and meaning.quantity in QUANTITIES:
        return meaning.quantity.replace("_", " ")
    return ""
