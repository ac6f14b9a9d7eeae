"""What all other folders stand on: errors, the state of files, worker processes, the version."""
