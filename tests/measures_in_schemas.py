"""The measures of a pair in the schemas: described once, for the candidates of ``suggest``, and copied to the others.

Each schema stands alone, so that a validator needs no other file.  ``python -m tests.measures_in_schemas`` copies the
measures into those of ``verify`` and ``explore``; read the difference before you commit it.
"""

from __future__ import annotations

import json
from typing import Any

from d2rpick.report import keys
from tests.command import ROOT

SCHEMAS = ROOT / "d2rpick" / "schemas"
COPIES = ("verify-1", "explore-1")


def schema_of(name: str) -> dict[str, Any]:
    """Read a schema."""
    found: dict[str, Any] = json.loads((SCHEMAS / f"{name}.json").read_text("utf-8"))
    return found


def of_candidates() -> dict[str, Any]:
    """What the schema of ``suggest`` says of the keys of a candidate."""
    found: dict[str, Any] = schema_of("suggest-1")["$defs"]["candidate"]["properties"]
    return found


def renewed(name: str) -> dict[str, Any]:
    """Schema of a copy with the measures as they are described for ``suggest``."""
    schema, described = schema_of(name), of_candidates()
    if name == "verify-1":
        schema["properties"].update({measure: described[measure] for measure in keys.MEASURES})
    else:  # an offer may have no candidate
        offer = schema["properties"]["offers"]["items"]["properties"]
        offer.update({measure: _or_null(described[measure]) for measure in keys.MEASURES})
    return schema


def _or_null(described: dict[str, Any]) -> dict[str, Any]:
    kinds = described["type"]
    return {**described, "type": kinds if isinstance(kinds, list) else [kinds, "null"]}


if __name__ == "__main__":
    for copy in COPIES:
        (SCHEMAS / f"{copy}.json").write_text(f"{json.dumps(renewed(copy), indent=1)}\n", "utf-8")
