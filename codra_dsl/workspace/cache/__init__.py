"""Stored results of earlier runs. If nothing has changed since a run, a command shows the stored result.

A run is stored under its command and paths. It contains digests of everything on which the result depends: the bytes of
the specs, of their parts and of the project's settings, codra itself, its libraries and Python. Only runs without
errors are stored, because an error may depend on files that do not exist. The cache holds only data, which is signed
with a secret of the user. Entries that cannot be read, that somebody else or another version wrote are ignored.
"""

from codra_dsl.workspace.cache.runs import FOLDER, Cache, Run, cache_of

__all__ = ["FOLDER", "Cache", "Run", "cache_of"]
