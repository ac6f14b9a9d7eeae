"""Choose the parts to switch: what each costs, which may be switched, which sets to compare, and their margins."""
