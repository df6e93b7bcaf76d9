"""Checks of knowledge and agents (P2, sections 3.1 to 3.3), by phase: names, then writers, then possible behaviour.

A spec without knowledge and poses passes all these checks immediately.
"""
