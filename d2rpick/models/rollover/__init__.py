"""A planar box that trips over a curb on a braking sled, rolls and lands, computed explicitly.

    model → bars, contact, rigid → motion (one step) → run (to the end, switched or not) → record → scan (many tr)

Nothing here knows of histories or of choosing; ``d2rpick.rehearsal`` lets the tool choose on such a run.
"""
