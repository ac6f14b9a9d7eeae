"""What a column, a curve or a dataset holds, by its name: one matcher for tables, curves, HDF5 and solver databases.

A name is cut into words, without its unit.  The phrases of `d2rpick.histories.names` are searched among these words,
the longest first.  Words for the whole model change nothing ("Global Kinetic Energy", "ALLKE for Whole Model"); with
any other word the column holds the quantity of something else, such as a part ("Kinetic energy of the door").
"""

from __future__ import annotations

import re
from functools import lru_cache
from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import FormatError, listing
from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.names import (
    INTERNAL_ENERGY,
    QUANTITIES,
    TIME_NAMES,
    normalised,
    without_unit,
)

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping, Sequence

# Ranks of a match: the quantity and nothing else; with words for the whole model; with words for something else.
EXACT: Final = 0
WHOLE_MODEL: Final = 1
OF_SOMETHING_ELSE: Final = 2

# Words that name the whole model, or the file or group that a quantity comes from.
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
# Words around a time that leave it the time of the states; "wall", "cpu" and "step" do not.
_TIME_WORDS: Final = frozenset(
    {"total", "simulation", "simulated", "sim", "analysis", "elapsed", "current", "physical", "solution", "whole"}
)  # fmt: skip
_NUMBERING: Final = re.compile(
    r"(?i)^\s*(?:(?:curve|plot|line)\s*)?#?\d+\s*[.:)-]\s+"
)  # "2. Kinetic energy", "Curve 2: KE"
_SOURCE: Final = re.compile(r"t\d\d")  # a time history of Radioss, as T01
# The dataset of a quantity whose name is that of the group around it: H5MD and others.
_UNNAMED_STEPS: Final = frozenset({"value", "values", "data", "res", "y"})
_STEPS_BESIDE: Final = frozenset(
    {"step", "steps", "count", "error", "index", "cycle"}
)  # datasets beside the values

_WORD: Final = re.compile(r"[^\W_]+")
_CAMEL_CASE: Final = re.compile(r"(?<=[a-zà-ÿ])(?=[A-Z])")
# Letters with accents, which files lose and keep as they like.
_PLAIN_LETTERS: Final = str.maketrans(
    "àáâãäåçèéêëìíîïñòóôõöùúûüýÿąćęłńśźżčšžř", "aaaaaaceeeeiiiinooooouuuuyyacelnszzcszr"
)
_LONGEST_PHRASE: Final = 5  # words

# Words that make something else of an internal energy of something: KE in capitals only, as "make" has it too.
_OTHER_QUANTITY: Final = (
    r"(?i:kinetic|kinen|\ball(?:ke|pd|se|ae|wk|fd|vd|cd|dmd|mw)|etotal|total.?energy|hourglass|hgeng|eroded"
    r"|dissipat|plastic|damping|sliding|contact|friction|external|work|stonewall|rigidwall"
    r"|accel|veloc|displac|moment|force|pressure|stress|strain(?!.?en)|temperature|ratio|mass|time.?step)"
    r"|(?<![A-Z])KE(?![A-Z])"
)
ROTATION_ENERGY: Final = (
    "rotationenergy"  # normalised: Radioss writes it beside the kinetic energy
)
# What else names an energy: identifiers of Abaqus, and "energy" in other languages without spaces.
_LIKE_AN_ENERGY: Final = (
    r"all[a-z]{2,3}|ke|ie|hge?|e?kin[a-z]*|.*(?:energ|エネルギー|能量|에너지).*"
)


class Meaning(NamedTuple):
    """What a name says: the key of a quantity, by which of the ranks it was found, and the words for something else."""

    quantity: str
    rank: int
    others: tuple[str, ...] = ()


def _list_phrases() -> Iterator[tuple[str, str]]:
    for quantity, names in {"internal_energy": INTERNAL_ENERGY, **QUANTITIES}.items():
        for name in names:
            yield name.translate(_PLAIN_LETTERS), quantity


_PHRASES: Final[Mapping[str, str]] = dict(_list_phrases())
_MOST_NAMED: Final = 6  # energies in one note


@lru_cache(maxsize=1 << 16)  # the same names are looked up again and again
def find_meaning(name: str) -> Meaning | None:
    """Return the quantity that a name says, with its rank; None if it says none, or several.

    The name may be a path: its last step decides, if that says something.

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
    whole = _match_words(_words_of("/".join(steps)))
    if len(steps) == 1 or (
        whole and whole.quantity == "energy_ratio"
    ):  # "total energy / initial energy"
        return whole
    if steps[-1].casefold() in _STEPS_BESIDE or is_time(steps[-1]):
        return None
    last = _match_words(_words_of(steps[-1]))
    return last if last and last.rank < OF_SOMETHING_ELSE else whole


def _words_of(name: str) -> list[str]:
    """Cut a name into words: small letters without accents, no unit, "totalKineticEnergy" as three words."""
    text = (
        _CAMEL_CASE.sub(" ", without_unit(_NUMBERING.sub("", name)))
        .casefold()
        .translate(_PLAIN_LETTERS)
    )
    return [word for word in _WORD.findall(text) if not _SOURCE.fullmatch(word)]


def _match_words(words: Sequence[str]) -> Meaning | None:
    quantities: set[str] = set()
    others: list[str] = []
    rank, place = EXACT, 0
    while place < len(words):
        length = _phrase_length(words, place)
        if length:
            quantities.add(_PHRASES["".join(words[place : place + length])])
        elif words[place] in _WHOLE_MODEL_WORDS:
            rank = max(rank, WHOLE_MODEL)
        else:
            others.append(words[place])
            rank = OF_SOMETHING_ELSE
        place += length or 1
    return (
        Meaning(quantities.pop(), rank, tuple(others)) if len(quantities) == 1 else None
    )


def _phrase_length(words: Sequence[str], place: int) -> int:
    """Return how many words from ``place`` on make the longest phrase, 0 if none does."""
    longest = min(_LONGEST_PHRASE, len(words) - place)
    for length in range(longest, 0, -1):
        if "".join(words[place : place + length]) in _PHRASES:
            return length
    return 0


@lru_cache(maxsize=1 << 16)
def is_time(name: str) -> bool:
    """Return True if a column of this name holds the times of the states.

    Examples
    --------
    >>> [name for name in ("Time (ms)", "t in ms", "Zeit [s]", "Total Time", "Time step", "wall time") if is_time(name)]
    ['Time (ms)', 't in ms', 'Zeit [s]', 'Total Time']
    """
    words = _words_of(name)
    if "".join(words) in TIME_NAMES:
        return True
    others = [word for word in words if word not in _TIME_WORDS]
    return "".join(others) in TIME_NAMES


def is_internal_energy(name: str) -> bool:
    """Return True if a name says internal energy without addition."""
    return find_meaning(name) == Meaning("internal_energy", EXACT)


def is_any_internal_energy(name: str) -> bool:
    """Return True if a name says internal energy of the model, or of something else."""
    meaning = find_meaning(name)
    return meaning is not None and meaning.quantity == "internal_energy"


def is_total_internal_energy(name: str) -> bool:
    """Return True if a name says internal energy of the whole model in so many words: "Total internal energy"."""
    meaning = find_meaning(name)
    return meaning is not None and meaning[:2] == ("internal_energy", WHOLE_MODEL)


def find_internal_energies(names: Sequence[str]) -> list[int]:
    """Return the places of the names that say internal energy without addition or, if there are none, with any.

    A total is not preferred to the energies of parts: which of them is to be locked in, only the user knows.
    """
    exact, others = list[int](), list[int]()
    for place, name in enumerate(names):
        meaning = find_meaning(name)
        if meaning is None or meaning.quantity != "internal_energy":
            continue
        if meaning.rank == EXACT:
            exact.append(place)
        elif meaning.rank == WHOLE_MODEL or not re.search(
            _OTHER_QUANTITY, name
        ):  # not "dissipated internal energy"
            others.append(place)
    return exact or others


def quantity_of(name: str) -> str | None:
    """Return which of `QUANTITIES` of the whole model a channel of this name holds, None for any other.

    Examples
    --------
    >>> [quantity_of(name) for name in ("KINETIC ENERGY", "glstat/global_x_velocity", "momentum_z [N s]", "boxKE_J")]
    ['kinetic_energy', 'x_velocity', 'z_momentum', None]
    """
    meaning = find_meaning(name)
    if (
        meaning is None
        or meaning.rank == OF_SOMETHING_ELSE
        or meaning.quantity not in QUANTITIES
    ):
        return None
    return meaning.quantity


def find_quantities(names: Sequence[str]) -> dict[str, list[str]]:
    """Return, for each of `QUANTITIES`, the names of the best rank that say it.

    If the only internal energy is that of something else, quantities of the same thing are taken: it is what the table
    is about.  A column that is called "total" holds the total energy if there is a kinetic energy beside it.

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
            ranked.setdefault(meaning.quantity, {}).setdefault(meaning.rank, []).append(
                name
            )
    found = {
        quantity: names_by_rank[min(names_by_rank)]
        for quantity, names_by_rank in ranked.items()
    }
    if "kinetic_energy" in found and "total_energy" not in found:
        totals = [name for name in names if _is_bare_total(name)]
        if totals:
            found["total_energy"] = totals
    return found


def _find_subject(names: Sequence[str]) -> tuple[str, ...]:
    """Return the words for what the only internal energy belongs to; none if there are several or no such words."""
    places = find_internal_energies(names)
    meaning = find_meaning(names[places[0]]) if len(places) == 1 else None
    return meaning.others if meaning else ()


def _is_bare_total(name: str) -> bool:
    words = [
        word for word in _words_of(name.rpartition("/")[2]) if word not in _ENERGY_WORDS
    ]
    return words == ["total"]


def note_unused_energies(
    channels: Sequence[str], used: Collection[str]
) -> tuple[str, ...]:
    """Return a note on the channels that look like energies and are not ``used``, none if there are none.

    Examples
    --------
    >>> note_unused_energies(["IE", "kinetic energy of the door", "z"], ["IE"])
    ("'kinetic energy of the door' (kinetic_energy?) looks like an energy but is not used; if it is one of the \
whole model, name it with `channel`, as in kinetic_energy=NAME",)
    """
    unused = [
        name for name in channels if name not in used and _looks_like_an_energy(name)
    ]
    if not unused:
        return ()
    texts = []
    for name in unused:
        meaning = find_meaning(name)
        texts.append(f"{name!r} ({meaning.quantity}?)" if meaning else repr(name))
    named = listing(texts, most=_MOST_NAMED)
    if len(unused) == 1:
        found = f"{named} looks like an energy but is not used; if it is one"
    else:
        found = f"{named} look like energies but are not used; if one is"
    return (
        f"{found} of the whole model, name it with `channel`, as in kinetic_energy=NAME",
    )


def _looks_like_an_energy(name: str) -> bool:
    if normalised(name) == ROTATION_ENERGY:  # added to the kinetic energy
        return False
    meaning = find_meaning(name)
    if meaning is not None:
        return meaning.quantity.endswith(("energy", "work"))
    return any(re.fullmatch(_LIKE_AN_ENERGY, word) for word in _words_of(name))


def note_other_quantity(channel: str) -> tuple[str, ...]:
    """Return a note if a channel that is used as internal energy is called something else.

    Examples
    --------
    >>> note_other_quantity("boxIE_J")
    ()
    >>> note_other_quantity("ALLKE for Whole Model")
    ("'ALLKE for Whole Model' is not an internal energy by its name (ALLKE); it was used as it is",)
    """
    word = _word_of_other_quantity(channel)
    if not word:
        return ()
    return (
        f"{channel!r} is not an internal energy by its name ({word}); it was used as it is",
    )


def refuse_other_quantity(channel: str, where: str) -> None:
    """Raise FormatError if the only column or curve of a file is called something else than an internal energy."""
    word = _word_of_other_quantity(channel)
    if word:
        found = f"{where}: the only values are {channel!r}, by its name not an internal energy ({word})"
        raise FormatError(f"{found}; choose with `energy` what to take for it")


def _word_of_other_quantity(channel: str) -> str:
    """Return what makes a name that of something else than an internal energy, or nothing."""
    meaning = find_meaning(channel)
    if (
        meaning
        and meaning.quantity == "internal_energy"
        and meaning.rank < OF_SOMETHING_ELSE
    ):
        return ""
    word = re.search(_OTHER_QUANTITY, channel)
    if word:
        return word[0]
    return (
        meaning.quantity.replace("_", " ")
        if meaning and meaning.quantity in QUANTITIES
        else ""
    )
