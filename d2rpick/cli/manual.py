"""Build the manual page d2rpick(1) from the help texts: ``python -m d2rpick.cli.manual > d2rpick.1``."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from d2rpick.base import __version__
from d2rpick.cli import d2rpick

if TYPE_CHECKING:
    from collections.abc import Iterator


def write_manual() -> str:
    """Return the page of the whole program in roff, with a section per command."""
    context = click.Context(d2rpick, info_name="d2rpick", **d2rpick.context_settings)
    assert isinstance(d2rpick, click.Group)
    lines = [
        f'.TH D2RPICK 1 "" "d2rpick {__version__}"',
        ".SH NAME",
        f"d2rpick \\- {_write_text((d2rpick.help or '').partition('.')[0].lower())}",
    ]
    lines += [
        ".SH SYNOPSIS",
        ".B d2rpick",
        r"\fICOMMAND\fR [\fIOPTIONS\fR]...",
        ".SH DESCRIPTION",
    ]
    lines += _describe_command(d2rpick, context)
    for name in d2rpick.list_commands(context):
        command = d2rpick.get_command(context, name)
        assert command is not None
        lines += [
            f".SH d2rpick {name}",
            *_describe_command(
                command, click.Context(command, context, f"d2rpick {name}")
            ),
        ]
    lines += [
        ".SH EXIT STATUS",
        *_write_item("0", "done"),
        *_write_item("1", "ran, and found a problem"),
    ]
    lines += [
        *_write_item(
            "2",
            "could not run: wrong usage, unreadable input, a time outside the record",
        )
    ]
    return "\n".join(lines) + "\n"


def _describe_command(command: click.Command, context: click.Context) -> Iterator[str]:
    """Yield usage, help, options and examples of a command."""
    if context.parent:
        usage = " ".join(command.collect_usage_pieces(context))
        yield from (".PP", rf"\fBd2rpick {command.name}\fR {_write_text(usage)}")
    for paragraph in (command.help or "").split("\n\n"):
        yield from (".PP", _write_text(" ".join(paragraph.split())))
    for option in command.get_params(context):
        if isinstance(option, click.Option):
            record = option.get_help_record(context)
        else:
            record = None
        if record:
            yield from _write_item(*record)
    if command.epilog:
        examples = [line.strip() for line in command.epilog.splitlines()]
        yield from (
            ".PP",
            _write_text(examples[0]),
            ".PP",
            ".nf",
            *map(_write_text, examples[1:]),
            ".fi",
        )


def _write_item(name: str, text: str) -> tuple[str, ...]:
    return ".TP", rf"\fB{_write_text(name)}\fR", _write_text(text)


def _write_text(text: str) -> str:
    r"""Escape a line for roff so that backslashes and hyphens appear as typed and no line becomes a request.

    Examples
    --------
    >>> print(_write_text(".5 of --part"))
    \&.5 of \-\-part
    """
    escaped = text.replace("\\", r"\e").replace("-", r"\-")
    return rf"\&{escaped}" if escaped.startswith((".", "'")) else escaped


if __name__ == "__main__":
    click.echo(write_manual(), nl=False)
