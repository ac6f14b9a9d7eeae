"""The study "Analysis of switched-rigid floating oscillator" computed again, as ``d2rpick reproduce`` shows it."""
