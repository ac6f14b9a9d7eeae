"""A module for each format of `d2rpick.histories.opening.READERS`, and what several of them share."""
