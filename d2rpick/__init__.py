"""d2rpick: choose the times of deformable-to-rigid switching from the energy history of one reference run."""

__version__ = "0.6.0"
