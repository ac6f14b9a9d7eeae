"""Compute example runs with the package itself: the published oscillator and the rollover box."""
