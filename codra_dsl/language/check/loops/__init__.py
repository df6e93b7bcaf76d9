"""Checks of MAPE-K loops (P2, sections 3.3 and 5.2): fuzzy rules and their terms, courses, trees, and executors.

A spec without loops passes all these checks immediately.
"""
