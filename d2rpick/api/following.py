"""What happens in a run while it is computed, for scripts: an iterator of events."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.api import arguments
from d2rpick.histories.names import Selection
from d2rpick.running import watch

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.api.arguments import Parts
    from d2rpick.running.events import Event


def follow(
    run: arguments.Path,
    *,
    parts: Parts | None = None,
    wait: float | None = None,
    deck: arguments.Path | None = None,
    lasting: float | None = None,
) -> Iterator[Event]:
    """Follow a run while it is computed, as ``d2rpick follow`` does.

    Parameters
    ----------
    run : path
        Folder, T01, glstat, matsum or binout, or a pattern for these, which need not be there yet.
    parts : int, str or sequence of these, optional
        That are to be switched.
    wait : float, optional
        Time without a force that counts as flight [time].  Default: half of the longest inner period that is known.
    deck : path, optional
        Main deck of the run: tells gravity, supports, bodies, and the period of parts on springs.
    lasting : float, optional
        For so long [s]; 0: what there is now.  Default: until the run has ended.

    Returns
    -------
    iterator of Event
        With ``event``, ``time``, ``seen``, ``message``, ``wait``, ``left``, ``tr``; the last one is the state.

    Raises
    ------
    D2RPickError
        If the run or the deck cannot be read, has no such parts, or ``wait`` is below half of a known period.

    Examples
    --------
    >>> import d2rpick as d2
    >>> [one.event for one in d2.follow("sample_data/rolloverT01.gz", parts="box", lasting=0)][:2]
    ['begun', 'load']
    """
    selection = Selection(parts=arguments.part_names("parts", parts))
    inventory = None
    if deck is not None:
        from d2rpick.deck import read_inventory  # not above: few name a deck

        inventory = read_inventory(arguments.one_path("deck", deck))
    time, seconds = arguments.optional("wait", wait), arguments.optional("lasting", lasting)
    return watch.follow([arguments.one_path("run", run)], selection, time, inventory, lasting=seconds)
