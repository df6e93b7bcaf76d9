"""From a `CheckedSpec` to the files of a package."""
