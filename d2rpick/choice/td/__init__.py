"""Choose td: find the flights of a record, both times together, a plan of all windows, or the trade-off over td."""
