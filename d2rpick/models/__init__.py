"""Compute example runs inside the package: the published oscillator and the rollover box."""
