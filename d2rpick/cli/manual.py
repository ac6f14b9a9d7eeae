"""Build the manual page d2rpick(1) from the help: ``python -m d2rpick.cli.manual > d2rpick.1``."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from d2rpick.base import __version__
from d2rpick.cli import d2rpick

if TYPE_CHECKING:
    from collections.abc import Iterator


def manual() -> str:
    """Return the page of the whole program in roff, with a section for each command."""
    context = click.Context(d2rpick, info_name="d2rpick", **d2rpick.context_settings)
    assert isinstance(d2rpick, click.Group)
    lines = [
        f'.TH D2RPICK 1 "" "d2rpick {__version__}"',
        ".SH NAME",
        f"d2rpick \\- {_text((d2rpick.help or '').partition('.')[0].lower())}",
    ]
    lines += [
        ".SH SYNOPSIS",
        ".B d2rpick",
        r"\fICOMMAND\fR [\fIOPTIONS\fR]...",
        ".SH DESCRIPTION",
    ]
    lines += _described(d2rpick, context)
    for name in d2rpick.list_commands(context):
        command = d2rpick.get_command(context, name)
        assert command is not None
        lines += [
            f".SH d2rpick {name}",
            *_described(command, click.Context(command, context, f"d2rpick {name}")),
        ]
    lines += [
        ".SH EXIT STATUS",
        *_item("0", "done"),
        *_item("1", "ran, and the answer is an objection"),
    ]
    lines += [
        *_item(
            "2",
            "could not run: wrong usage, unreadable input, a time outside the record",
        )
    ]
    return "\n".join(lines) + "\n"


def _described(command: click.Command, context: click.Context) -> Iterator[str]:
    """Yield usage, help, options and examples of a command."""
    if context.parent:
        usage = " ".join(command.collect_usage_pieces(context))
        yield from (".PP", rf"\fBd2rpick {command.name}\fR {_text(usage)}")
    for paragraph in (command.help or "").split("\n\n"):
        yield from (".PP", _text(" ".join(paragraph.split())))
    for option in command.get_params(context):
        if isinstance(option, click.Option):
            record = option.get_help_record(context)
        else:
            record = None
        if record:
            yield from _item(*record)
    if command.epilog:
        examples = [line.strip() for line in command.epilog.splitlines()]
        yield from (
            ".PP",
            _text(examples[0]),
            ".PP",
            ".nf",
            *map(_text, examples[1:]),
            ".fi",
        )


def _item(name: str, text: str) -> tuple[str, ...]:
    return ".TP", rf"\fB{_text(name)}\fR", _text(text)


def _text(text: str) -> str:
    r"""Escape a line for roff: backslashes and hyphens appear as typed, and no line is mistaken for a request.

    Examples
    --------
    >>> print(_text(".5 of --part"))
    \&.5 of \-\-part
    """
    escaped = text.replace("\\", r"\e").replace("-", r"\-")
    return rf"\&{escaped}" if escaped.startswith((".", "'")) else escaped


if __name__ == "__main__":
    click.echo(manual(), nl=False)
