"""The study "Analysis of switched-rigid floating oscillator" computed anew, as ``d2rpick reproduce`` shows it."""
