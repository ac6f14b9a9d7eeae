"""Answers held against the JSON schemas that ship with the package; each schema is read and checked once."""

import json
from functools import cache
from importlib.resources import files
from typing import Any

import jsonschema


def check_by_schema(found: dict[str, Any]) -> None:
    """Hold an answer against the schema that ships with the package under its name."""
    _, command, version = found["schema"].split("/")
    _holder(f"{command}-{version}").validate(found)


def check_by_definition(found: Any, schema: str, definition: str) -> None:
    """Hold a part of an answer against a definition of the schema ``schema``."""
    _holder(schema, definition).validate(found)


@cache
def _holder(name: str, definition: str | None = None) -> jsonschema.Draft202012Validator:
    schema = json.loads((files("d2rpick") / "schemas" / f"{name}.json").read_text("utf-8"))
    jsonschema.Draft202012Validator.check_schema(schema)
    asked = {"$ref": f"#/$defs/{definition}", "$defs": schema["$defs"]} if definition else schema
    return jsonschema.Draft202012Validator(asked)
