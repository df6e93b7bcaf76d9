"""What earlier runs came to, so that a run in which nothing has changed does not do their work again.

A run is kept under what it was asked, with digests of all that its result depends on: the bytes of the specs, of their
parts and of the project's settings, codra itself, its libraries and Python. Only runs without errors are kept: what an
error says may depend on files that are not there. The cache holds data only; what in it cannot be read, or was made by
another version, is as if it were not there.
"""

from codra_dsl.workspace.cache.runs import FOLDER, Cache, Run, cache_of

__all__ = ["FOLDER", "Cache", "Run", "cache_of"]
