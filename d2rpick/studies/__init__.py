"""The same question for many runs, on many cores, resumable."""
