"""Constants of `deciding_numbers`: where they are used, and how to scale a constant wherever a module holds it."""

from __future__ import annotations

import ast
import importlib
import inspect
import pkgutil
import re
import sys
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from math import isfinite
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any, Final, NamedTuple

import d2rpick
from d2rpick.base.caching import cached_property

PACKAGES: Final = ("vibration", "flight", "choice")

Number = float | int | tuple[float, ...]
# The name of a module, and a name in this module.
Binding = tuple[str, str]
# Name of one of several constants that share a comment; it precedes the text about this constant.
_LABEL: Final = re.compile(r"(?:^|(?<= ))(_?[A-Z][A-Z0-9_]+): ")


class Constant(NamedTuple):
    """Numeric constant: its module, its value, and its comment."""

    module: str
    name: str
    value: Number
    comment: str

    @property
    def short_name(self) -> str:
        """Name without the package."""
        return f"{self.module.removeprefix('d2rpick.')}.{self.name}"


class Line(NamedTuple):
    """Line of a source file."""

    file: str
    number: int


class DefaultArgument(NamedTuple):
    """Default of an argument or of a class field that is given by a constant."""

    module: str
    owner: str
    definition: ast.FunctionDef | ast.ClassDef
    argument: str
    expression: ast.expr


class Uses(NamedTuple):
    """Where a constant is used.

    `bindings` are all names that hold it or a value computed from it, each computed from earlier ones,
    with the statement that computes it (None for an import).  `lines` are those of functions that read one of them.
    """

    bindings: list[tuple[Binding, ast.stmt | None]]
    defaults: list[DefaultArgument]
    lines: frozenset[Line]


class Source:
    """Syntax of a module, and the names that it reads."""

    def __init__(self, module: ModuleType) -> None:
        self.module = module
        self.file = str(module.__file__)
        self.text = Path(self.file).read_text(encoding="utf-8")
        self.tree = ast.parse(self.text)

    @cached_property
    def imports(self) -> dict[str, Binding]:
        """The source of each imported name, including imports inside functions."""
        return {
            alias.asname or alias.name: (node.module, alias.name)
            for node in ast.walk(self.tree)
            if isinstance(node, ast.ImportFrom) and node.module
            for alias in node.names
        }

    @cached_property
    def assignments(self) -> list[tuple[list[str], ast.Assign | ast.AnnAssign]]:
        """The names that the module assigns at its top level, with each statement."""
        assignments = []
        for statement in self.tree.body:
            if isinstance(statement, ast.Assign):
                target = statement.targets[0]
            elif isinstance(statement, ast.AnnAssign) and statement.value is not None:
                target = statement.target
            else:
                continue
            elements = target.elts if isinstance(target, ast.Tuple) else [target]
            names = [node.id for node in elements if isinstance(node, ast.Name)]
            assignments.append((names, statement))
        return assignments

    @cached_property
    def reads_in_functions(self) -> dict[str, set[Line]]:
        """The lines inside functions that read each name or attribute, keyed by the name."""
        reads: dict[str, set[Line]] = defaultdict(set)
        for function in ast.walk(self.tree):
            if isinstance(function, ast.FunctionDef):
                for statement in function.body:
                    for name, number in self._find_names(statement):
                        reads[name].add(Line(self.file, number))
        return reads

    @cached_property
    def defaults(self) -> list[DefaultArgument]:
        """Defaults of the arguments of functions and methods, and of the fields of classes."""
        defaults = []
        for owner, node in self._list_definitions():
            if isinstance(node, ast.FunctionDef):
                arguments = [*node.args.posonlyargs, *node.args.args]
                without_default = len(arguments) - len(node.args.defaults)
                pairs = [
                    *zip(arguments[without_default:], node.args.defaults, strict=True),
                    *zip(node.args.kwonlyargs, node.args.kw_defaults, strict=True),
                ]
                fields = [(argument.arg, value) for argument, value in pairs]
            else:
                fields = [
                    (statement.target.id, statement.value)
                    for statement in node.body
                    if isinstance(statement, ast.AnnAssign)
                    and isinstance(statement.target, ast.Name)
                ]
            defaults += [
                DefaultArgument(self.module.__name__, owner, node, name, value)
                for name, value in fields
                if value is not None
            ]
        return defaults

    def find_comment(self, statement: ast.stmt, name: str) -> str:
        """Return what the comment above a statement says about a name, or the comment at the end of its last line.

        Statements without an empty line between them share a comment.  In it, ``NAME:`` begins what concerns one name.
        """
        assert statement.end_lineno is not None
        lines = self.text.split("\n")
        comment_on_line = lines[statement.end_lineno - 1].partition("  # ")[2]
        row = statement.lineno - 2
        while row >= 0 and lines[row] and not lines[row].startswith("#"):
            row -= 1
        above: list[str] = []
        while row >= 0 and lines[row].startswith("#"):
            above.insert(0, lines[row].lstrip("# "))
            row -= 1
        if not above:
            return comment_on_line
        introduction, *labelled = _LABEL.split(" ".join(above))
        pieces = dict(zip(labelled[::2], labelled[1::2], strict=True))
        return pieces.get(name, introduction).strip() or comment_on_line

    def _find_names(self, statement: ast.stmt) -> Iterator[tuple[str, int]]:
        for node in ast.walk(statement):
            if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
                yield node.id, node.lineno
            elif isinstance(node, ast.Attribute):
                yield node.attr, node.lineno

    def _list_definitions(
        self,
    ) -> Iterator[tuple[str, ast.FunctionDef | ast.ClassDef]]:
        """Yield the functions, classes and methods of the module with their names (`Class.method`)."""
        for node in self.tree.body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                yield node.name, node
            if isinstance(node, ast.ClassDef):
                for member in node.body:
                    if isinstance(member, ast.FunctionDef):
                        yield f"{node.name}.{member.name}", member


def read_sources() -> dict[str, Source]:
    """Import all modules, so that a child process imports nothing else, and read their syntax."""
    names = [
        module.name
        for module in pkgutil.walk_packages(d2rpick.__path__, "d2rpick.")
        if not module.name.endswith("__main__")
    ]
    return {name: Source(importlib.import_module(name)) for name in names}


def find_constants(sources: Mapping[str, Source]) -> list[Constant]:
    """List the numeric constants at module level of `PACKAGES`, except zeros, infinity and truth values."""
    constants = []
    for source in sources.values():
        module = source.module
        if module.__name__.split(".")[1] not in PACKAGES:
            continue
        for names, statement in source.assignments:
            for name in names:
                value = getattr(module, name)
                if name.isupper() and _is_number(value):
                    comment = source.find_comment(statement, name)
                    constants.append(Constant(module.__name__, name, value, comment))
    return constants


def _is_number(value: object) -> bool:
    if isinstance(value, tuple) and value:
        return all(_is_number(element) for element in value)
    if isinstance(value, bool) or not isinstance(value, float | int):
        return False
    return value != 0 and isfinite(value)


def find_uses(sources: Mapping[str, Source], constant: Constant) -> Uses:
    """Find all names that hold a constant or a value computed from it, and the lines that read them."""
    origin = (constant.module, constant.name)
    bindings: dict[Binding, ast.stmt | None] = {origin: None}
    waiting = [origin]
    while waiting:
        module_name, name = waiting.pop(0)
        followers = list(_find_followers(sources, module_name, name))
        for binding, statement in followers:
            if binding not in bindings:
                bindings[binding] = statement
                waiting.append(binding)
    names_of_modules: dict[str, set[str]] = defaultdict(set)
    for module_name, name in bindings:
        names_of_modules[module_name].add(name)
    defaults: list[DefaultArgument] = []
    lines: set[Line] = set()
    for module_name, names in names_of_modules.items():
        source = sources[module_name]
        defaults += [
            default
            for default in source.defaults
            if names & _find_loaded_names(default.expression)
        ]
        for name in names:
            lines |= source.reads_in_functions.get(name, set())
    # Modules that are used as a whole: `margin.NAME`.
    for source in sources.values():
        if sys.modules[constant.module] in vars(source.module).values():
            lines |= source.reads_in_functions.get(constant.name, set())
    for default in defaults:
        lines.update(_find_readers(sources, default))
    return Uses(list(bindings.items()), defaults, frozenset(lines))


def _find_readers(
    sources: Mapping[str, Source], default: DefaultArgument
) -> Iterator[Line]:
    """Yield the lines of the function with this default, or all lines that read an attribute of this name."""
    source = sources[default.module]
    if isinstance(default.definition, ast.ClassDef):
        for reader in sources.values():
            yield from reader.reads_in_functions.get(default.argument, ())
    else:
        for statement in default.definition.body:
            yield Line(source.file, statement.lineno)


def _find_followers(
    sources: Mapping[str, Source], module_name: str, name: str
) -> Iterator[tuple[Binding, ast.stmt | None]]:
    """Yield the imports of a name, and the names that its module computes from it."""
    for importer, source in sources.items():
        for local_name, origin in source.imports.items():
            if origin == (module_name, name) and hasattr(source.module, local_name):
                yield (importer, local_name), None
    for names, statement in sources[module_name].assignments:
        assert statement.value is not None
        if name in _find_loaded_names(statement.value):
            for assigned_name in names:
                yield (module_name, assigned_name), statement


def _find_loaded_names(expression: ast.expr) -> set[str]:
    return {node.id for node in ast.walk(expression) if isinstance(node, ast.Name)}


def scale(value: Number, factor: float) -> Number:
    """Scale a number, or each of several; whole numbers stay whole and at least 1."""
    if isinstance(value, tuple):
        return tuple(scale(element, factor) for element in value)  # type: ignore[misc]
    if isinstance(value, int):
        return max(1, round(value * factor))
    return value * factor


def scale_constant(
    sources: Mapping[str, Source], constant: Constant, uses: Uses, factor: float
) -> None:
    """Scale a constant in this process wherever a module, a default argument or a field holds it."""
    home = sources[constant.module]
    setattr(home.module, constant.name, scale(constant.value, factor))
    for (module_name, name), statement in uses.bindings[1:]:
        source = sources[module_name]
        if statement is not None:
            # The value is computed from the constant, so it is computed again.
            exec(
                compile(ast.Module([statement], []), "again", "exec"),
                vars(source.module),
            )
        else:
            origin_module, origin_name = source.imports[name]
            origin_value = getattr(sys.modules[origin_module], origin_name)
            setattr(source.module, name, origin_value)
    for default in uses.defaults:
        _renew_default(sources[default.module].module, default)


def _renew_default(module: ModuleType, default: DefaultArgument) -> None:
    """Compute a default again, and set it in the function or in the functions that make the class."""
    value = eval(
        compile(ast.Expression(default.expression), "again", "eval"), vars(module)
    )
    owner: Any = module
    for name in default.owner.split("."):
        owner = getattr(owner, name)
    makers: Sequence[Any] = (owner,)
    if isinstance(owner, type):
        makers = (owner.__new__, owner.__init__)  # type: ignore[misc]
        if not hasattr(owner, "_fields") and hasattr(owner, default.argument):
            setattr(owner, default.argument, value)
    for maker in makers:
        function = inspect.unwrap(maker)
        if isinstance(function, FunctionType):
            _set_default(function, default.argument, value)


def _set_default(function: FunctionType, argument: str, value: object) -> None:
    code = function.__code__
    names = code.co_varnames[: code.co_argcount]
    if function.__kwdefaults__ and argument in function.__kwdefaults__:
        function.__kwdefaults__[argument] = value
    elif argument in names and function.__defaults__:
        position = names.index(argument) - len(names)
        defaults = list(function.__defaults__)
        if -position <= len(defaults):
            defaults[position] = value
            function.__defaults__ = tuple(defaults)
