"""What all other folders stand on: errors, the state of files, worker processes, and the version, written down once."""

__version__ = "0.17.0"
