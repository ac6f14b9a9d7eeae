"""The table of numbers that decide gives reasons only for constants that exist."""

from __future__ import annotations

from importlib import import_module

from tests.benchmarks.deciding_reasons import REASONS


def test_reasons_are_given_for_constants_of_the_package() -> None:
    for name in REASONS:
        module, _, constant = name.rpartition(".")
        assert hasattr(import_module(f"d2rpick.{module}"), constant), name
