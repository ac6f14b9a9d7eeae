"""Compute all quantities that follow from the signed amplitudes of modes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from d2rpick.histories.history import Samples


class SignedAmplitudes:
    """A deformation that is defined by the signed ``amplitudes`` of its modes."""

    def amplitudes(self, t: Samples | float) -> Samples:
        """Return the signed deformation of each mode at ``t``; the first axis indexes the modes [sqrt(energy)]."""
        raise NotImplementedError

    def vibration_energy(self, t: Samples | float) -> Samples:
        """Return the energy of the vibration, with the shape of ``t`` [energy]."""
        raise NotImplementedError

    def elastic_energy(self, t: Samples | float) -> Samples:
        """Return the sum over all modes of the squared deformations, with the shape of ``t`` [energy]."""
        return np.asarray(np.sum(self.amplitudes(t) ** 2, axis=0))

    def compare(
        self, tr: Samples | float, td: Samples | float
    ) -> tuple[Samples, Samples]:
        """Return `separation` and `overlap` from one evaluation, with the shape of ``tr`` [energy]."""
        at_tr, at_td = self.amplitudes(tr).T, self.amplitudes(td).T
        separation = np.sum((at_tr - at_td) ** 2, axis=-1)
        overlap = np.sum(at_tr * at_td, axis=-1)
        return np.asarray(separation.T), np.asarray(overlap.T)

    def overlap(self, tr: Samples | float, td: Samples | float) -> Samples:
        """Return the sum of q(tr) q(td) over all modes, with the shape of ``tr`` [energy]; ``td`` may be an array."""
        return np.asarray(
            np.einsum("k...,k...->...", self.amplitudes(td), self.amplitudes(tr))
        )

    def separation(self, tr: Samples | float, td: Samples | float) -> Samples:
        """Return the sum over all modes of the squared differences q(tr) - q(td), with the shape of ``tr`` [energy]."""
        return np.asarray(np.sum(self.differences(tr, td) ** 2, axis=0))

    def differences(self, tr: Samples | float, td: Samples | float) -> Samples:
        """Return q(tr) - q(td) for each mode; the first axis indexes the modes [sqrt(energy)]."""
        return np.asarray((self.amplitudes(tr).T - self.amplitudes(td).T).T)
