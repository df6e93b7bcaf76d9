"""Main executions that are not plain Python, and how they ask: one module or room for each."""
