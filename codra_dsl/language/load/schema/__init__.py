"""The shape of a file by `schema.json`."""
