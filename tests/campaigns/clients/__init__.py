"""Silent, slow and greedy clients of one process that serves a context manager and the store's page."""
