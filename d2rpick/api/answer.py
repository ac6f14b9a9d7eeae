"""What all answers have in common, JSON, table, page and the line that repeats them."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any, ClassVar, Self

from d2rpick.api.cards import Cards
from d2rpick.base.errors import DeckError, give_if_written
from d2rpick.base.files import write_as_a_whole

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    import pandas as pd
    from matplotlib.figure import Figure

    from d2rpick.api import arguments
    from d2rpick.api.asked import Asked
    from d2rpick.api.runs import Run
    from d2rpick.base.errors import Caution
    from d2rpick.choice.judged_card import SolverInput
    from d2rpick.choice.situation import Situation
    from d2rpick.choice.trade_off import TradeOff
    from d2rpick.report.formats import Shown
    from d2rpick.report.page import PageContext


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Answer:
    """What all answers have in common; nothing of one changes.

    Two answers are equal if they say the same, such as an answer and its copy in another process.

    ``warnings`` are (``code``, ``message``); ``command`` is the command line that gives the same answer, with
    ``<weights in memory>`` for the file where these were no file.
    """

    if TYPE_CHECKING:  # a field of some answers, and made for others

        @property
        def command(self) -> tuple[str, ...]:
            """The command line that gives the same answer, without the name of the program."""

    cautions: tuple[Caution, ...]
    kind: ClassVar[str]  # as the table of forms calls it
    said: ClassVar[tuple[str, ...]] = ()  # what a short look shows

    @classmethod
    def of(cls, found: Any, **more: Any) -> Self:
        """Add to what was found what is public of an answer; ``cautions`` come after its own."""
        known = {one.name: getattr(found, one.name) for one in fields(found)}
        known["cautions"] = (*known["cautions"], *more.pop("cautions", ()))
        return cls(**known, **more)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Answer) or type(other) is not type(self):
            return NotImplemented
        return self.to_json() == other.to_json()

    def __hash__(self) -> int:
        return hash((self.kind, *self.command))

    def __repr__(self) -> str:
        shown = ", ".join(
            f"{name}={getattr(self, name)!r}" for name in (*self.said, "warnings")
        )
        return f"{type(self).__name__}({shown})"

    @property
    def warnings(self) -> tuple[Caution, ...]:
        """What to be aware of: ``code`` and ``message``."""
        return self.cautions

    def text(self, form: str, shown: Shown) -> str:
        """Write the answer in a form of the command line."""
        from d2rpick.report.formats import write

        return write(self.kind, form, self, shown)

    def to_json(self) -> str:
        """Give the JSON document of the command line; its schema is named in it."""
        from d2rpick.report.formats import Shown

        return self.text("json", Shown(self.command))

    def to_dict(self) -> dict[str, Any]:
        """Give the JSON document of the command line as a dictionary."""
        import json

        found: dict[str, Any] = json.loads(self.to_json())
        return found


class Paged(Answer):
    """An answer that has a page and a figure; a notebook shows it in short."""

    def __repr__(self) -> str:
        from d2rpick.report.pages import sentence

        return f"{type(self).__name__}({sentence(self.kind, self)})"

    def _repr_html_(self) -> str:
        from d2rpick.report.pages import glance

        return glance(self.kind, self, give_if_written(self.plot))

    def plot(self) -> Figure:
        """Draw the answer as a matplotlib Figure: the energy, and what was chosen or judged."""
        from d2rpick.report import figures_choice

        drawn: Figure = getattr(figures_choice, f"draw_{self.kind}")(self)
        return drawn

    def page(
        self,
        command: Sequence[str],
        judging: Sequence[str] = (),  # noqa: ARG002
        cards: Cards | None = None,  # noqa: ARG002
    ) -> str:
        """Write the page: ``command`` repeats it, ``judging`` are the options that judge a card by the same history."""
        from d2rpick.report import pages

        written: str = getattr(pages, f"{self.kind}_page")(self, command)
        return written

    def report(self, path: arguments.Path) -> Path:
        """Write everything to one HTML page that needs no network; an existing file is replaced."""
        return written(path, self.page(("d2rpick", *self.command)))


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class RunAnswer(Paged):
    """An answer about one run: how it was asked for, with the times of the command line.

    ``run`` is what was asked about.
    """

    question: Asked = field(repr=False)
    times: tuple[str, ...]
    name: ClassVar[str]  # of the command

    @property
    def run(self) -> Run:
        """What was asked about."""
        return self.question.run

    @property
    def command(self) -> tuple[str, ...]:
        """The command line that gives the same answer, without the name of the program."""
        return (self.name, *self.times, *self.question.options)

    @classmethod
    def about(cls, asked: Asked, found: Any, *times: str, **more: Any) -> Self:
        """Answer by what was found, with what the deck left unknown."""
        return cls.of(
            found, cautions=asked.cautions, question=asked, times=times, **more
        )

    def _context(
        self,
        command: Sequence[str],
        judging: Sequence[str],
        cards: Cards | None,
        chosen: tuple[Situation, float] | None,
        explored: TradeOff | None,
    ) -> PageContext:
        """Give what a page shows beside the answer, with the card of the chosen situation and tr."""
        from d2rpick.report.page import PageContext

        card = self._card(cards, *chosen) if chosen else None
        return PageContext(
            self.question.reference.run,
            command,
            judging,
            card,
            explorer=self._explorer([explored]),
        )

    def _card(
        self, cards: Cards | None, situation: Situation, tr: float
    ) -> SolverInput:
        """Give the card of a tr, or why there is none, with what the deck of the run says of it."""
        from d2rpick.choice.judged_card import SolverInput, input_for

        try:
            suited, _ = (cards or Cards()).by_deck(self.question)
        except DeckError as error:
            return SolverInput("", "part", refusal=str(error))
        return input_for(
            self.question.reference, situation, tr, suited.request(self.question)
        )

    def _explorer(self, found: Iterable[TradeOff | None]) -> Any:
        """Give what can be explored on a page, and the command line that asks for each td."""
        from d2rpick.report.page import Explorer

        trade_offs = tuple(one for one in found if one)
        return (
            Explorer(
                trade_offs, (("d2rpick", "suggest", "--td"), self.question.options)
            )
            if trade_offs
            else None
        )


def written(path: arguments.Path, page: str) -> Path:
    """Write a page and give its path."""
    from pathlib import Path  # not above: a table does without it

    from d2rpick.api import arguments

    place = Path(*arguments.paths("path", path))
    write_as_a_whole(place, page.encode())
    return place


def frame_of(
    rows: Sequence[Mapping[str, Any]], columns: Sequence[str], **attrs: Any
) -> pd.DataFrame:
    """Give a row per mapping; what is not known is NaN, also where nothing of a column is known.

    Examples
    --------
    >>> frame_of([{"tr": 0.5, "residual": None}], ["tr", "residual"]).dtypes.astype(str).tolist()
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
