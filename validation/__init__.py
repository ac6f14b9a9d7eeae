"""Runs of a real solver that the documentation quotes: decks, results, how to repeat them; and the published study.

``python -m validation.run MODEL FOLDER`` runs a deck where OpenRadioss is installed, switched or not;
``python -m validation.figures`` draws those of docs/explanation/validation.md from ``results``.  ``published`` is what
``d2rpick reproduce`` calls.
"""
