"""Checks of MAPE-K loops (P2, sections 3.3 and 5.2): fuzzy rules and their words, courses, trees, and who does what.

A spec that says nothing of loops passes them all in no time.
"""
