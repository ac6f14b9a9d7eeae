"""Switching windows as solver input: one module per solver, one table of solvers.

A solver is a module with what `common.Solver` lists; a new one is a new module and a line in `SOLVERS`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from d2rpick.deck.printing import ls_dyna, radioss

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from d2rpick.deck.printing.common import PrintedCard, Printing, Solver, Times

SOLVERS: Final[Mapping[str, Solver]] = {"ls-dyna": ls_dyna, "radioss": radioss}
DEFAULT: Final = "ls-dyna"  # of histories that name no solver


def solver_of(history_format: str) -> str:
    """Name the solver that wrote a history of this format (several are joined by ``+``).

    Examples
    --------
    >>> solver_of("radioss-th"), solver_of("glstat + matsum"), solver_of("csv")
    ('radioss', 'ls-dyna', 'ls-dyna')
    """
    formats = set(history_format.split(" + "))
    return next((name for name, solver in SOLVERS.items() if formats & {*solver.HISTORIES}), DEFAULT)


def cards(
    windows: Sequence[Times], printing: Printing, solver: str = DEFAULT, remarks: Sequence[str] = ()
) -> PrintedCard:
    """Print the cards of windows.

    Parameters
    ----------
    windows : sequence of (float, float)
        tr and td of each [time of the model], 0 <= tr < td, each after the one before.
    printing : Printing
        Whom the card switches, and what else it says.
    solver : str
        A key of `SOLVERS`.
    remarks : sequence of str
        Further comment lines.

    Raises
    ------
    DeckError
        If windows do not follow each other, or the solver's input cannot say what is asked for.

    Examples
    --------
    >>> from d2rpick.deck.printing.common import Printing
    >>> card = cards([(0.02, 0.09), (0.2, 0.3)], Printing(part=(11,)))
    >>> card.windows
    ((0.02, 0.09), (0.2, 0.3))
    """
    return SOLVERS[solver].cards(windows, printing, remarks)
