"""The command line called inside this process, with its output streams apart."""

from __future__ import annotations

import json
import shlex
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Any

from click.testing import CliRunner

from d2rpick.cli import d2rpick

if TYPE_CHECKING:
    from collections.abc import Mapping

    from click.testing import Result

ROOT = Path(__file__).resolve().parents[1]
ENERGY = str(ROOT / "sample_data" / "energy.csv")
GLSTAT = str(ROOT / "sample_data" / "energy.glstat")
ROLLOVER = str(ROOT / "sample_data" / "rollover.csv")
DECK = str(ROOT / "sample_data" / "switching.k")
BOX = str(ROOT / "sample_data" / "rolloverT01.gz")
OSCILLATOR = tuple(shlex.split("--stiffness 660e3 --mass 31.4 --beta 2 --alpha 50 --v0 6"))
# No colour variables and no options that the tester's own environment may set.
_ENVIRONMENT = {"NO_COLOR": None, "FORCE_COLOR": None, "D2RPICK_SUGGEST_TD": None}
# Before 8.2, click's runner mixes the streams unless it is told not to.
_APART: dict[str, Any] = {"mix_stderr": False} if "mix_stderr" in signature(CliRunner).parameters else {}


def run(*args: str, stdin: bytes | None = None, color: bool = False, env: Mapping[str, str] | None = None) -> Result:
    """Call ``d2rpick`` with these arguments; whatever it raises but the exit itself is raised here."""
    result = CliRunner(**_APART).invoke(d2rpick, args, input=stdin, color=color, env={**_ENVIRONMENT, **(env or {})})
    if result.exception and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


def answer(*args: str) -> dict[str, Any]:
    """Run a command with JSON output and give what it says, be it an objection or not."""
    result = run(*args, "-f", "json")
    assert result.exit_code in (0, 1), result.stderr
    found: dict[str, Any] = json.loads(result.stdout)
    return found


def codes(found: dict[str, Any]) -> set[str]:
    """Codes of the warnings of an answer."""
    return {warning["code"] for warning in found["warnings"]}
