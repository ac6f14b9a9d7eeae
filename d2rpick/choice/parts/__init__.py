"""Choose the parts to switch: their costs, which may be switched, which sets to compare, and their margins."""
