"""d2rpick: choose the times of deformable-to-rigid switching from the energy history of one reference run.

    >>> import d2rpick as d2
    >>> run = d2.read("sample_data/energy.csv")
    >>> answer = d2.suggest(run, td_window=(0.06, 0.07))
    >>> d2.verify(run, tr=answer.recommended.tr, td=answer.recommended.td).verified
    True

What is named here is imported when it is first used: the package itself imports nothing, not even typing.  The stub
beside this file gives the names to type checkers and editors.
"""

from __future__ import annotations

from d2rpick.api import __dir__ as __dir__, __getattr__ as __getattr__, names
from d2rpick.base import __version__ as __version__

__all__ = [*names]  # noqa: PLE0604  names of strings all
