"""The language: from the text of a specification to a `CheckedSpec`."""
