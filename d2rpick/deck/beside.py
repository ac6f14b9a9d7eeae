"""Find the main deck of a run, or the history of a deck, by its name in the same folder, to name it in a command."""

from __future__ import annotations

import os
import re
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Sequence

# Placeholders in a command for the ids of parts, and for main nodes of rigid bodies, that no file names.
SOME_PARTS: Final = "IDS"
SOME_NODES: Final = "NODES"
_LS_DYNA_DECKS: Final = (".k", ".key", ".dyn")
# Histories in the order of preference: part energies before energies of the model.
_LS_DYNA_HISTORIES: Final = ("matsum", "binout", "binout0000", "d3plot", "glstat")
# Histories and decks of Radioss: the name of the run, and the number of the restart segment.
_RADIOSS_HISTORY: Final = r"(.+)T\d\d"
_RADIOSS_DECK: Final = r"(.+)_\d{4}\.rad"


def find_deck_beside(history: Sequence[str]) -> str | None:
    """Return the main deck in the folder of a history that has the same name; None if there is none.

    Examples
    --------
    >>> find_deck_beside(["sample_data/rollover_box.matsum"])
    'sample_data/rollover_box.k'
    >>> find_deck_beside(["sample_data/energy.glstat"]) is None
    True
    """
    if not history:
        return None
    folder, name = os.path.split(history[0])
    name = name.removesuffix(".gz")
    match = re.fullmatch(_RADIOSS_HISTORY, name)
    if match:
        wanted = [f"{match[1]}_0000.rad"]
    else:
        stem = name.partition(".")[0]
        wanted = [f"{stem}{ending}" for ending in _LS_DYNA_DECKS]
    return _find_file(folder, wanted)


def find_run_name(history: Sequence[str]) -> str | None:
    """Return the name of a Radioss run from the name of its history; None if the name is not that of a T01 file.

    Examples
    --------
    >>> find_run_name(["run/CLIPT01.gz"]), find_run_name(["sample_data/energy.csv"])
    ('CLIP', None)
    """
    name = os.path.basename(history[0]).removesuffix(".gz") if history else ""  # noqa: PTH119  pathlib would slow down start-up
    match = re.fullmatch(_RADIOSS_HISTORY, name)
    return match[1] if match else None


def find_history_beside(deck: str) -> str | None:
    """Return the history in the folder of a deck that has the same name or a name of the solver; None if there is none.

    Examples
    --------
    >>> find_history_beside("sample_data/rollover_box.k")
    'sample_data/rollover_box.matsum'
    >>> find_history_beside("sample_data/switching.k") is None
    True
    """
    folder, name = os.path.split(deck)
    match = re.fullmatch(_RADIOSS_DECK, name)
    if match:
        return _find_file(folder, [f"{match[1]}T01", f"{match[1]}T01.gz"])
    stem = name.partition(".")[0]
    named = [f"{stem}.{history}" for history in _LS_DYNA_HISTORIES]
    return _find_file(folder, [*named, *_LS_DYNA_HISTORIES])


def _find_file(folder: str, names: Sequence[str]) -> str | None:
    """Return the first of the named files that exists in a folder."""
    paths = (os.path.join(folder, name) for name in names)  # noqa: PTH118  pathlib would slow down start-up
    return next(filter(os.path.isfile, paths), None)
