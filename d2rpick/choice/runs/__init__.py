"""Answer one question for many runs, and find one tr for all of them."""
