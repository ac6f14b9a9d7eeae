"""The package for scripts and notebooks: what ``import d2rpick`` offers, a thin shell beside the command line."""
