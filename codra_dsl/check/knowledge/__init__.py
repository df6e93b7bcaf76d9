"""Checks of knowledge and agents (P2, sections 3.1 to 3.3), by phase: what is named, who writes, and what can happen.

A spec that says nothing of knowledge passes them all in no time.
"""
