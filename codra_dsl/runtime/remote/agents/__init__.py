"""Agents in other programs: their part of a session, and the knowledge graph as they see it."""
