"""Prepare decks that switch parts in their first run, and report the events of a run in progress."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from d2rpick.api import arguments
from d2rpick.api.cards import parse_id_ranges
from d2rpick.api.times import TimeArguments
from d2rpick.base.options import NOT_NEGATIVE
from d2rpick.histories.names import Selection

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.api.arguments import Parts, Time
    from d2rpick.report.follow import Event


class FirstRun(NamedTuple):
    """Result of `first`: the names of the ``files`` with the main deck first, and ``notes`` on what is unknown.

    ``wait`` is the force-free time after which a flight is detected [time of the deck], and ``reason`` states where it
    comes from.
    """

    files: tuple[str, ...]
    wait: float
    reason: str
    notes: tuple[str, ...]


def first(
    deck: arguments.Path,
    output_dir: arguments.Path,
    *,
    parts: Parts | None = None,
    wait: Time | None = None,
    after: Time | None = None,
    overwrite: bool | None = False,
) -> FirstRun:
    """Write a copy of a deck that switches the parts in its first run, as ``d2rpick first`` does.

    Parameters
    ----------
    deck : path
        Main deck of LS-DYNA, or a file of a Radioss run with one engine file.
    output_dir : path
        A folder other than that of the deck; it is created if it does not exist.
    parts : int, str or sequence of these, optional
        Ids and id ranges of the parts to be switched.  For Radioss, the default is the parts of the rigid bodies that
        the engine file deactivates.
    wait : float or text, optional
        Force-free time after which a flight is detected [time]; it may be a string such as ``"5ms"`` if the deck names
        its units. The default is half of the longest period of masses on springs in the deck.
    after : float or text, optional
        Earliest time at which parts become rigid [time].
    overwrite : bool
        Replace existing files.

    Returns
    -------
    FirstRun

    Raises
    ------
    DeckError
        If the deck has no contact that shows a flight, if other loads act on the parts, or if a file already exists.
    RangeError
        If the waiting time is shorter than half of a known period.
    TypeError, ValueError
        If an argument has a wrong type or value, or if the parts or the waiting time are not given and do not follow
        from the deck.

    Examples
    --------
    >>> import d2rpick as d2
    >>> d2.first("sample_data/rollover_box.k", "first", parts=1)  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    ...
    d2rpick.base.errors.ArgumentError: sample_data/rollover_box.k: missing: `wait` (force-free time...)
    """
    from d2rpick.deck.writing import write_deck
    from d2rpick.running.first import first_card

    names = arguments.list_part_names("parts", parts)
    main = arguments.check_path("deck", deck)
    of_deck = TimeArguments.of_deck(main)
    times = (
        of_deck.check_time("wait", wait, NOT_NEGATIVE),
        of_deck.check_time("after", after, NOT_NEGATIVE),
    )
    folder = arguments.check_path("output_dir", output_dir)
    card, needed = first_card(main, parse_id_ranges("parts", names), *times)
    files = write_deck(
        main,
        card,
        folder,
        overwrite=arguments.check_flag("overwrite", overwrite, False),
    )
    return FirstRun(tuple(files), needed.time, needed.reason, card.notes)


def follow(
    run: arguments.Path,
    *,
    parts: Parts | None = None,
    wait: Time | None = None,
    deck: arguments.Path | None = None,
    lasting: float | None = None,
) -> Iterator[Event]:
    """Follow a run while it is computed, as ``d2rpick follow`` does.

    Parameters
    ----------
    run : path
        Folder, T01, glstat, matsum or binout file, or a pattern; the files need not exist yet.
    parts : int, str or sequence of these, optional
        The parts to be switched.
    wait : float or text, optional
        Force-free time after which a flight is detected [time]; it may be a string such as ``"5ms"`` if ``deck`` names
        its units. The default is half of the longest known internal period.
    deck : path, optional
        Main deck of the run, which defines gravity, supports, bodies, and the period of parts on springs.
    lasting : float, optional
        Time for which the run is followed [s]; 0 returns only the events so far. By default, the run is followed until
        it ends.

    Returns
    -------
    iterator of Event
        Events with ``event``, ``time``, ``seen``, ``message``, ``wait``, ``left`` and ``tr``; the last event describes
        the current state of the run.

    Raises
    ------
    D2RPickError
        If the run or the deck cannot be read, if there are no such parts, or if ``wait`` is shorter than half of a
        known period.

    Examples
    --------
    >>> import d2rpick as d2
    >>> [event.event for event in d2.follow("sample_data/rolloverT01.gz", parts="box", lasting=0)][:2]
    ['begun', 'load']
    """
    from d2rpick.report.follow import (
        describe_news,
    )  # Imported here to keep start-up fast.
    from d2rpick.running import watch

    selection = Selection(parts=arguments.list_part_names("parts", parts))
    inventory = None
    main = None if deck is None else arguments.check_path("deck", deck)
    if main is not None:
        from d2rpick.deck import read_inventory  # Imported here to keep start-up fast.

        inventory = read_inventory(main)
    time = TimeArguments.of_deck(main).check_time("wait", wait)
    seconds = arguments.check_optional_number("lasting", lasting)
    names = [arguments.check_path("run", run)]
    reads = watch.follow(names, selection, time, inventory, lasting=seconds)
    return describe_news(reads, names, selection.parts)
