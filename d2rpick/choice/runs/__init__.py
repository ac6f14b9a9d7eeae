"""Ask one question of many runs, and find one tr for all of them."""
