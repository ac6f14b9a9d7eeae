"""Define what all answers have in common: JSON, a table, a page, and the command line that repeats the answer."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, Any, ClassVar, Self

from d2rpick.base.errors import give_if_written
from d2rpick.base.files import write_as_a_whole

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    import pandas as pd
    from matplotlib.figure import Figure

    from d2rpick.api import arguments
    from d2rpick.api.cards import Cards
    from d2rpick.base.errors import Caution
    from d2rpick.report.formats import DisplayOptions


class Answer:
    """Base class of all answers; an answer is an immutable dataclass.

    Two answers are equal if their contents are equal, for example an answer and its copy from another process.

    ``warnings`` contains (``code``, ``message``) of each warning. ``command`` is the command line that gives the same
    answer; weights that were not read from a file are written as ``<weights in memory>``.
    """

    # Some answers store the command as a field; others compute it as a property. The cautions are a field of all.
    if TYPE_CHECKING:

        @property
        def cautions(self) -> tuple[Caution, ...]:
            """All warnings."""

        @property
        def command(self) -> tuple[str, ...]:
            """The command line that gives the same answer, beginning with the name of the command."""

    kind: ClassVar[str]  # Key of this type of answer in the table of output formats.
    # Names of the attributes that the ``repr`` of the answer shows.
    said: ClassVar[tuple[str, ...]] = ()

    @classmethod
    def of(cls, result: Any, **further_fields: Any) -> Self:
        """Make the public answer from an internal result; ``cautions`` are appended to those of the result."""
        values = {field.name: getattr(result, field.name) for field in fields(result)}
        values["cautions"] = (*values["cautions"], *further_fields.pop("cautions", ()))
        return cls(**values, **further_fields)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Answer) or type(other) is not type(self):
            return NotImplemented
        return self.to_json() == other.to_json()

    def __hash__(self) -> int:
        return hash((self.kind, *self.command))

    def __repr__(self) -> str:
        contents = ", ".join(
            f"{name}={getattr(self, name)!r}" for name in (*self.said, "warnings")
        )
        return f"{type(self).__name__}({contents})"

    @property
    def warnings(self) -> tuple[Caution, ...]:
        """All warnings, each with ``code`` and ``message``."""
        return self.cautions

    def text(self, form: str, display: DisplayOptions) -> str:
        """Return the answer as text in one of the output formats of the command line."""
        from d2rpick.report.formats import write

        return write(self.kind, form, self, display)

    def to_json(self) -> str:
        """Return the JSON document that the command line prints; it contains the name of its schema."""
        from d2rpick.api.option_names import replace_arguments
        from d2rpick.report.formats import DisplayOptions

        return replace_arguments(self.text("json", DisplayOptions(self.command)))

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON document that the command line prints, as a dictionary."""
        import json

        document: dict[str, Any] = json.loads(self.to_json())
        return document


class Paged(Answer):
    """An answer that has a page, a figure, and a short form for notebooks."""

    def __repr__(self) -> str:
        from d2rpick.report.pages import give_sentence

        return f"{type(self).__name__}({give_sentence(self.kind, self)})"

    def _repr_html_(self) -> str:
        from d2rpick.report.pages import show_at_a_glance

        return show_at_a_glance(self.kind, self, give_if_written(self.plot))

    def plot(self) -> Figure:
        """Draw the energy and the chosen or judged times as a matplotlib Figure."""
        from d2rpick.report import figures_choice

        drawn: Figure = getattr(figures_choice, f"draw_{self.kind}")(self)
        return drawn

    def page(
        self,
        command: Sequence[str],
        judging: Sequence[str] = (),  # noqa: ARG002  subclasses use the argument
        cards: Cards | None = None,  # noqa: ARG002  subclasses use the argument
    ) -> str:
        """Return the page; ``command`` is the command line that repeats it.

        ``judging`` contains the options with which the command ``card`` gives the same verdicts.
        """
        from d2rpick.report import pages

        written: str = getattr(pages, f"{self.kind}_page")(self, command)
        return written

    def report(self, path: arguments.Path) -> Path:
        """Write the answer to one HTML page that needs no network; an existing file is replaced."""
        return write_page(path, self.page(("d2rpick", *self.command)))


def write_page(path: arguments.Path, page: str) -> Path:
    """Write a page to a file and return the path of the file."""
    from pathlib import Path  # Imported here to keep start-up fast.

    from d2rpick.api import arguments

    target = Path(*arguments.list_paths("path", path))
    write_as_a_whole(target, page.encode())
    return target


def build_frame(
    rows: Sequence[Mapping[str, Any]], columns: Sequence[str], **attrs: Any
) -> pd.DataFrame:
    """Return a table with one row per mapping. Unknown values are NaN, even if a whole column is unknown.

    Examples
    --------
    >>> build_frame([{"tr": 0.5, "residual": None}], ["tr", "residual"]).dtypes.astype(str).tolist()
    ['float64', 'float64']
    """
    import pandas as pd

    frame = pd.DataFrame(list(rows), columns=list(columns))
    frame = frame.astype(
        {
            name: "float64"
            for name in frame.columns
            if len(frame) and frame[name].isna().all()
        }
    )
    frame.attrs.update(attrs)
    return frame
