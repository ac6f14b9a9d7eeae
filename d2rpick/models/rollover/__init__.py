"""A planar box that trips over a curb on a braking sled, rolls and lands, computed explicitly.

    model → bars, contact, rigid → motion (one step) → run (to the end, switched or not) → record → scan (many tr)

Nothing of the model knows of histories or of choosing; ``as_history`` lets the tool choose on such a run.
"""
