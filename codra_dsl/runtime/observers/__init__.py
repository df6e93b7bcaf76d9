"""Observers: behaviour trees that identify context-variables."""
