"""Files of a run -> History: where its bytes come from, what they hold, which energy is meant."""
