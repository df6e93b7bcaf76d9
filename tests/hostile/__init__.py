"""Inputs made to break a reader, and a watch over what reading them does."""
