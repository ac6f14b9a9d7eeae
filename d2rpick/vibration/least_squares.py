"""Solve linear least-squares problems fast if their model is well conditioned, otherwise by singular values."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from d2rpick.histories.history import Samples

# Largest condition number of normal matrices (in the 1-norm) that are used [-].
# One improvement of the solution then reduces its rounding error to that of the singular value decomposition.
_MOST_CONDITION: Final = 1e10
# Singular values below this fraction of the largest one are treated as zero [-].
_LEAST_SINGULAR: Final = 1e-9


def solve_least_squares(design: Samples, values: Samples) -> Samples:
    """Return the parameters with which a linear model fits values best.

    The normal equations take a fraction of the time of a singular value decomposition, but their condition number is
    the square of that of the model. They are therefore used only if it is small, and the solution is improved once.

    Parameters
    ----------
    design : array of shape (n, p)
        Effect of each parameter on each value.
    values : array of shape (n,)

    Returns
    -------
    array of shape (p,)

    Examples
    --------
    >>> solve_least_squares(np.array([[1.0, 0.0], [1.0, 1.0], [1.0, 2.0]]), np.array([1.0, 3.0, 5.0])).round(12)
    array([1., 2.])
    """
    normal = design.T @ design
    scale = np.sqrt(normal.diagonal())
    # Singular values treat a parameter without effect as zero; scaled, it would get a huge value.
    has_effect = scale.min(initial=np.inf) > _LEAST_SINGULAR * scale.max(initial=0.0)
    inverse = None
    if has_effect:
        normal /= np.multiply.outer(scale, scale)
        inverse = _invert_if_well_conditioned(np.asarray(normal))
    if inverse is None:
        return np.asarray(np.linalg.lstsq(design, values, rcond=_LEAST_SINGULAR)[0])
    inverse /= np.multiply.outer(scale, scale)
    solution = inverse @ (values @ design)
    rest = values - design @ solution
    return np.asarray(solution + inverse @ (rest @ design))


def _invert_if_well_conditioned(normal: Samples) -> Samples | None:
    """Return the inverse of a normal matrix; None if its condition number is too large, or not a number."""
    try:
        inverse = np.asarray(np.linalg.inv(normal))
    except np.linalg.LinAlgError:
        return None
    condition = _find_largest_column_sum(normal) * _find_largest_column_sum(inverse)
    return inverse if condition < _MOST_CONDITION else None


def _find_largest_column_sum(matrix: Samples) -> float:
    """Return the 1-norm of a matrix: the largest sum of absolute values in a column."""
    return float(np.abs(matrix).sum(axis=0).max())
