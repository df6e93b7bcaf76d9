"""The settings and the cache of one project, and the times of a command's stages."""
