"""Choose the parts to switch: find the parts that may be switched, their cost, and the sets to compare."""
