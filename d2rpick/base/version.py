"""The version of d2rpick, written down once."""

__version__ = "0.15.0"
