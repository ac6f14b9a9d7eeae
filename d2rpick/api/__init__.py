"""The questions that can be asked, and their answers: what ``import d2rpick`` offers and the command line calls."""
