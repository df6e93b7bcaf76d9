"""Generate the files of a package from a `CheckedSpec`."""
