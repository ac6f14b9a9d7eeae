"""Solver runs quoted in the documentation (decks, results, how to repeat them), and the published study.

``python -m validation.run MODEL FOLDER`` runs a deck with OpenRadioss, switched or not.  ``python -m
validation.figures`` draws the figures of docs/explanation/validation.md from ``results``.  ``d2rpick reproduce`` calls
``published``.
"""
