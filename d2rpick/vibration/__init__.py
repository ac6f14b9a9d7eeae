"""What vibrates, and how?  Oscillators in closed form, found in an energy history and replayed."""
