"""Define the fields of results: the type, the meaning and the source of the value for each key.

A row of fields determines the JSON of an object, its CSV row, the columns of a frame, and the schemas in
``d2rpick/schemas``.  As long as the schema number is the same, keys are added but never removed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Final, Literal

from d2rpick.base import __version__
from d2rpick.base.tuples import NamedTuple
from d2rpick.report import tables


class Kind(NamedTuple):
    """A type of values: ``schema`` is its JSON schema, and ``plain`` converts a value to JSON.

    Within ``schema``, other kinds are replaced by their schemas.  A kind with a ``name`` becomes a definition to which
    others refer.  The kind of an object (a row) has ``fields`` in display order.
    """

    schema: Mapping[str, Any]
    plain: Callable[[Any], Any] = lambda value: value
    name: str = ""
    fields: tuple[Field, ...] = ()

    @property
    def keys(self) -> list[str]:
        """Names of the fields, which are the columns of a CSV file or a data frame."""
        return [field.key for field in self.fields]

    def of_part(
        self, part: Callable[[Any], Any], keys: Iterable[str] = ()
    ) -> list[Field]:
        """Return the fields with these ``keys``, or all fields; ``part`` returns the object that has their values."""
        return [_read_from_part(self.field(key), part) for key in (keys or self.keys)]

    def field(self, key: str) -> Field:
        """Return a field by its key."""
        return next(field for field in self.fields if field.key == key)


# Types that many fields use. A question mark means that None is allowed. A "size" is a number that is at least 0.
Name = Literal[
    "number", "number?", "size?", "integer", "integer?", "text", "text?", "texts", "texts?", "flag", "flag?", "span",
    "span?",
]  # fmt: skip


class Field(NamedTuple):
    """A key with the type and meaning of its value; ``get`` returns the value (by default the attribute of that name).

    ``later`` is True if the field was added after the first schema, so that older results may lack it.
    """

    key: str
    kind: Kind | Name
    meaning: str = ""
    get: Callable[[Any], Any] | None = None
    later: bool = False

    def of(self, thing: Any) -> Any:
        """Return the value of this field of an object, converted to JSON."""
        return get_kind(self.kind).plain(self.taken(thing))

    def taken(self, thing: Any) -> Any:
        """Return the value of this field of an object, unchanged."""
        if self.get:
            return self.get(thing)
        if isinstance(thing, Mapping):
            return thing[self.key]
        return getattr(thing, self.key)


def _read_from_part(field: Field, part: Callable[[Any], Any]) -> Field:
    return field._replace(
        get=lambda thing: None if (inner := part(thing)) is None else field.taken(inner)
    )


def row(
    *fields: Field,
    name: str = "",
    later: Iterable[str] = (),
    closed: bool = False,
    **keywords: Any,
) -> Kind:
    """Make the type of an object with these fields. A ``closed`` object has no other keys.

    Results of older versions may lack the keys in ``later``; other ``keywords`` are added to the schema unchanged.

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
        **keywords,
    }
    return Kind(
        schema,
        lambda thing: {field.key: field.of(thing) for field in fields},
        name,
        fields,
    )


def get_kind(kind: Kind | Name, **limits: Any) -> Kind:
    """Return a type by its name, with limits as in JSON schema, such as ``minimum=0``."""
    named_kind = _KINDS[kind] if isinstance(kind, str) else kind
    if limits:
        return Kind({**named_kind.schema, **limits}, named_kind.plain, named_kind.name)
    return named_kind


def maybe(kind: Kind | Name) -> Kind:
    """Return a type that also allows None, for values that may be unknown."""
    kind = get_kind(kind)
    schema = kind.schema
    if None in schema.get("enum", ()) or "null" in schema.get("type", ()):
        return kind
    if "enum" in schema:
        null = {"enum": [*schema["enum"], None]}
    else:
        null = {"type": [schema["type"], "null"]}
    return Kind(
        {**schema, **null},
        lambda value: None if value is None else kind.plain(value),
        kind.name,
    )


def many(kind: Kind | Name) -> Kind:
    """Return the type of an array whose values have the given type."""
    item_kind = get_kind(kind)
    return Kind(
        {"type": "array", "items": item_kind},
        lambda values: [item_kind.plain(value) for value in values],
    )


def each(kind: Name) -> Kind:
    """Return the type of an object with arbitrary keys whose values all have the given type."""
    return Kind({"type": "object", "additionalProperties": get_kind(kind)}, dict)


def one_of(*names: str) -> Kind:
    """Return a type that allows only the words in ``names``."""
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
    """A result as JSON: its schema ``name``, its description, and its own fields.

    They follow the fields that are common to all documents.
    Objects of a ``closed`` document have no other keys.  ``also`` lists objects of other forms of the result, which the
    schema defines too.
    """

    name: str
    meaning: str
    row: Kind
    closed: bool = False
    also: tuple[Kind, ...] = ()

    @property
    def whole(self) -> Kind:
        """The type of an object with all fields of the document."""
        head = (
            Field(
                "schema", Kind({"const": self.name}), "name and number of the schema"
            ),
            Field("tool_version", "text", "version of d2rpick"),
            Field("command", "texts", "arguments that reproduce the answer"),
        )
        schema = self.row.schema
        later = {*self.row.keys} - {*schema["required"]}
        further_keys = {
            key: value
            for key, value in schema.items()
            if key not in ("type", "required", "properties")
        }
        return row(*head, *self.row.fields, later=later, **further_keys)

    def of(self, answer: Any, command: Sequence[str]) -> dict[str, Any]:
        """Return the content of the JSON document; ``command`` contains the arguments that reproduce it."""
        head = {
            "schema": self.name,
            "tool_version": __version__,
            "command": list(command),
        }
        return {**head, **self.row.plain(answer)}

    def as_json(
        self, answer: Any, command: Sequence[str], indent: int | None = 2
    ) -> str:
        """Write an answer according to its schema; without ``indent``, write a single line (newline-delimited JSON)."""
        return tables.as_json(self.of(answer, command), indent)


def write_csv(
    keys: Sequence[str], rows: Iterable[Mapping[str, Any]], between: str = "; "
) -> str:
    """Write rows as CSV with these columns; the items of a list share one cell."""
    return tables.as_csv(
        keys, ([_make_cell(values[key], between) for key in keys] for values in rows)
    ).rstrip("\n")


def _make_cell(value: Any, between: str) -> tables.Cell:
    if isinstance(value, Mapping):
        value = [f"{count} {kind}" for kind, count in value.items()]
    return between.join(map(str, value)) if isinstance(value, (list, tuple)) else value
