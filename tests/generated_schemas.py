"""JSON schemas of the results, generated from their fields.

Each schema is self-contained, so that a validator needs no other file.  ``python -m tests.generated_schemas`` writes
them.  Check the difference before you commit it: keys may only be added, unless the schema gets a new number.
"""

import json
from collections.abc import Mapping
from importlib import import_module
from typing import Any

from d2rpick.report.fields import Document, Field, Kind, get_kind
from d2rpick.report.formats import FORMATS
from tests.command import ROOT
from validation.published import reproduction

SCHEMAS = ROOT / "d2rpick" / "schemas"
DRAFT = "https://json-schema.org/draft/2020-12/schema"


def list_documents() -> dict[str, Document]:
    """Return the documents of all results by the names of their schemas, for example ``suggest-1``."""
    document_types = (
        reproduction.DOCUMENT,
        *(import_module(f"d2rpick.report.{result}").DOCUMENT for result in FORMATS),
    )
    return {
        document_type.name.removeprefix("d2rpick/").replace("/", "-"): document_type
        for document_type in document_types
    }


def read_shipped(name: str) -> dict[str, Any]:
    """Read a schema of the package."""
    schema: dict[str, Any] = json.loads((SCHEMAS / f"{name}.json").read_text("utf-8"))
    return schema


def make_schema(document: Document) -> dict[str, Any]:
    """Generate the schema of a document, including the definitions it refers to."""
    defined: dict[str, Any] = {}
    whole = _make_plain(document.whole.schema, defined, document.closed)
    for kind in document.also:
        _make_plain(kind, defined, document.closed)
    about = {
        "$schema": DRAFT,
        "title": f"d2rpick {document.name.split('/')[1]}",
        "description": document.meaning,
    }
    return {**about, **whole, **({"$defs": defined} if defined else {})}


def _make_plain(schema: Any, defined: dict[str, Any], closed: bool) -> Any:
    """Convert kinds and fields to JSON schema; put each named kind into ``defined`` and refer to it."""
    if isinstance(schema, Field):
        plain = _make_plain(get_kind(schema.kind), defined, closed)
        return {**plain, "description": schema.meaning} if schema.meaning else plain
    if isinstance(schema, Kind):
        if not schema.name:
            return _make_plain(schema.schema, defined, closed)
        defined[schema.name] = {
            **_make_plain(schema.schema, defined, closed),
            **defined.get(schema.name, {}),
        }
        return {"$ref": f"#/$defs/{schema.name}"}
    if isinstance(schema, Mapping):
        plain = {
            key: _make_plain(value, defined, closed) for key, value in schema.items()
        }
        return (
            {**plain, "additionalProperties": False}
            if closed and "properties" in plain
            else plain
        )
    return (
        [_make_plain(element, defined, closed) for element in schema]
        if isinstance(schema, (list, tuple))
        else schema
    )


if __name__ == "__main__":
    for name, document in list_documents().items():
        (SCHEMAS / f"{name}.json").write_text(
            f"{json.dumps(make_schema(document), indent=1)}\n", "utf-8"
        )
