"""Follow runs while they are being computed: find what their states show so far, and decide what to do next."""
