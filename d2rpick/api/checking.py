"""Check decks by the rules and, if a history is given, by judging the windows of the decks."""

from __future__ import annotations

import os
import sys
from dataclasses import field
from functools import cache
from typing import TYPE_CHECKING, Unpack

from d2rpick.api.answer import Answer, build_frame
from d2rpick.api.cards import SETTINGS
from d2rpick.base.data_classes import dataclass
from d2rpick.base.errors import Caution, ConfigurationError, D2RPickError, DeckError
from d2rpick.base.files import STDIN
from d2rpick.deck import find_main_decks
from d2rpick.deck.radioss_files import list_run_files
from d2rpick.deck.restarts import is_restart
from d2rpick.report.tables import make_positional
from d2rpick.rules import RULES, Checked, Configuration, check_deck, find_configuration
from d2rpick.rules.base import LS_DYNA, Severity, Unreadable

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    import pandas as pd

    from d2rpick.api import arguments
    from d2rpick.api.choosing import Choosing
    from d2rpick.api.request import Request
    from d2rpick.api.runs import Run
    from d2rpick.rules import CheckedWindow
    from d2rpick.rules.base import Finding
    from d2rpick.rules.judgement import HistoryJudge


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Findings(Answer):
    """Immutable answer of `check`.

    ``results`` contains the result of each deck, and ``failed`` the decks that could not be read. Paths below ``root``
    are shown relative to it. ``history`` contains the files from which the windows were judged; it is None if there are
    none. Findings less severe than ``fail_on`` are not failures. ``history_has_parts`` is True if the windows were
    judged by the energies of their parts.

    Each of the ``findings`` has ``rule``, ``severity``, ``message``, ``file``, ``line`` and ``column``. ``windows``
    contains the windows in which parts are rigid. ``notes`` reports unused settings, and what was omitted or assumed
    when the history was read.
    """

    results: Sequence[Checked]
    root: str = field(default_factory=os.getcwd)
    failed: Sequence[Unreadable] = ()
    cautions: tuple[Caution, ...] = ()
    history: Sequence[str] | None = None
    fail_on: Severity = Severity.ERROR
    history_has_parts: bool = False
    command: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    kind = "findings"
    said = ("decks", "findings")

    @property
    def passed(self) -> bool:
        """True if all decks were checked and every finding is less severe than ``fail_on``."""
        return not self.failed and all(
            finding.severity.rank > self.fail_on.rank for finding in self.findings
        )

    @property
    def has_only_infos(self) -> bool:
        """True if all decks were checked, and no finding is an error or a warning."""
        severities = {finding.severity for finding in self.findings}
        return not self.failed and severities <= {Severity.INFO}

    @property
    def decks(self) -> tuple[str, ...]:
        """Names of the main decks that were checked."""
        return tuple(result.deck for result in self.results)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Findings of the rules in all decks."""
        return tuple(finding for result in self.results for finding in result.findings)

    @property
    def windows(self) -> tuple[CheckedWindow, ...]:
        """Windows of all decks during which parts are rigid."""
        return tuple(window for result in self.results for window in result.windows)

    def to_frame(self) -> pd.DataFrame:
        """Return a table with a row per finding and a column per key of ``findings`` in the JSON output.

        Examples
        --------
        >>> import d2rpick as d2
        >>> history = d2.read("sample_data/energy.csv")
        >>> d2.check("sample_data/switching.k", history=history).to_frame()["rule"].tolist()
        ['D2R202', 'D2R203']
        """
        # Imported here to keep start-up fast.
        from d2rpick.report.findings import FINDING

        return build_frame(
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
    """Find the switching cards in decks and check them, as ``d2rpick check`` does.

    Parameters
    ----------
    decks : path or several
        Main decks, read with their includes; a folder stands for its main decks, ``-`` for standard input.
    history : Run, optional
        Run whose history is used to judge the windows; it must not be switched.
    select, ignore : string or several
        Rules, given by their ids or beginnings of ids; the default is the selection in the configuration nearest to the
        deck.
    **choosing
        Options that determine how the windows are judged, as for `suggest`.

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
        If an argument has a wrong type or value, or if options for judging are given without a history.

    Examples
    --------
    >>> import d2rpick as d2
    >>> found = d2.check("sample_data/switching.k")
    >>> [(window.part, window.td) for window in found.windows]
    [(11, 0.0687534), (12, 0.064)]
    """
    # Imported here to keep the start of the command line fast.
    from d2rpick.api import arguments
    from d2rpick.api.asked import make_request

    names = arguments.list_paths("decks", decks)
    if history is not None:
        arguments.check_run("history", history)
    request = make_request(history, None, None, None, None, choosing)
    rules = Configuration(
        arguments.list_rule_ids("select", select),
        arguments.list_rule_ids("ignore", ignore),
    )
    rule_options: list[str] = []
    for name in ("select", "ignore"):
        for rule in getattr(rules, name):
            rule_options += [f"--{name}", rule]
    files = [text for name in request.history for text in ("--history", name)]
    command = (
        "check",
        *files,
        *request.asking(),
        *rule_options,
        *make_positional(names),
    )
    findings = find_findings(names, history, request, *rules[:2], command=command)
    for failed_deck in findings.failed:
        raise failed_deck.error
    return findings


def find_findings(
    decks: Sequence[str],
    run: Run | None,
    request: Request,
    select: tuple[str, ...],
    ignore: tuple[str, ...],
    fail_on: str = Severity.ERROR,
    *,
    command: tuple[str, ...] = (),
) -> Findings:
    """Check the named decks, using the history of a run if one is given."""
    judge = None
    if run is None:
        request.without_history()
    else:
        # Imported here to keep start-up fast.
        from d2rpick.rules.judgement import HistoryJudge

        judge = HistoryJudge(run.files, request.selection(), request.settings)
    rules = Configuration(select, ignore)
    rules.verify(RULES)
    outcomes = list(_check_each(decks, rules, judge))
    results = tuple(outcome for outcome in outcomes if isinstance(outcome, Checked))
    remarks = dict.fromkeys(remark for result in results for remark in result.remarks)
    unused_settings = dict.fromkeys(note for result in results for note in result.notes)
    return Findings(
        results=results,
        failed=tuple(
            outcome for outcome in outcomes if isinstance(outcome, Unreadable)
        ),
        cautions=(
            *(judge.cautions if judge else ()),
            *(Caution("unknown-rule", remark) for remark in remarks),
        ),
        history=run.sources if run else None,
        history_has_parts=bool(run and run.parts and not request.energy),
        notes=(*(judge.notes if judge else ()), *unused_settings),
        fail_on=Severity(fail_on),
        command=command,
    )


def check_written(deck: str, judge: HistoryJudge) -> Findings:
    """Check a deck that d2rpick wrote, with the nearest configuration in its folder or a parent folder."""
    checked = check_deck(
        deck, find_configuration(deck, Configuration(), SETTINGS), judge
    )
    return Findings(
        results=(checked,), cautions=tuple(judge.cautions), history=judge.run.sources
    )


def _check_each(
    deck_names: Sequence[str], rules: Configuration, judge: HistoryJudge | None
) -> Iterator[Checked | Unreadable]:
    """Yield the result for each deck and each run, each only once; a folder stands for its main decks."""
    visited: set[str] = set()
    # Results are cached, because the function makes a system call for each parent folder.
    real_folder = cache(os.path.realpath)
    configured = cache(
        lambda folder: find_configuration(os.path.join(folder, ""), rules, SETTINGS)  # noqa: PTH118  pathlib is slow for many decks
    )
    found_by_name = {name: _list_decks(name) for name in dict.fromkeys(deck_names)}
    listed = [
        deck
        for decks in found_by_name.values()
        if not isinstance(decks, DeckError)
        for deck in decks
    ]
    restarts = _find_restarts(listed)
    for name, decks in found_by_name.items():
        if isinstance(decks, DeckError):
            yield Unreadable(name, decks)
            continue
        for deck in decks:
            folder, file = os.path.split(deck)
            real = (
                os.path.realpath(deck)
                if os.path.islink(deck)  # noqa: PTH114  pathlib is slow for many decks
                else os.path.join(real_folder(folder), file)  # noqa: PTH118  pathlib is slow for many decks
            )
            if real not in visited and not any(
                deck in legs for legs in restarts.values()
            ):
                outcome = _check_one(
                    deck, configured, judge, folder, restarts.get(deck, ())
                )
                if isinstance(outcome, Checked) and outcome.solver == LS_DYNA:
                    other_files = []
                else:
                    other_files = list_run_files(deck)
                visited.update([real, *map(os.path.realpath, other_files)])
                yield outcome


def _list_decks(name: str) -> list[str] | DeckError:
    """Return the main decks in a folder, or the deck itself; return an error if the folder contains no decks."""
    try:
        return find_main_decks(name) if os.path.isdir(name) else [name]  # noqa: PTH112  Path.is_dir fails on some names
    except DeckError as error:
        return error


def _find_restarts(decks: Sequence[str]) -> dict[str, list[str]]:
    """Return the small restart decks of each LS-DYNA deck, if its folder contains no other decks."""
    small = [deck for deck in decks if is_restart(deck)]
    legs: dict[str, list[str]] = {}
    for restart in small:
        folder = os.path.dirname(os.path.abspath(restart))  # noqa: PTH100, PTH120  pathlib is slow for many decks
        neighbours = [
            deck
            for deck in decks
            if os.path.dirname(os.path.abspath(deck)) == folder and deck not in small  # noqa: PTH100, PTH120  pathlib is slow for many decks
        ]
        if len(neighbours) == 1 and not list_run_files(neighbours[0]):
            legs.setdefault(neighbours[0], []).append(restart)
    return legs


def _check_one(
    name: str,
    configured: Callable[[str], Configuration],
    judge: HistoryJudge | None,
    folder: str,
    restarts: Sequence[str],
) -> Checked | Unreadable:
    """Check a deck by the nearest configuration. An error is returned so that the other decks are still checked."""
    source = ""
    try:
        configuration = configured(folder)
        source = configuration.source
        content = sys.stdin.buffer.read() if name == STDIN else None
        if judge and content is None:
            judge.use_deck(name)
        result = check_deck(name, configuration, judge, content, restarts)
        return result._replace(files=(source, *result.files), notes=configuration.notes)
    except Exception as error:
        if isinstance(error, D2RPickError) and not isinstance(
            error, ConfigurationError | DeckError
        ):
            raise  # The error concerns the history that is used for all decks.
        return Unreadable(name, error, (source,))
