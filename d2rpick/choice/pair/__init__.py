"""Judge pairs (tr, td) at one td: situation, candidates, quality, warnings, windows, and the verdict."""
