"""Rules of ``check``: one table of all, which of them count, and the function that runs them over a deck.

They are configured by ``d2rpick.toml`` or ``[tool.d2rpick]`` of pyproject.toml; the nearest wins.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping
from functools import cache
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import ConfigurationError
from d2rpick.base.settings import RULE_KEYS, nearest_settings, refuse_unknown, toml_text
from d2rpick.base.tuples import NamedTuple
from d2rpick.deck.radioss_files import HEAD, recognises
from d2rpick.deck.reader import Deck, read_deck
from d2rpick.deck.source import SourceFile
from d2rpick.rules import reading, runs, sets, switched_parts, times
from d2rpick.rules.base import LS_DYNA, Case, Finding, RunCase, Severity
from d2rpick.rules.rule import Rule

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from d2rpick.deck.card import Field
    from d2rpick.deck.switching import SwitchSet, Unit, Window
    from d2rpick.rules.judgement import HistoryJudge as Judge


_MODULES = (reading, sets, times, switched_parts, runs)
_ALL = (
    one for module in _MODULES for one in vars(module).values() if isinstance(one, Rule)
)
_BY_HISTORY: Final = "D2R2"  # rules that an energy history alone can break
_ALIKE: Final = 0.9  # of two ids, one of which has one sign more
# What follows from one mistake of units is not reported beside it.
_FOLLOW: Final = {
    "D2R115": {"D2R101", "D2R205", "D2R206", "D2R207"},
    "D2R207": {"D2R205", "D2R206"},
    "D2R206": {"D2R205"},
}
# A time after the end of the run lies outside its history, too; by what follows, on the same line.
_FOLLOW_THERE: Final = {"D2R205": {"D2R101"}}
RULES: Final[Mapping[str, Rule]] = {
    rule.id: rule for rule in sorted(_ALL, key=lambda rule: rule.id)
}


def find_rules(name: str) -> tuple[Rule, ...]:
    """Rules by id or its beginning; ConfigurationError with the nearest one when there is none.

    Examples
    --------
    >>> [rule.id for rule in find_rules("d2r30")]
    ['D2R301', 'D2R302', 'D2R303', 'D2R304', 'D2R305', 'D2R306', 'D2R307']
    """
    found = tuple(
        rule for rule in RULES.values() if name and rule.id.startswith(name.upper())
    )
    if not found:
        raise ConfigurationError(f"no rule {name!r}, {_expected_instead(name, RULES)}")
    return found


class Configuration(NamedTuple):
    """Which rules count, by id or its beginning (``D2R1``), and what weight single rules have.

    ``ignore`` is stronger than ``select``; an empty ``select`` means all.  ``source`` names their file, and ``notes``
    those that are not used because another user owns them.

    Examples
    --------
    >>> configuration = Configuration(select=("D2R1",), ignore=("D2R104",))
    >>> [configuration.selects(rule) for rule in ("D2R001", "D2R101", "D2R104")]
    [False, True, False]
    """

    select: tuple[str, ...] = ()
    ignore: tuple[str, ...] = ()
    severity: Mapping[str, str] = MappingProxyType({})
    source: str = ""
    notes: tuple[str, ...] = ()

    def selects(self, rule: str) -> bool:
        """Whether a rule counts."""
        chosen = not self.select or rule.startswith(self.select)
        return chosen and not (self.ignore and rule.startswith(self.ignore))

    def verify(self, known: Collection[str]) -> None:
        """Raise ConfigurationError for a rule that does not exist; near misses are named."""
        where = f"{self.source}: " if self.source else ""
        for name in (*self.select, *self.ignore, *self.severity):
            exact = name in self.severity and name not in (*self.select, *self.ignore)
            if name in known or (
                not exact and name and any(rule.startswith(name) for rule in known)
            ):
                continue
            raise ConfigurationError(
                f"{where}no rule {name!r}, {_expected_instead(name, known)}"
            )


def _expected_instead(name: str, known: Collection[str]) -> str:
    """What would have been a rule; the nearest one is named."""
    import difflib

    asked = name.upper()
    near = [rule for rule in sorted(known) if _signs_apart(rule, asked) == 1]
    near = near or difflib.get_close_matches(asked, known, n=1, cutoff=_ALIKE)
    return "an id like D2R101 or its beginning was expected" + (
        f"; did you mean {near[0]}?" if near else ""
    )


def _signs_apart(one: str, other: str) -> int:
    """Number of places at which two texts of one length differ; that length for others."""
    if len(one) != len(other):
        return max(len(one), len(other))
    return sum(a != b for a, b in zip(one, other, strict=True))


def read_configuration(
    table: Mapping[str, object], source: str = "", others: Collection[str] = ()
) -> Configuration:
    """Configuration from a table of settings; ConfigurationError names what is wrong with it.

    ``others`` are keys that are about something else; tables, one for each command, are too.
    """
    single = [
        key
        for key, value in table.items()
        if key in RULE_KEYS or not isinstance(value, Mapping)
    ]
    refuse_unknown(single, (*RULE_KEYS, *others), source)
    severity = table.get("severity", {})
    if not isinstance(severity, Mapping):
        found = f"{source}: severity is {toml_text(severity)}"
        raise ConfigurationError(
            f"{found}, a table like {{D2R104 = 'warning'}} was expected"
        )
    for rule, value in severity.items():
        if value not in [*Severity]:
            found = f"{source}: severity of {rule} is {toml_text(value)}"
            raise ConfigurationError(f"{found}, one of {', '.join(Severity)} expected")
    return Configuration(
        _names(table, "select", source),
        _names(table, "ignore", source),
        dict(severity),
        source,
    )


def _names(table: Mapping[str, object], key: str, source: str) -> tuple[str, ...]:
    value = table.get(key, [])
    if not isinstance(value, list) or not all(isinstance(name, str) for name in value):
        raise ConfigurationError(
            f"{source}: {key} is {toml_text(value)}, a list of rule ids was expected"
        )
    return tuple(value)


class CheckedWindow(NamedTuple):
    """A window without the deck behind it, of which there may be thousands: where the card stands that opens it.

    ``cards`` number those that open and close it, None where none closes it.
    """

    unit: Unit
    tr: float
    td: float | None
    place: Field
    cards: tuple[int, int | None]

    @property
    def part(self) -> int | None:
        """The part; None for a part set or rigid body whose parts cannot be known."""
        return self.unit.part


class Checked(NamedTuple):
    """What was found in one deck; ``cards`` is the number of its switching cards, ``files`` all that were read.

    ``remarks`` tell of comments in the deck that silence nothing, ``notes`` of settings that are not used.
    """

    deck: str
    windows: tuple[CheckedWindow, ...]
    findings: tuple[Finding, ...]
    cards: int = 0
    files: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    solver: str = LS_DYNA


def configuration_for(
    deck: str, asked: Configuration, others: Collection[str] = ()
) -> Configuration:
    """Take the configuration nearest to a deck; what was asked for overrules its keys, ``others`` are none of them.

    Raises
    ------
    ConfigurationError
        If it cannot be read, or names a rule that does not exist.
    """
    nearest = nearest_settings(os.path.dirname(deck))  # noqa: PTH120  a name with a NUL byte has none
    found = read_configuration(nearest.table, nearest.source, others)
    found.verify(RULES)
    select, ignore = asked.select or found.select, asked.ignore or found.ignore
    return found._replace(select=select, ignore=ignore, notes=nearest.notes)


def check_deck(
    path: str,
    configuration: Configuration | None = None,
    judge: Judge | None = None,
    content: bytes | None = None,
    restarts: Sequence[str] = (),
) -> Checked:
    """Read a deck with its includes, or a Radioss run with its legs, and apply the rules.

    Parameters
    ----------
    path : str
        The main deck; or a file of a Radioss run, which is checked with the others of that run.
    configuration : Configuration, optional
        Which rules count, and how much; default: all, as they are.
    judge : HistoryJudge, optional
        Judges the windows by an energy history; without one the energy rules find nothing.
    content : bytes, optional
        What the deck holds, where it does not lie in a file.
    restarts : sequence of str, optional
        Small restarts of LS-DYNA that go on with its run: their cards switch when they begin.

    Returns
    -------
    Checked
        Windows by part and time, findings by file and line; findings silenced by a comment are left out.

    Raises
    ------
    DeckError
        If the deck itself cannot be read.
    ConfigurationError
        If the configuration names a rule that does not exist.
    """
    configuration = configuration or Configuration()
    configuration.verify(RULES)
    case = _read(path, content, judge, restarts)
    findings = _without_what_follows(list(_findings(case, configuration)))
    order = {path: 0}  # the deck itself first, its includes as they come
    for finding in findings:
        order.setdefault(finding.file, len(order))
    findings.sort(
        key=lambda finding: (
            order[finding.file],
            finding.line,
            finding.column,
            finding.rule,
        )
    )
    windows, remarks = tuple(_told(case.windows.windows)), tuple(_remarks(case.deck))
    return Checked(
        path,
        windows,
        tuple(findings),
        case.switching,
        tuple(case.deck.files),
        remarks,
        solver=case.solver,
    )


def _without_what_follows(findings: list[Finding]) -> list[Finding]:
    """Leave out findings that follow from a mistake of units, or of one time, which another finding reports."""
    causes = {finding.rule for finding in findings} & _FOLLOW.keys()
    follow = set[str]().union(*(_FOLLOW[rule] for rule in causes))
    places = {(finding.rule, finding.file, finding.line) for finding in findings}
    return [
        finding
        for finding in findings
        if finding.rule not in follow
        and not any(
            (cause, finding.file, finding.line) in places
            for cause in _FOLLOW_THERE.get(finding.rule, ())
        )
    ]


def _told(windows: Iterable[Window]) -> Iterator[CheckedWindow]:
    numbers: dict[SwitchSet, int] = {}
    for unit, tr, td, opened, closed in windows:
        opening = numbers.setdefault(opened.by, len(numbers))
        closing = numbers.setdefault(closed.by, len(numbers)) if closed else None
        yield CheckedWindow(unit, tr, td, opened.by.card.here, (opening, closing))


@cache
def _rules_for(
    solver: str, select: tuple[str, ...], ignore: tuple[str, ...], judged: bool
) -> tuple[Rule, ...]:
    """Give the rules that count, and look at decks of a solver: there may be thousands of those."""
    asked = Configuration(select, ignore)
    wanted = (
        rule for rule in RULES.values() if judged or not rule.id.startswith(_BY_HISTORY)
    )
    return tuple(
        rule for rule in wanted if solver in rule.solvers and asked.selects(rule.id)
    )


def _findings(case: Case, configuration: Configuration) -> Iterator[Finding]:
    """Apply the rules that count to what they look at; what a comment silences is left out."""
    solver, silences = case.solver, case.deck.silences
    for rule in _rules_for(solver, *configuration[:2], case.judge is not None):
        for place, message in rule.check(case):
            if silences(rule.id, place.file, place.line):
                continue
            severity = Severity(configuration.severity.get(rule.id, rule.severity))
            yield Finding(
                rule.id,
                severity,
                message,
                case.deck.path,
                place.file,
                place.line,
                place.column,
            )


def _read(
    path: str, content: bytes | None, judge: Judge | None, restarts: Sequence[str]
) -> Case:
    """Read a deck by what it is: a run of Radioss, or an LS-DYNA deck with its restarts."""
    source = SourceFile(path, content)
    of_radioss = source.read(0, 1) != b"*" and recognises(source.read(0, HEAD))
    if of_radioss and (content is not None or os.path.isfile(path)):  # noqa: PTH113  a pipe gives its bytes once
        from d2rpick.deck.radioss_run import read_run  # not above: start-up

        run = read_run(path, content)
        return RunCase(run.deck, judge, run=run)
    deck = read_deck(path, source)
    if restarts:
        from d2rpick.deck.restarts import join_restarts  # not above: start-up

        deck = join_restarts(deck, restarts)
    return Case(deck, judge)


def _remarks(deck: Deck) -> Iterator[str]:
    """Tell of comments that ignore rules that do not exist."""
    for card in deck.silencing:
        for name in card.block.silenced:
            if not (
                name.startswith("D2R") and any(rule.startswith(name) for rule in RULES)
            ):
                where = f"{card.file}: the comment before line {card.line}"
                yield f"{where} does not name a rule to ignore: {name!r} was found, {_expected_instead(name, RULES)}"
