"""Runs in the store."""
