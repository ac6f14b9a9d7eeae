"""The configuration files of the check."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from d2rpick.base.errors import ConfigurationError
from d2rpick.rules.configuration import Configuration, find_configuration, read_configuration

if TYPE_CHECKING:
    from pathlib import Path

OWN = 'select = ["D2R1"]\nignore = ["D2R104"]\n[severity]\nD2R101 = "warning"\n'


def test_the_nearest_file_wins(tmp_path: Path) -> None:
    inner = tmp_path / "a" / "b"
    inner.mkdir(parents=True)
    (tmp_path / "d2rpick.toml").write_text(OWN)
    (tmp_path / "a" / "pyproject.toml").write_text("[project]\nname = 'other'\n")
    configuration = find_configuration(inner)
    assert configuration.select == ("D2R1",)
    assert configuration.ignore == ("D2R104",)
    assert configuration.severity == {"D2R101": "warning"}
    assert configuration.source == str(tmp_path / "d2rpick.toml")
    (tmp_path / "a" / "pyproject.toml").write_text("[tool.d2rpick]\nselect = ['D2R0']\n")
    assert find_configuration(inner).select == ("D2R0",)
    (tmp_path / "a" / "d2rpick.toml").write_text("")
    assert find_configuration(inner).select == ()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("selct = []", "did you mean 'select'"),
        ("select = 'D2R1'", "a list"),
        ("select = [1]", "a list"),
        ("severity = 3", "a table"),
        ("[severity]\nD2R101 = 'fatal'", "one of error"),
        ("[severity]\nD2R101 = ['error']", "one of error"),
        ("select = ", "valid TOML"),
        ("a = '\xff'", "valid TOML"),
        (f"select = {'9' * 5000}", "valid TOML"),  # Python refuses to read it,
        (f"[severity]\nD2R101 = 0x{'f' * 5000}", "valid TOML"),  # and to write this one
        (f"select = {'[' * 9999}", "valid TOML"),
    ],
)
def test_wrong_settings_say_what_is_wrong(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "d2rpick.toml").write_bytes(text.encode("latin-1"))
    with pytest.raises(ConfigurationError, match=message) as caught:
        find_configuration(tmp_path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["tool = 3", "[tool]\nother = 1"])
def test_a_pyproject_without_a_table_for_us(tmp_path: Path, text: str) -> None:
    (tmp_path / "pyproject.toml").write_text(text)
    assert find_configuration(tmp_path).source != str(tmp_path / "pyproject.toml")


def test_our_table_must_be_one(tmp_path: Path) -> None:
    (tmp_path / "pyproject.toml").write_text("[tool]\nd2rpick = 1")
    with pytest.raises(ConfigurationError, match="a table was expected"):
        find_configuration(tmp_path)


def test_a_near_miss_is_named() -> None:
    with pytest.raises(ConfigurationError, match="did you mean D2R101"):
        Configuration(ignore=("D2R10l",)).verify(["D2R101"])


def test_no_settings(tmp_path: Path) -> None:
    (tmp_path / "pyproject.toml").write_text("[tool.other]\nx = 1\n")
    assert read_configuration({}) == Configuration()
    assert find_configuration(tmp_path).source != str(tmp_path / "pyproject.toml")
