"""The pictures of the documentation, each drawn from runs that this repository computes or contains.

``python -m tests.pictures`` writes them to docs/pictures, byte for byte the same on the same libraries, and
``python -m tests.pictures NAME ...`` writes some of them.  Screenshots need Chromium and are left out without it.
"""
