"""Provide runs to scripts from files, from memory, or from a table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import IO, TYPE_CHECKING, Any

from d2rpick.api import arguments
from d2rpick.base.data_classes import dataclass
from d2rpick.base.errors import DamageError, give_if_written

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    import pandas as pd

    from d2rpick.api.arguments import Parts, Path
    from d2rpick.choice.overview import Overview
    from d2rpick.histories import run as histories
    from d2rpick.histories.history import History, Samples
    from d2rpick.histories.names import Part, Selection
    from d2rpick.histories.source import Source


@dataclass(frozen=True, eq=False, repr=False)
class Run:
    """One run: its opened files, and the table columns that the user assigned to quantities; it is immutable.

    A run can be pickled: a copy, even in another process, contains the same bytes, or opens the same large files again.
    Two runs are equal if the same bytes were read under the same names and in the same way.

    ``files`` contains the opened files, and ``chosen`` the selected columns. ``input_format`` is the format that the
    user gave, or ``"auto"`` if it was detected from the content. ``folder`` is the folder that the user gave, in which
    the main deck is searched for. Energies are read only when they are needed.
    """

    files: histories.OpenedRun
    chosen: Selection
    input_format: str = "auto"
    folder: str | None = None

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Run):
            return NotImplemented
        return self._identity == other._identity

    def __hash__(self) -> int:
        return hash(self.sources)

    @property
    def _identity(self) -> tuple[Any, ...]:
        digests = tuple(source.sha256() for source in self.files.files)
        return self.sources, digests, self.chosen, self.input_format

    def __repr__(self) -> str:
        from d2rpick.report.pages import summarise_files

        return f"Run({summarise_files(self.files)})"

    def _repr_html_(self) -> str | None:
        from d2rpick.report.pages import show_at_a_glance

        try:
            overview = give_if_written(self.overview)
            history = give_if_written(lambda: self.files.history(self.chosen))
        except DamageError:
            return None
        if overview is None or history is None:
            return show_at_a_glance("overview", overview, None) if overview else None
        from d2rpick.report.figures_choice import draw_run

        flights = [(flight.start, flight.end) for _, flight in overview.flights]
        return show_at_a_glance("overview", overview, draw_run(history, flights))

    @property
    def sources(self) -> tuple[str, ...]:
        """Names of the files."""
        return self.files.sources

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the histories of the whole model."""
        return tuple(
            dict.fromkeys(
                name for database in self.files.databases for name in database.channels
            )
        )

    @property
    def parts(self) -> tuple[Part, ...]:
        """Parts that have their own histories; each has an ``id`` and a ``title``."""
        return self.files.parts

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on what the readers omitted and assumed."""
        return self.files.notes

    def overview(self, deck: arguments.Deck | None = None) -> Overview:
        """Return what ``d2rpick info`` shows: format, states, sampling, channels, parts, flights and health.

        The main ``deck`` of the run defines gravity, supports and prescribed motion. The default is the only main deck
        in the folder that was read; False means no deck.
        """
        from d2rpick.choice.overview import describe_run

        deck_name = arguments.check_path("deck", deck) if deck else None
        return describe_run(
            self.files, self.chosen, self._deck_in_folder if deck is None else deck_name
        )

    @property
    def _deck_in_folder(self) -> str | None:
        """The main deck in the folder that was read; None unless there is exactly one."""
        if self.folder is None:
            return None
        from d2rpick.deck import find_decks_of_run

        decks = find_decks_of_run(self.folder)
        return decks[0] if len(decks) == 1 else None

    def to_frame(self, parts: Parts | None = None) -> pd.DataFrame:
        """Return energies over time as a table at full precision.

        Parameters
        ----------
        parts : number, title or several, optional
            Parts whose internal energies are returned, given as for ``suggest``, or ``"all"``. The default is the
            energy that ``suggest`` uses without parts.

        Returns
        -------
        pandas.DataFrame
            Table with the index ``time``. It has the shape (states, parts), and the name of a column is the title of
            the part (``part 3`` if there is no title, ``door (7)`` if several parts have the same title). Without
            parts, it has the shape (states, 1) with the column ``internal_energy`` [energy]. ``attrs`` contains
            ``source``, ``format``, ``channel``, ``time_unit`` (empty if no file contains it), the ``titles`` of the
            parts by number, the ``ids`` by column name, and ``notes``.

        Raises
        ------
        FormatError
            If the run has no such parts or no energy.

        Examples
        --------
        >>> read("sample_data/energy.csv").to_frame().shape
        (1501, 1)
        >>> read("sample_data/rollover_box.matsum").to_frame(parts="all").columns.tolist()
        ['box', 'step']
        """
        import pandas as pd

        is_all = isinstance(parts, str) and parts == "all"
        names = (
            ("0-4294967295",) if is_all else arguments.list_part_names("parts", parts)
        )
        history = self.files.history(
            self.chosen._replace(energy=(), parts=names) if names else self.chosen
        )
        if history.parts is None:
            columns: dict[Any, Any] = {"internal_energy": history.energy}
        else:
            energies = self.files.part_energies(history.parts)
            columns = {
                part.name: energies[:, at] for at, part in enumerate(history.parts)
            }
            # The energies of the parts and their sum have the same times.
        frame = pd.DataFrame(columns, index=pd.Index(history.time, name="time"))
        frame.attrs = {
            "source": list(history.source),
            "format": history.format,
            "channel": history.channel,
            "time_unit": history.time_unit,
            "titles": {part.id: part.title for part in history.parts or ()},
            "ids": {part.name: part.id for part in history.parts or ()},
            "notes": list(history.notes),
        }
        return frame


def read(
    source: Path | IO[bytes] | Iterable[Path],
    *,
    time: str | int | None = None,
    energy: str | int | Iterable[str | int] | None = None,
    channels: Mapping[str, str | int] | None = None,
    input_format: str | None = "auto",
) -> Run:
    """Read the files of one run, as ``d2rpick suggest`` reads its HISTORY.

    Parameters
    ----------
    source : path, several, or an open binary file
        A file, a folder, a pattern, the restart segments of a run, or companion files in other formats; a string is a
        single path.
    time, energy : str or int, optional
        Columns, labels or HDF5 paths, given by name or 1-based number; several energies are added.
    channels : mapping, optional
        Channels of other quantities with unusual names, e.g. ``{"kinetic_energy": "E2"}``, like the option
        ``--channel``.
    input_format : str
        ``"auto"`` to detect the format from the content, or one of csv, hdf5, glstat, matsum, binout, radioss-th.

    Returns
    -------
    Run

    Raises
    ------
    D2RPickError
        If a file cannot be read as the history of a run; the message states the place, the problem and what to do in
        one line.
    TypeError, ValueError
        If an argument has a wrong type or value.

    Examples
    --------
    >>> read("sample_data/energy.csv").channels
    ('z', 'y', 'vz', 'vy', 'internal_energy', 'kinetic_energy')
    """
    # Imported here to keep start-up fast.
    from d2rpick.api.tables import is_table

    if is_table(source):
        raise TypeError(
            f"source is a table of type {type(source).__name__}; give it to d2rpick.from_frame(...)"
        )
    if hasattr(source, "read"):
        return _open_sources(
            [_read_into_memory(source)],
            make_selection(time, energy, channels),
            input_format,
        )
    names = arguments.list_paths("source", source)
    from d2rpick.histories.opening import open_run

    chosen = make_selection(time, energy, channels)
    kind = check_format(input_format)
    return Run(open_run(names, chosen, kind), chosen, kind, find_folder(names))


def find_folder(names: Sequence[str]) -> str | None:
    """Return the folder if the run was given as a folder; None if it was given as files."""
    import os

    return names[0] if len(names) == 1 and os.path.isdir(names[0]) else None  # noqa: PTH112  Path.is_dir fails on some names


def from_frame(
    frame: object,
    *,
    time: str | int | None = None,
    energy: str | int | Iterable[str | int] | None = None,
    channels: Mapping[str, str | int] | None = None,
    name: str | None = "frame",
) -> Run:
    """Take the energies of a run from a pandas, polars, pyarrow, xarray or numpy table.

    The table is checked like the CSV file that ``frame.to_csv()`` writes: times must increase, and values must be
    finite numbers.

    Parameters
    ----------
    frame : DataFrame or Series of pandas, table of polars, pyarrow or xarray, array of numpy, or mapping of columns
        Table with a row per state.  The times are a column, coordinate or index with a name such as ``time``, or the
        one that the argument ``time`` names, but never the row numbers; timedeltas are converted to seconds.  A Series
        is treated as the internal energy.  The columns of an array have no names: the first is the time, and others are
        given by number, e.g. ``energy=3``.
    time, energy, channels : optional
        Columns as for ``read``.
    name : str
        Name of the table in messages.

    Returns
    -------
    Run

    Raises
    ------
    D2RPickError
        If the table is not the history of a run.
    TypeError, ValueError
        If ``frame`` is not a table, or if no part of it is named as the time.

    Examples
    --------
    >>> import pandas as pd
    >>> table = pd.DataFrame({"time": [0.0, 1.0, 2.0], "internal_energy": [0.0, 4.0, 1.0]})
    >>> from_frame(table).to_frame()["internal_energy"].tolist()
    [0.0, 4.0, 1.0]
    """
    from d2rpick.api.tables import convert_to_frame, is_plain_array
    from d2rpick.histories.source import Source

    if name is not None and not isinstance(name, str):
        raise TypeError(f"name is {name!r}, but a text was expected")
    table = convert_to_frame(frame)
    chosen = make_selection(time, energy, channels)
    is_named = not is_plain_array(frame)
    if is_named:
        table = _set_time_column(table, chosen.time)
    text = table.apply(_convert_to_seconds).to_csv(index=False, header=is_named)
    return _open_sources([Source(name or "frame", text.encode())], chosen, "csv")


def _set_time_column(frame: pd.DataFrame, time: str | None) -> pd.DataFrame:
    """Turn the index into a column if it contains the times; raise ValueError if no name denotes the time."""
    from d2rpick.histories.meaning import is_time

    index = frame.index
    column_names = list(map(str, frame.columns))
    if (
        time in column_names
        or (time is not None and time.isdecimal())
        or any(map(is_time, column_names))
    ):
        return frame
    if (
        index.inferred_type.startswith("timedelta")
        or time == index.name is not None
        or is_time(str(index.name))
    ):
        return frame.reset_index(names=time or "time")
    index_name = "no name" if index.name is None else f"the name {index.name!r}"
    raise ValueError(
        f"frame has no time{'' if time is None else f' {time!r}'}: its index has {index_name}, its columns are "
        f"{', '.join(map(repr, column_names))}; name it by frame.rename_axis('time'), or a column of these as `time`"
    )


def _convert_to_seconds(column: pd.Series[Any]) -> pd.Series[Any]:
    """Convert timedeltas to seconds, and return other values unchanged."""
    return column.dt.total_seconds() if column.dtype.kind == "m" else column


def _read_into_memory(file: Any) -> Source:
    from d2rpick.histories.source import Source

    data = file.read()
    if not isinstance(data, bytes):
        raise TypeError(
            "source is a file opened as text, but a file opened as binary was expected: open(name, 'rb')"
        )
    return Source(str(getattr(file, "name", "file")), data)


def _open_sources(
    sources: list[Source], chosen: Selection, input_format: str | None
) -> Run:
    from d2rpick.histories.opening import open_sources

    kind = check_format(input_format)
    return Run(open_sources(sources, chosen, kind), chosen, kind)


def check_format(input_format: str | None) -> str:
    """Return the name of a format, or ``"auto"``; raise ValueError for all other names."""
    from d2rpick.histories.formats import READERS

    if input_format is None:
        return "auto"
    if not isinstance(input_format, str):
        raise TypeError(f"input_format is {input_format!r}, but a text was expected")
    if input_format not in ("auto", *READERS):
        raise ValueError(
            f"input_format is {input_format!r}, but one of auto, {', '.join(READERS)} was expected"
        )
    return input_format


def make_selection(
    time: str | int | None,
    energy: str | int | Iterable[str | int] | None,
    channels: Mapping[str, str | int] | None = None,
) -> Selection:
    """Return the selected columns; raise TypeError for other types, and ValueError for an unknown quantity."""
    from d2rpick.histories.names import QUANTITIES, Selection

    single = (
        energy is None
        or isinstance(energy, str)
        or not hasattr(energy, "__iter__")
        or arguments.is_number(energy)
    )
    listed: list[Any] = ([] if energy is None else [energy]) if single else list(energy)  # type: ignore[arg-type]  # a single energy is not iterated
    if channels is not None and not isinstance(channels, Mapping):
        raise TypeError(
            f"channels is {channels!r}, but a mapping of quantities to columns was expected"
        )
    channel_names = dict(channels or {})
    for name, value in [
        ("time", time),
        *(("energy", energy_name) for energy_name in listed),
        *channel_names.items(),
    ]:
        if (
            value is not None
            and not isinstance(value, str)
            and not arguments.is_whole_number(value)
        ):
            raise TypeError(
                f"{name} is {value!r}, but the name or number of a column was expected"
            )
    if unknown := [name for name in channel_names if name not in QUANTITIES]:
        raise ValueError(
            f"channels names {unknown[0]!r}, but one of {', '.join(QUANTITIES)} was expected"
        )
    return Selection(
        time=None if time is None else str(time),
        energy=tuple(str(energy_name) for energy_name in listed),
        channels=tuple((name, str(channel)) for name, channel in channel_names.items()),
    )


def extract_columns(
    run: histories.OpenedRun, selection: Selection
) -> tuple[dict[str, Samples], tuple[str, ...]]:
    """Return the selected columns of a run, all quantities known at the same times, and notes on them.

    The columns, each of shape (n,), are ``time``, ``internal_energy``, ``part_<id>`` for each part if there are
    several, ``not_chosen_part_<id>`` or ``not_chosen_spring_<id>`` for each other part that flies with them, quantities
    of the whole model, and the momentum that shows the flight.
    """
    from d2rpick.base.errors import list_names
    from d2rpick.choice.question import Reference
    from d2rpick.choice.td.flights import (
        list_flying_parts_not_chosen,
        list_momentum_columns,
    )
    from d2rpick.histories.table_parts import name_energy_of_part_not_chosen

    history = Reference.of(run, selection).history
    table = {"time": history.time, "internal_energy": history.energy}
    if history.parts and len(history.parts) > 1:
        energies = run.part_energies(history.parts)
        table |= {
            f"part_{part.id}": column
            for part, column in zip(history.parts, energies.T, strict=True)
        }
        table["internal_energy"] = _round_sum(history, energies)
    notes = history.notes
    not_chosen = list_flying_parts_not_chosen(history)
    energies_not_chosen = history.evidence.internal_energies(not_chosen)
    if not_chosen and energies_not_chosen is not None:
        springs = history.evidence.springs
        names = [name_energy_of_part_not_chosen(part, springs) for part in not_chosen]
        table |= dict(zip(names, energies_not_chosen.values.T, strict=True))
        others = list_names([part.name for part in not_chosen])
        note = (
            f"internal_energy is the energy of the chosen parts; momentum and mass also include {others} "
            f"({'which flies' if len(names) == 1 else 'which fly'} with them; energy in {list_names(names)})"
        )
        notes = (*notes, note)
    return (
        table
        | run.quantities(history.time)
        | _list_model_columns(history)
        | list_momentum_columns(history)
    ), notes


def _round_sum(history: History, energies: Samples) -> Samples:
    """Return the energy of a history, shape (n,), with the digits of its terms ``energies``, shape (n, parts).

    A table shows its precision only by its digits, so the sum of printed numbers must not have more digits than they
    have. The sum of binary numbers is not rounded.
    """
    precision = history.energy_precision
    terms = energies.ravel()
    if not (precision.round(terms) == terms).all():
        return history.energy
    return precision.round(history.energy)


def _list_model_columns(history: History) -> dict[str, Samples]:
    """Return the energy terms of the whole model by name; empty if their times differ from those of the energy.

    The kinetic energy includes that of rotation. The internal energy is included only if the selected energy is that of
    some parts.
    """
    import numpy as np

    balance = history.balance
    if balance is None or not np.array_equal(balance.time, history.time):
        return {}
    terms = {
        "kinetic_energy": balance.kinetic,
        "total_internal_energy": balance.internal if history.parts else None,
    }
    return {name: term for name, term in terms.items() if term is not None}
