"""The schemas that ship with the package, made from the fields of its results.

Each schema stands alone, so that a validator needs no other file.  ``python -m tests.generated_schemas`` writes them;
read the difference before you commit it: keys are only added.
"""

import json
from collections.abc import Mapping
from importlib import import_module
from typing import Any

from d2rpick.report.fields import Document, Field, Kind, kind_of
from d2rpick.report.formats import FORMATS
from tests.command import ROOT
from validation.published import reproduction

SCHEMAS = ROOT / "d2rpick" / "schemas"
DRAFT = "https://json-schema.org/draft/2020-12/schema"


def documents() -> dict[str, Document]:
    """Give the documents of all results by the names of their schemas, as ``suggest-1``."""
    found = (
        reproduction.DOCUMENT,
        *(import_module(f"d2rpick.report.{result}").DOCUMENT for result in FORMATS),
    )
    return {one.name.removeprefix("d2rpick/").replace("/", "-"): one for one in found}


def shipped(name: str) -> dict[str, Any]:
    """Read a schema as it ships."""
    found: dict[str, Any] = json.loads((SCHEMAS / f"{name}.json").read_text("utf-8"))
    return found


def schema_of(document: Document) -> dict[str, Any]:
    """Write the schema of a document, with the definitions that it needs."""
    defined: dict[str, Any] = {}
    whole = _plain(document.whole.schema, defined, document.closed)
    for kind in document.also:
        _plain(kind, defined, document.closed)
    about = {
        "$schema": DRAFT,
        "title": f"d2rpick {document.name.split('/')[1]}",
        "description": document.meaning,
    }
    return {**about, **whole, **({"$defs": defined} if defined else {})}


def _plain(schema: Any, defined: dict[str, Any], closed: bool) -> Any:
    """Put schemas in the place of kinds and fields; what has a name is defined once and referred to."""
    if isinstance(schema, Field):
        found = _plain(kind_of(schema.kind), defined, closed)
        described = (
            defined[kind_of(schema.kind).name] if kind_of(schema.kind).name else found
        )
        described.update({"description": schema.meaning} if schema.meaning else {})
        return found
    if isinstance(schema, Kind):
        if not schema.name:
            return _plain(schema.schema, defined, closed)
        defined[schema.name] = {
            **_plain(schema.schema, defined, closed),
            **defined.get(schema.name, {}),
        }
        return {"$ref": f"#/$defs/{schema.name}"}
    if isinstance(schema, Mapping):
        found = {key: _plain(value, defined, closed) for key, value in schema.items()}
        return (
            {**found, "additionalProperties": False}
            if closed and "properties" in found
            else found
        )
    return (
        [_plain(one, defined, closed) for one in schema]
        if isinstance(schema, (list, tuple))
        else schema
    )


if __name__ == "__main__":
    for name, document in documents().items():
        (SCHEMAS / f"{name}.json").write_text(
            f"{json.dumps(schema_of(document), indent=1)}\n", "utf-8"
        )
