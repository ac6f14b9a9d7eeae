"""Radioss runs: the starter deck and the engine files of the legs, and when which part is rigid."""

from d2rpick.deck.radioss.files import read_run, recognises, run_files
from d2rpick.deck.radioss.legs import RunWindows, find_run_windows

__all__ = ["RunWindows", "find_run_windows", "read_run", "recognises", "run_files"]
