"""Compare the shape of a file with `schema.json`."""
