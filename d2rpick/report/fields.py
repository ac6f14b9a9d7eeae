"""Fields of results: each key once, with its kind, its meaning and where its value is taken from.

From a row of fields follow the JSON of a thing, its line of csv, the columns of a frame, and what the schemas in
``d2rpick/schemas`` say of it.  Keys are only ever added.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Final, Literal

from d2rpick.base import __version__
from d2rpick.base.tuples import NamedTuple
from d2rpick.report import tables


class Kind(NamedTuple):
    """What values a key has: ``schema`` says it to a validator, ``plain`` makes of one what JSON can hold.

    Within ``schema`` other kinds stand for their schemas; one with a ``name`` is a definition that is referred to.
    A row, an object, has ``fields``, in their order.
    """

    schema: Mapping[str, Any]
    plain: Callable[[Any], Any] = lambda value: value
    name: str = ""
    fields: tuple[Field, ...] = ()

    @property
    def keys(self) -> list[str]:
        """Names of the fields: columns of a csv or a frame."""
        return [field.key for field in self.fields]

    def of_part(
        self, part: Callable[[Any], Any], keys: Iterable[str] = ()
    ) -> list[Field]:
        """Take the fields with these ``keys``, or all, into the row of things with such a ``part``."""
        return [_in_part(self.field(key), part) for key in (keys or self.keys)]

    def field(self, key: str) -> Field:
        """Give a field by its key."""
        return next(field for field in self.fields if field.key == key)


# Kinds that many fields have; with a question mark they may be None.  A size is a number that is not negative.
Name = Literal[
    "number", "number?", "size?", "integer", "integer?", "text", "text?", "texts", "texts?", "flag", "flag?", "span",
    "span?",
]  # fmt: skip


class Field(NamedTuple):
    """A key with its kind and meaning; its value is what ``get`` takes from a thing, else what bears its name there.

    ``later``: it came after every schema that has it, so that older results may lack it.
    """

    key: str
    kind: Kind | Name
    meaning: str = ""
    get: Callable[[Any], Any] | None = None
    later: bool = False

    def of(self, thing: Any) -> Any:
        """Give the value that JSON has of a thing."""
        return kind_of(self.kind).plain(self.taken(thing))

    def taken(self, thing: Any) -> Any:
        """Give the value as the thing has it."""
        if self.get:
            return self.get(thing)
        if isinstance(thing, Mapping):
            return thing[self.key]
        return getattr(thing, self.key)


def _in_part(field: Field, part: Callable[[Any], Any]) -> Field:
    return field._replace(
        get=lambda thing: None if (found := part(thing)) is None else field.taken(found)
    )


def row(
    *fields: Field,
    name: str = "",
    later: Iterable[str] = (),
    closed: bool = False,
    **more: Any,
) -> Kind:
    """Make a row; keys that came ``later`` than its schema may be missing from results, a ``closed`` one has no others.

    ``more`` goes into its schema as it is.

    Examples
    --------
    >>> part = row(Field("id", "integer"), Field("title", "text", get=lambda part: part.title.strip()))
    >>> from types import SimpleNamespace
    >>> part.plain(SimpleNamespace(id=7, title="door "))
    {'id': 7, 'title': 'door'}
    """
    schema = {
        "type": "object",
        "required": [
            field.key for field in fields if not field.later and field.key not in later
        ],
        "properties": {field.key: field for field in fields},
        **({"additionalProperties": False} if closed else {}),
        **more,
    }
    return Kind(
        schema,
        lambda thing: {field.key: field.of(thing) for field in fields},
        name,
        fields,
    )


def kind_of(kind: Kind | Name, **limits: Any) -> Kind:
    """Give a kind by its name, within limits in the words of JSON schema: ``minimum=0``."""
    known = _KINDS[kind] if isinstance(kind, str) else kind
    if limits:
        return Kind({**known.schema, **limits}, known.plain, known.name)
    return known


def maybe(kind: Kind | Name) -> Kind:
    """Let values be None where they are not known."""
    kind = kind_of(kind)
    known = kind.schema
    if None in known.get("enum", ()) or "null" in known.get("type", ()):
        return kind
    if "enum" in known:
        null = {"enum": [*known["enum"], None]}
    else:
        null = {"type": [known["type"], "null"]}
    return Kind(
        {**known, **null},
        lambda value: None if value is None else kind.plain(value),
        kind.name,
    )


def many(kind: Kind | Name) -> Kind:
    """Give the kind of an array."""
    one = kind_of(kind)
    return Kind(
        {"type": "array", "items": one},
        lambda values: [one.plain(value) for value in values],
    )


def each(kind: Name) -> Kind:
    """Give the kind of an object with any keys, whose values are of one kind."""
    return Kind({"type": "object", "additionalProperties": kind_of(kind)}, dict)


def one_of(*names: str) -> Kind:
    """Give the kind of a word among these."""
    return Kind({"enum": list(names)})


_NUMBER: Final = Kind({"type": "number"})
_TEXT: Final = Kind({"type": "string"})
_KNOWN: Final = {
    "number": _NUMBER,
    "size": Kind({"type": "number", "minimum": 0}),
    "integer": Kind({"type": "integer"}),
    "text": _TEXT,
    "texts": Kind({"type": "array", "items": _TEXT}, list),
    "flag": Kind({"type": "boolean"}),
    "span": Kind(
        {"type": "array", "items": _NUMBER, "minItems": 2, "maxItems": 2}, list
    ),
}
_KINDS: Final = {**_KNOWN, **{f"{name}?": maybe(kind) for name, kind in _KNOWN.items()}}


class Document(NamedTuple):
    """A result as JSON: the ``name`` of its schema, what it is, and its fields below schema, version and command.

    No object of a ``closed`` one has other keys; its schema defines ``also`` what other forms of the result hold.
    """

    name: str
    meaning: str
    row: Kind
    closed: bool = False
    also: tuple[Kind, ...] = ()

    @property
    def whole(self) -> Kind:
        """All its fields."""
        head = (
            Field("schema", Kind({"const": self.name})),
            Field("tool_version", "text"),
            Field("command", "texts"),
        )
        known = self.row.schema
        later = {*self.row.keys} - {*known["required"]}
        more = {
            key: value
            for key, value in known.items()
            if key not in ("type", "required", "properties")
        }
        return row(*head, *self.row.fields, later=later, **more)

    def of(self, answer: Any, command: Sequence[str]) -> dict[str, Any]:
        """Give what the JSON holds; ``command`` are the arguments that repeat the answer."""
        head = {
            "schema": self.name,
            "tool_version": __version__,
            "command": list(command),
        }
        return {**head, **self.row.plain(answer)}

    def as_json(
        self, answer: Any, command: Sequence[str], indent: int | None = 2
    ) -> str:
        """Write an answer by its schema; without an ``indent`` in one line, to be appended to those of other runs."""
        return tables.as_json(self.of(answer, command), indent)


def csv_of(
    keys: Sequence[str], rows: Iterable[Mapping[str, Any]], between: str = "; "
) -> str:
    """Write rows as csv with these columns; what is a list in JSON is joined in its cell."""
    return tables.as_csv(
        keys, ([_cell(found[key], between) for key in keys] for found in rows)
    ).rstrip("\n")


def _cell(value: Any, between: str) -> tables.Cell:
    if isinstance(value, Mapping):
        value = [f"{count} {kind}" for kind, count in value.items()]
    return between.join(map(str, value)) if isinstance(value, (list, tuple)) else value
