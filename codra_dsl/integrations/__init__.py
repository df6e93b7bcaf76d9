"""Main executions that are not plain Python, how they ask, and graphs of other libraries: a module or room for each."""
