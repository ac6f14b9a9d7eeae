"""The deck check."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Unpack

from d2rpick.api import arguments
from d2rpick.api.answer import Answer, frame_of
from d2rpick.api.asked import request_of
from d2rpick.api.cards import SETTINGS
from d2rpick.report.findings import FINDING, Checks
from d2rpick.report.tables import positional
from d2rpick.rules import Configuration, check_deck, configuration_for

if TYPE_CHECKING:
    from collections.abc import Iterable

    import pandas as pd

    from d2rpick.api.arguments import Choosing
    from d2rpick.api.runs import Run
    from d2rpick.deck.switching import Window
    from d2rpick.rules.base import Finding


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Findings(Answer, Checks):
    """Answer of `check`; nothing of it changes.

    ``findings`` have ``rule``, ``severity``, ``message``, ``file``, ``line`` and ``column``; ``windows`` are those in
    which parts are rigid.
    """

    command: tuple[str, ...]
    kind = "findings"
    said = ("decks", "findings")

    @property
    def decks(self) -> tuple[str, ...]:
        """Names of the main decks."""
        return tuple(one.deck for one in self.results)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What the rules have against the cards of all decks."""
        return tuple(finding for one in self.results for finding in one.findings)

    @property
    def windows(self) -> tuple[Window, ...]:
        """Windows in which parts are rigid, of all decks."""
        return tuple(window for one in self.results for window in one.windows)

    def to_frame(self) -> pd.DataFrame:
        """Give a row per finding, a column per key of ``findings`` in the JSON.

        Examples
        --------
        >>> import d2rpick as d2
        >>> history = d2.read("sample_data/energy.csv")
        >>> d2.check("sample_data/switching.k", history=history).to_frame()["rule"].tolist()
        ['D2R202', 'D2R203']
        """
        return frame_of(self.to_dict()["findings"], FINDING.keys, decks=list(self.decks))


def check(
    decks: arguments.Path | Iterable[arguments.Path],
    *,
    history: Run | None = None,
    select: str | Iterable[str] = (),
    ignore: str | Iterable[str] = (),
    **choosing: Unpack[Choosing],
) -> Findings:
    """Find the switching cards of decks and check them, as ``d2rpick check`` does.

    Parameters
    ----------
    decks : path or several
        Main decks; their includes are read with them.
    history : Run, optional
        By which the windows are judged: a run without switching.
    select, ignore : string or several
        Rules by id or its beginning; default: by the configuration nearest to the deck.
    **choosing
        How to judge, as for `suggest`.

    Returns
    -------
    Findings

    Raises
    ------
    DeckError
        If a deck cannot be read.
    ConfigurationError
        If a rule does not exist.
    TypeError, ValueError
        If an argument is not of its kind.

    Examples
    --------
    >>> import d2rpick as d2
    >>> found = d2.check("sample_data/switching.k")
    >>> [(window.part, window.td) for window in found.windows]
    [(11, 0.0687534), (12, 0.064)]
    """
    names = arguments.paths("decks", decks)
    if history is not None:
        arguments.check_run("history", history)
    request = request_of(history, None, None, None, None, choosing)
    judge = None
    if history is not None:
        from d2rpick.rules.judgement import HistoryJudge

        judge = HistoryJudge(history.files, history.chosen, request.settings)
    asked = Configuration(arguments.rule_ids("select", select), arguments.rule_ids("ignore", ignore))
    checked = []
    for name in names:
        if judge:
            judge.beside(name)
        checked.append(check_deck(name, configuration_for(name, asked, SETTINGS), judge))
    files = [text for name in (history.sources if history else ()) for text in ("--history", name)]
    rules = [text for name in ("select", "ignore") for one in getattr(asked, name) for text in (f"--{name}", one)]
    judging = request.asking() if history else ()
    return Findings(
        results=tuple(checked),
        cautions=tuple(judge.cautions) if judge else (),
        history=history.sources if history else None,
        command=("check", *files, *judging, *rules, *positional(names)),
    )
