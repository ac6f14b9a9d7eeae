"""Provide what all other folders use: errors, files, settings, worker processes, and the version of d2rpick."""

__version__ = "0.24.0"
