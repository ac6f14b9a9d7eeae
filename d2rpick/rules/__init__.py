"""Rules of ``check``: the table of all rules, the configuration that selects rules, and the check of one deck.

Rules are configured in ``d2rpick.toml`` or in ``[tool.d2rpick]`` of pyproject.toml; the nearest file is used.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping
from functools import cache
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import ConfigurationError
from d2rpick.base.settings import (
    RULE_KEYS,
    find_nearest_settings,
    format_toml_value,
    refuse_unknown_settings,
)
from d2rpick.base.tuples import NamedTuple
from d2rpick.deck.radioss_files import HEAD, is_radioss
from d2rpick.deck.reader import Deck, read_deck
from d2rpick.deck.source import SourceFile
from d2rpick.rules import constraints, reading, runs, sets, switched_parts, times
from d2rpick.rules.base import LS_DYNA, Case, Finding, RunCase, Severity
from d2rpick.rules.rule import Rule

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.choice.pair.decision import Decision
    from d2rpick.deck.card import CardField
    from d2rpick.deck.switching import SwitchSet, Unit
    from d2rpick.rules.judgement import HistoryJudge as Judge


_MODULES = (reading, sets, times, switched_parts, constraints, runs)
_ALL = (
    value
    for module in _MODULES
    for value in vars(module).values()
    if isinstance(value, Rule)
)
# Prefix of the ids of the rules that need an energy history.
_BY_HISTORY: Final = "D2R2"
# Smallest similarity (0 to 1) between a wrong rule id and a suggested one; it allows one additional character.
_ALIKE: Final = 0.9
# Rules that only report consequences of a wrong unit, by the rule that reports the wrong unit.
_FOLLOW: Final = {
    "D2R115": {"D2R101", "D2R205", "D2R206", "D2R207"},
    "D2R207": {"D2R205", "D2R206"},
    "D2R206": {"D2R205"},
}
# Other rules that report the same mistake in the same field, keyed by rule.
_FOLLOW_THERE: Final = {"D2R205": {"D2R101"}}
# Other rules that report a wrong id of the same part, keyed by rule.
_FOLLOW_OF_PART: Final = {"D2R103": {"D2R106"}}
RULES: Final[Mapping[str, Rule]] = {
    rule.id: rule for rule in sorted(_ALL, key=lambda rule: rule.id)
}


def find_rules(name: str) -> tuple[Rule, ...]:
    """Return the rules whose id begins with ``name``.

    Raises
    ------
    ConfigurationError
        If there is no such rule; the message names the nearest id.

    Examples
    --------
    >>> [rule.id for rule in find_rules("d2r30")]
    ['D2R301', 'D2R302', 'D2R303', 'D2R304', 'D2R305', 'D2R306', 'D2R307']
    """
    matching = tuple(
        rule for rule in RULES.values() if name and rule.id.startswith(name.upper())
    )
    if not matching:
        raise ConfigurationError(f"no rule {name!r}, {_describe_expected(name, RULES)}")
    return matching


class Configuration(NamedTuple):
    """The selected rules, as ids or id prefixes (``D2R1``), and the rules whose severity is changed.

    ``ignore`` overrides ``select``; an empty ``select`` selects all rules. ``source`` is the settings file. ``notes``
    name settings files that are not used because they belong to another user.

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
        """Return True if the rule with this id is selected."""
        chosen = not self.select or rule.startswith(self.select)
        return chosen and not (self.ignore and rule.startswith(self.ignore))

    def verify(self, rule_ids: Collection[str]) -> None:
        """Raise ConfigurationError if the configuration names an unknown rule; the message suggests a similar rule."""
        where = f"{self.source}: " if self.source else ""
        for name in (*self.select, *self.ignore, *self.severity):
            exact = name in self.severity and name not in (*self.select, *self.ignore)
            if name in rule_ids or (
                not exact and name and any(rule.startswith(name) for rule in rule_ids)
            ):
                continue
            raise ConfigurationError(
                f"{where}no rule {name!r}, {_describe_expected(name, rule_ids)}"
            )


def _describe_expected(name: str, rule_ids: Collection[str]) -> str:
    """Return the part of an error message that lists the existing rule ids, with a similar id if there is one."""
    import difflib

    wanted = name.upper()
    near = [rule for rule in sorted(rule_ids) if _count_differences(rule, wanted) == 1]
    near = near or difflib.get_close_matches(wanted, rule_ids, n=1, cutoff=_ALIKE)
    text = "an id like D2R101 or its beginning was expected"
    if near:
        return f"{text}; did you mean {near[0]}?"
    return f"{text}; d2rpick rule lists all"


def _count_differences(first: str, second: str) -> int:
    """Return the number of characters in which two strings of equal length, or the longer of two, differ."""
    if len(first) != len(second):
        return max(len(first), len(second))
    return sum(a != b for a, b in zip(first, second, strict=True))


def read_configuration(
    table: Mapping[str, object], source: str = "", other_keys: Collection[str] = ()
) -> Configuration:
    """Return the configuration defined in a table of settings.

    ``other_keys`` are keys that belong to other commands; nested tables belong to the command that they are named
    after.

    Raises
    ------
    ConfigurationError
        If a key or value is wrong; the message names it.
    """
    single = [
        key
        for key, value in table.items()
        if key in RULE_KEYS or not isinstance(value, Mapping)
    ]
    refuse_unknown_settings(single, (*RULE_KEYS, *other_keys), source)
    severity = table.get("severity", {})
    if not isinstance(severity, Mapping):
        problem = f"{source}: severity is {format_toml_value(severity)}"
        raise ConfigurationError(
            f"{problem}, but a table like {{D2R104 = 'warning'}} was expected"
        )
    for rule, value in severity.items():
        if value not in [*Severity]:
            problem = f"{source}: severity of {rule} is {format_toml_value(value)}"
            raise ConfigurationError(
                f"{problem}, one of {', '.join(Severity)} expected"
            )
    return Configuration(
        _read_rule_names(table, "select", source),
        _read_rule_names(table, "ignore", source),
        dict(severity),
        source,
    )


def _read_rule_names(
    table: Mapping[str, object], key: str, source: str
) -> tuple[str, ...]:
    """Return the rule ids listed under a key of the settings."""
    value = table.get(key, [])
    if not isinstance(value, list) or not all(isinstance(name, str) for name in value):
        raise ConfigurationError(
            f"{source}: {key} is {format_toml_value(value)}, but a list of rule ids was expected"
        )
    return tuple(value)


class CheckedWindow(NamedTuple):
    """A rigid window; ``place`` is the card that opens it. A window does not keep the deck in memory.

    ``cards`` contains the numbers of the cards that open and close the window; the second one is None if no card closes
    it. ``decision`` is the verdict on its pair of times; None if no history judges the pair.
    """

    unit: Unit
    tr: float
    td: float | None
    place: CardField
    cards: tuple[int, int | None]
    decision: Decision | None = None

    @property
    def part(self) -> int | None:
        """Return the part id; None for a part set or rigid body whose parts are unknown."""
        return self.unit.part


class Checked(NamedTuple):
    """Result of the check of one deck: the number of its switching ``cards``, and all ``files`` that were read.

    ``switches_itself`` is True if forces or sensors of the run switch parts, at times that the deck does not contain.
    ``remarks`` report comments in the deck that silence no rule, ``notes`` report settings that are not used.
    """

    deck: str
    windows: tuple[CheckedWindow, ...]
    findings: tuple[Finding, ...]
    cards: int = 0
    files: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    solver: str = LS_DYNA
    switches_itself: bool = False


def find_configuration(
    deck: str, override: Configuration, other_keys: Collection[str] = ()
) -> Configuration:
    """Return the configuration closest to a deck; the keys of ``override`` replace keys of this configuration.

    ``other_keys`` are keys that belong to other commands.

    Raises
    ------
    ConfigurationError
        If the configuration cannot be read, or names a rule that does not exist.
    """
    nearest = find_nearest_settings(os.path.dirname(deck))  # noqa: PTH120  a name with a NUL byte has no folder
    nearest_configuration = read_configuration(
        nearest.table, nearest.source, other_keys
    )
    nearest_configuration.verify(RULES)
    select = override.select or nearest_configuration.select
    ignore = override.ignore or nearest_configuration.ignore
    return nearest_configuration._replace(
        select=select, ignore=ignore, notes=nearest.notes
    )


def check_deck(
    path: str,
    configuration: Configuration | None = None,
    judge: Judge | None = None,
    content: bytes | None = None,
    restarts: Sequence[str] = (),
) -> Checked:
    """Read a deck with its includes, or a Radioss run with its engine runs, and apply the rules.

    Parameters
    ----------
    path : str
        The main deck; or a file of a Radioss run, which is checked with the others of that run.
    configuration : Configuration, optional
        Selected rules and their severities; the default is all rules with their default severities.
    judge : HistoryJudge, optional
        Judges the windows by an energy history; if it is None, the energy rules find nothing.
    content : bytes, optional
        Content of the deck, if it is not a file.
    restarts : sequence of str, optional
        Small restart decks of LS-DYNA that continue the run; their cards switch when the restart begins.

    Returns
    -------
    Checked
        Windows sorted by part and time, and findings sorted by file and line; findings silenced by a comment are
        omitted.

    Raises
    ------
    DeckError
        If the deck itself cannot be read.
    ConfigurationError
        If the configuration names a rule that does not exist.
    """
    configuration = configuration or Configuration()
    configuration.verify(RULES)
    case = _read_case(path, content, judge, restarts)
    findings = _remove_consequences(list(_apply_rules(case, configuration)))
    order = {path: 0}  # The deck comes first, followed by its include files in order.
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
    windows = tuple(_strip_windows(case))
    remarks = tuple(_list_remarks(case.deck))
    return Checked(
        path,
        windows,
        tuple(findings),
        case.switching,
        tuple(case.deck.files),
        remarks,
        solver=case.solver,
        switches_itself=case.switches_itself,
    )


def _remove_consequences(findings: list[Finding]) -> list[Finding]:
    """Remove findings that only follow from a wrong unit or time reported by another rule."""
    causes = {finding.rule for finding in findings} & _FOLLOW.keys()
    follow = set[str]().union(*(_FOLLOW[rule] for rule in causes))
    reported_fields = {
        (finding.rule, finding.file, finding.line) for finding in findings
    }
    reported_parts = {(finding.rule, _name_part(finding)) for finding in findings}
    return [
        finding
        for finding in findings
        if finding.rule not in follow
        and not any(
            (cause, finding.file, finding.line) in reported_fields
            for cause in _FOLLOW_THERE.get(finding.rule, ())
        )
        and not any(
            (cause, _name_part(finding)) in reported_parts
            for cause in _FOLLOW_OF_PART.get(finding.rule, ())
        )
    ]


def _name_part(finding: Finding) -> str:
    """Return the part with which the message of a finding begins, such as "part 21"."""
    return " ".join(finding.message.split()[:2])


def _strip_windows(case: Case) -> Iterator[CheckedWindow]:
    """Yield the windows with their verdicts in a form that does not keep the deck in memory."""
    numbers: dict[SwitchSet, int] = {}
    windows = case.windows.windows
    unjudged = [None] * len(windows)
    decisions = [judgement.decision for _, judgement in case.judgements] or unjudged
    for window, decision in zip(windows, decisions, strict=True):
        unit, tr, td, opened, closed = window
        opening = numbers.setdefault(opened.by, len(numbers))
        closing = numbers.setdefault(closed.by, len(numbers)) if closed else None
        yield CheckedWindow(
            unit,
            tr,
            td,
            opened.by.card.here,
            (opening, closing),
            decision,
        )


@cache
def _select_rules(
    solver: str, select: tuple[str, ...], ignore: tuple[str, ...], judged: bool
) -> tuple[Rule, ...]:
    """Return the selected rules for a solver. The result is cached, because a check may cover thousands of decks."""
    configuration = Configuration(select, ignore)
    wanted = (
        rule for rule in RULES.values() if judged or not rule.id.startswith(_BY_HISTORY)
    )
    return tuple(
        rule
        for rule in wanted
        if solver in rule.solvers and configuration.selects(rule.id)
    )


def _apply_rules(case: Case, configuration: Configuration) -> Iterator[Finding]:
    """Yield the findings of the selected rules, except those that a comment in the deck silences."""
    solver = case.solver
    silences = case.deck.silences
    for rule in _select_rules(solver, *configuration[:2], case.judge is not None):
        for field, message in rule.check(case):
            if silences(rule.id, field.file, field.line):
                continue
            severity = Severity(configuration.severity.get(rule.id, rule.severity))
            yield Finding(
                rule.id,
                severity,
                message,
                case.deck.path,
                field.file,
                field.line,
                field.column,
            )


def _read_case(
    path: str, content: bytes | None, judge: Judge | None, restarts: Sequence[str]
) -> Case:
    """Read a deck according to its content, as a Radioss run or as an LS-DYNA deck with its restarts."""
    source = SourceFile(path, content)
    of_radioss = source.read(0, 1) != b"*" and is_radioss(source.read(0, HEAD))
    if of_radioss and (content is not None or os.path.isfile(path)):  # noqa: PTH113  a pipe can be read only once
        # Imported here to keep start-up fast.
        from d2rpick.deck.radioss_run import read_run

        run = read_run(path, content)
        return RunCase(run.deck, judge, run=run)
    deck = read_deck(path, source)
    if restarts:
        # Imported here to keep start-up fast.
        from d2rpick.deck.restarts import join_restarts

        deck = join_restarts(deck, restarts)
    return Case(deck, judge)


def _list_remarks(deck: Deck) -> Iterator[str]:
    """Yield remarks on comments that try to silence nonexistent rules."""
    for card in deck.silencing:
        for name in card.block.silenced:
            if not (
                name.startswith("D2R") and any(rule.startswith(name) for rule in RULES)
            ):
                where = f"{card.file}: the comment before line {card.line}"
                yield f"{where} ignores no rule: found {name!r}, {_describe_expected(name, RULES)}"
