"""Adapt the cures of a grade to a command that has compared a switched run, or that has no option for parts."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from d2rpick.choice.pair.quality import (
    COMPARE,
    MORE_OFTEN,
    NAME_PARTS,
    NAME_PARTS_IF_ANY,
    OR_COMPARE,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from d2rpick.choice.pair.quality import Grade, Quality

_VERIFY_PARTS: Final = (
    "judge the pair with d2rpick verify by the energy of its parts (`parts`)"
)


def omit_comparison(quality: Quality) -> Quality:
    """Return the grades without the advice to compare with a switched run, for use after this comparison.

    The advice to name parts is omitted too, because the switched run shows which parts were rigid.
    """

    def omit(cure: str) -> str:
        if cure == COMPARE:
            return MORE_OFTEN
        cure = cure.removesuffix(OR_COMPARE).removesuffix(NAME_PARTS_IF_ANY)
        return cure.removesuffix(", ")

    return _edit_cures(quality, omit)


def name_parts_in_verify(quality: Quality) -> Quality:
    """Return the grades for a check, which has no option for parts: its cure names the command that has one."""
    return _edit_cures(quality, lambda cure: cure.replace(NAME_PARTS, _VERIFY_PARTS))


def _edit_cures(quality: Quality, edit: Callable[[str], str]) -> Quality:
    """Return the grades with every cure replaced by what ``edit`` returns for it."""

    def edit_grade(grade: Grade) -> Grade:
        causes = [cause._replace(cure=edit(cause.cure)) for cause in grade.causes]
        return grade._replace(causes=tuple(causes))

    return quality._replace(
        motion=edit_grade(quality.motion),
        vibration=edit_grade(quality.vibration),
        alone=edit_grade(quality.alone),
    )
