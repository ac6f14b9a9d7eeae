"""Validate answers by the JSON schemas of the package, and findings by public schemas; each schema is read once."""

import json
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import jsonschema

from tests.command import run_json

OF_OTHERS = Path(__file__).with_name("schemas")


def check_by_schema(document: dict[str, Any]) -> None:
    """Validate an answer by the schema of the package that it names."""
    _, command, version = document["schema"].split("/")
    _make_validator(f"{command}-{version}").validate(document)


def run_json_checked(*args: str) -> dict[str, Any]:
    """Run a command as `answer` does, and validate the document."""
    check_by_schema(document := run_json(*args))
    return document


def check_by_definition(document: Any, schema: str, definition: str) -> None:
    """Validate a part of an answer by a definition of the schema ``schema``."""
    _make_validator(schema, definition).validate(document)


def check_junit(text: str) -> None:
    _junit().validate(text)


def check_sarif(text: str) -> None:
    _sarif().validate(json.loads(text))


@cache
def _junit() -> Any:
    import xmlschema  # slow

    return xmlschema.XMLSchema(str(OF_OTHERS / "junit-10.xsd"))


@cache
def _sarif() -> jsonschema.Draft4Validator:
    return jsonschema.Draft4Validator(
        json.loads((OF_OTHERS / "sarif-2.1.0.json").read_text("utf-8"))
    )


@cache
def _make_validator(
    name: str, definition: str | None = None
) -> jsonschema.Draft202012Validator:
    schema = json.loads(
        (files("d2rpick") / "schemas" / f"{name}.json").read_text("utf-8")
    )
    jsonschema.Draft202012Validator.check_schema(schema)
    reference = (
        {"$ref": f"#/$defs/{definition}", "$defs": schema["$defs"]}
        if definition
        else schema
    )
    return jsonschema.Draft202012Validator(reference)
