"""Runs while they are computed: what the states so far tell, and what should be done next."""
