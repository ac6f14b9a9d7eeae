"""Follow runs while they are computed: what their states show so far, and what to do next."""
