"""``import d2rpick`` is fast, offers every public name, and its types are correct for users."""

import ast
import re
from importlib import import_module
from inspect import isfunction, signature
from typing import assert_type

import pandas as pd
import pytest

import d2rpick as d2
from d2rpick.api.choosing import Choosing
from tests.command import ENERGY, ROOT
from tests.examples import PAGES, read_page


@pytest.mark.parametrize("name", d2.__all__)
def test_every_public_name_is_there_and_says_what_it_is(name: str) -> None:
    assert getattr(d2, name).__doc__


def test_every_function_has_an_example_its_errors_and_its_arguments() -> None:
    for function in filter(isfunction, (getattr(d2, name) for name in d2.__all__)):
        text = function.__doc__ or ""
        assert ">>> " in text, function.__name__
        assert all(
            part in text for part in ("Parameters\n", "Raises\n", "Returns\n")
        ), function.__name__


def test_the_public_names_are_all_that_is_shown() -> None:
    assert dir(d2) == sorted(d2.__all__)


def test_what_the_docs_call_public_is_there_and_every_function_is_in_the_docs() -> None:
    documented_names = {
        name
        for page in PAGES
        for name in re.findall(r"\bd2\.([A-Za-z_]\w*)", read_page(page))
    }
    assert documented_names <= {*d2.__all__}
    assert {
        name for name in d2.__all__ if isfunction(getattr(d2, name))
    } <= documented_names


def test_what_a_function_takes_can_be_made_by_public_names() -> None:
    """Every class of this package that is an argument type must be public; other names are Python's or aliases."""
    hints = [*Choosing.__annotations__.values()]
    for function in filter(isfunction, (getattr(d2, name) for name in d2.__all__)):
        hints += [
            parameter.annotation
            for parameter in signature(function).parameters.values()
        ]
    words = {
        word
        for hint in hints
        for word in re.findall(
            r"(?<!\.)\b[A-Z]\w+", getattr(hint, "__forward_arg__", hint)
        )
    }
    private_types = {
        "IO",
        "Choosing",
        "Judging",
        "Iterable",
        "Mapping",
        "None",
        "Parts",
        "Path",
        "Time",
        "Unpack",
    }
    assert words - private_types <= {*d2.__all__}
    assert {"Weights", "Oscillator", "Run"} <= words


def test_the_stub_gives_editors_every_public_name_and_no_other() -> None:
    """Static tools cannot follow names that are imported on first use."""
    tree = ast.parse((ROOT / "d2rpick/__init__.pyi").read_text("utf-8"))
    imported = [node for node in tree.body if isinstance(node, ast.ImportFrom)]
    assert {name.asname for node in imported for name in node.names} == {*d2.__all__}
    for node in imported:
        module = import_module(node.module or "")
        for name in node.names:
            assert getattr(module, name.name) is getattr(d2, name.name)


def test_other_names_are_not() -> None:
    with pytest.raises(AttributeError, match="has no attribute 'sugest'"):
        d2.sugest  # type: ignore[attr-defined]  # noqa: B018


def test_types_hold_for_a_stranger() -> None:
    """mypy checks these types with only the knowledge of a user."""
    answer = d2.suggest(d2.read(ENERGY), td=0.0687534)
    assert_type(answer, d2.Suggestion)
    assert_type(answer.to_frame(), pd.DataFrame)
    assert answer.recommended is not None
    assert_type(answer.recommended.tr, float)
    assert_type(
        d2.verify(d2.read(ENERGY), tr=answer.recommended.tr, td=answer.td).verified,
        bool,
    )
