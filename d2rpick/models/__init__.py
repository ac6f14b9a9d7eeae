"""Runs that the package computes itself: the published oscillator and the rollover box."""
