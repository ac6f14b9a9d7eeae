"""Compare finished switched runs with their reference run."""
