"""Choose td: the flights of a record, both times together, a plan of all windows, and the trade-off over td."""
