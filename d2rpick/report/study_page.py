"""The answer of ``study`` as one HTML page to be read, printed and signed; it needs nothing but itself."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.choice.study_rows import runs_of
from d2rpick.report.html import Markup, document, drawings, pairs, remarks, resource, section, table, tag
from d2rpick.report.shell import shell_line
from d2rpick.report.study import HEAD, outcome, rows, td_of
from d2rpick.report.tables import known

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.choice.study import Study


def as_page(answer: Study, command: Sequence[str], drawing: str) -> str:
    """Write the page.

    Parameters
    ----------
    answer : Study
    command : sequence of str
        Arguments that repeat the answer.
    drawing : str
        SVG element.
    """
    title = f"Switch times of {runs_of(len(answer.rows))}"
    sections = _sections(answer, command, drawing)
    return document(title, *sections, signed=("checked by", "date", "signature"))


def _sections(answer: Study, command: Sequence[str], drawing: str) -> Iterator[Markup]:
    yield tag("section", _common(answer), remarks(answer.cautions), pairs(outcome(answer)))
    yield drawings({"Internal energies of all runs, with the tr of each, the common one and td": drawing})
    head = [name.replace("+-", "\u00b1") for name in HEAD]
    yield section("Runs", table("Runs", *known(head, rows(answer))))
    yield section("Files", tag("pre", _files(answer), class_="wrap"))
    yield section("Method and limits", resource("method.html"))
    yield section("To repeat this", tag("pre", shell_line(command), class_="wrap"))


def _common(answer: Study) -> Markup:
    tr = answer.common.tr
    if tr is None:
        text = tag("p", "None: ", answer.common.reason or "")
        return tag("div", tag("div", tag("h2", "One tr for all runs"), text, class_="card"), class_="choice")
    times = (tag("span", tag("i", name), text) for name, text in (("tr", f"{tr:.6g}"), ("td", td_of(answer))))
    exact = f"in full: tr = {tr!r}" + ("" if answer.td is None else f", td = {answer.td!r}")
    rule = "Acceptable by the rules of d2rpick verify in every run that was judged."
    lines = (tag("div", *times, class_="times"), tag("p", rule), tag("p", exact, class_="soft"))
    return tag("div", tag("div", tag("h2", "One tr for all runs"), *lines, class_="card chosen"), class_="choice")


def _files(answer: Study) -> str:
    """Name what was read, with size and time, in the order of the runs."""
    from datetime import UTC, datetime

    files = dict.fromkeys(stamp for row in answer.rows for stamp in row.files)
    return "\n".join(
        f"{datetime.fromtimestamp(stamp.mtime_ns / 1e9, UTC):%Y-%m-%d %H:%M:%S} UTC {stamp.size:>12} {stamp.name}"
        for stamp in files
    )
