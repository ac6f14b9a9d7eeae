"""Choose the parts to switch: find which parts may be switched, what they cost, and which sets to compare."""
