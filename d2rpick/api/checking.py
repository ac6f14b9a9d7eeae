"""The deck check."""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Unpack

from d2rpick.api import arguments
from d2rpick.api.answer import Answer, frame_of
from d2rpick.api.cards import SETTINGS
from d2rpick.base.errors import Caution, ConfigurationError, D2RPickError, DeckError
from d2rpick.base.files import STDIN
from d2rpick.deck import find_main_decks
from d2rpick.deck.radioss_files import list_run_files
from d2rpick.deck.restarts import is_restart
from d2rpick.report.findings import FINDING, Checks
from d2rpick.report.tables import positional
from d2rpick.rules import RULES, Checked, Configuration, check_deck, find_configuration
from d2rpick.rules.base import LS_DYNA, Severity, Unreadable

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    import pandas as pd

    from d2rpick.api.arguments import Choosing
    from d2rpick.api.request import Request
    from d2rpick.api.runs import Run
    from d2rpick.rules import CheckedWindow
    from d2rpick.rules.base import Finding
    from d2rpick.rules.judgement import HistoryJudge


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Findings(Answer, Checks):
    """Answer of `check`; nothing of it changes.

    ``findings`` have ``rule``, ``severity``, ``message``, ``file``, ``line`` and ``column``; ``windows`` are those in
    which parts are rigid; ``notes`` say what the readers of the history left out or assumed, and which settings are
    not used.
    """

    command: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    kind = "findings"
    said = ("decks", "findings")

    @property
    def passed(self) -> bool:
        """Whether all decks were checked, and nothing weighs as much as ``fail_on``."""
        return not self.failed and all(
            one.severity.rank > self.fail_on.rank for one in self.findings
        )

    @property
    def decks(self) -> tuple[str, ...]:
        """Names of the main decks."""
        return tuple(one.deck for one in self.results)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What the rules have against the cards of all decks."""
        return tuple(finding for one in self.results for finding in one.findings)

    @property
    def windows(self) -> tuple[CheckedWindow, ...]:
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
        return frame_of(
            self.to_dict()["findings"], FINDING.keys, decks=list(self.decks)
        )


def check(
    decks: arguments.Path | Iterable[arguments.Path],
    *,
    history: Run | None = None,
    select: str | Iterable[str] | None = (),
    ignore: str | Iterable[str] | None = (),
    **choosing: Unpack[Choosing],
) -> Findings:
    """Find the switching cards of decks and check them, as ``d2rpick check`` does.

    Parameters
    ----------
    decks : path or several
        Main decks, read with their includes; a folder stands for its main decks, ``-`` for standard input.
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
        If an argument is not of its kind, or says how to judge where there is no history.

    Examples
    --------
    >>> import d2rpick as d2
    >>> found = d2.check("sample_data/switching.k")
    >>> [(window.part, window.td) for window in found.windows]
    [(11, 0.0687534), (12, 0.064)]
    """
    from d2rpick.api.asked import (
        request_of,
    )  # not above: without a history nothing is computed

    names = arguments.paths("decks", decks)
    if history is not None:
        arguments.check_run("history", history)
    request = request_of(history, None, None, None, None, choosing)
    rules = Configuration(
        arguments.rule_ids("select", select), arguments.rule_ids("ignore", ignore)
    )
    named = [
        text
        for name in ("select", "ignore")
        for one in getattr(rules, name)
        for text in (f"--{name}", one)
    ]
    files = [text for name in request.history for text in ("--history", name)]
    command = ("check", *files, *request.asking(), *named, *positional(names))
    found = findings_of(names, history, request, *rules[:2], command=command)
    for one in found.failed:
        raise one.error
    return found


def findings_of(
    decks: Sequence[str],
    run: Run | None,
    request: Request,
    select: tuple[str, ...],
    ignore: tuple[str, ...],
    fail_on: str = Severity.ERROR,
    *,
    command: tuple[str, ...] = (),
) -> Findings:
    """Check decks as they are named, by a run where there is one."""
    judge = None
    if run is None:
        request.without_history()
    else:
        from d2rpick.rules.judgement import HistoryJudge  # it loads numpy

        judge = HistoryJudge(run.files, request.selection(), request.settings)
    rules = Configuration(select, ignore)
    rules.verify(RULES)
    found = list(_each(decks, rules, judge))
    results = tuple(one for one in found if isinstance(one, Checked))
    remarks = dict.fromkeys(remark for result in results for remark in result.remarks)
    unused_settings = dict.fromkeys(note for result in results for note in result.notes)
    return Findings(
        results=results,
        failed=tuple(one for one in found if isinstance(one, Unreadable)),
        cautions=(
            *(judge.cautions if judge else ()),
            *(Caution("unknown-rule", remark) for remark in remarks),
        ),
        history=run.sources if run else None,
        notes=(*(judge.notes if judge else ()), *unused_settings),
        fail_on=Severity(fail_on),
        command=command,
    )


def check_written(deck: str, judge: HistoryJudge) -> Findings:
    """Check a deck that was written here by the configuration nearest to it."""
    checked = check_deck(
        deck, find_configuration(deck, Configuration(), SETTINGS), judge
    )
    return Findings(
        results=(checked,), cautions=tuple(judge.cautions), history=judge.run.sources
    )


def _each(
    named: Sequence[str], rules: Configuration, judge: HistoryJudge | None
) -> Iterator[Checked | Unreadable]:
    """Check each deck once, by one of its spellings, a run by the first of its files; a folder stands for its decks."""
    seen: set[str] = set()
    real_folder = cache(os.path.realpath)  # which asks the system for each folder above
    configured = cache(
        lambda folder: find_configuration(os.path.join(folder, ""), rules, SETTINGS)  # noqa: PTH118
    )
    found_by_name = {name: _decks(name) for name in dict.fromkeys(named)}
    listed = [
        deck
        for decks in found_by_name.values()
        if not isinstance(decks, DeckError)
        for deck in decks
    ]
    restarts = _restarts(listed)
    for name, decks in found_by_name.items():
        if isinstance(decks, DeckError):
            yield Unreadable(name, decks)
            continue
        for deck in decks:
            folder, file = os.path.split(deck)
            real = (
                os.path.realpath(deck)
                if os.path.islink(deck)  # noqa: PTH114
                else os.path.join(real_folder(folder), file)  # noqa: PTH118
            )
            if real not in seen and not any(deck in legs for legs in restarts.values()):
                found = _found(deck, configured, judge, folder, restarts.get(deck, ()))
                others = (
                    []
                    if isinstance(found, Checked) and found.solver == LS_DYNA
                    else list_run_files(deck)
                )
                seen.update([real, *map(os.path.realpath, others)])
                yield found


def _decks(name: str) -> list[str] | DeckError:
    """Give the main decks in a folder, or the deck itself; an error for a folder without any."""
    try:
        return find_main_decks(name) if os.path.isdir(name) else [name]  # noqa: PTH112  Path raises on odd names
    except DeckError as error:
        return error


def _restarts(decks: Sequence[str]) -> dict[str, list[str]]:
    """Give the small restarts that go on with the run of a deck of LS-DYNA, the only other deck in their folder."""
    small = [deck for deck in decks if is_restart(deck)]
    legs: dict[str, list[str]] = {}
    for restart in small:
        folder = os.path.dirname(os.path.abspath(restart))  # noqa: PTH100, PTH120
        beside = [
            deck
            for deck in decks
            if os.path.dirname(os.path.abspath(deck)) == folder and deck not in small  # noqa: PTH100, PTH120
        ]
        if len(beside) == 1 and not list_run_files(beside[0]):
            legs.setdefault(beside[0], []).append(restart)
    return legs


def _found(
    name: str,
    configured: Callable[[str], Configuration],
    judge: HistoryJudge | None,
    folder: str,
    restarts: Sequence[str],
) -> Checked | Unreadable:
    """Check a deck by the configuration nearest to it; what is wrong with either does not hide other decks."""
    source = ""
    try:
        configuration = configured(folder)
        source = configuration.source
        content = sys.stdin.buffer.read() if name == STDIN else None
        if judge and content is None:
            judge.beside(name)
        found = check_deck(name, configuration, judge, content, restarts)
        return found._replace(files=(source, *found.files), notes=configuration.notes)
    except Exception as error:
        if isinstance(error, D2RPickError) and not isinstance(
            error, ConfigurationError | DeckError
        ):
            raise  # about the history, by which all are judged
        return Unreadable(name, error, (source,))
