"""A language server and a folder after random edits: findings always are those of `codra lint` on the same texts."""
