"""The checked spec, which has no errors, and its parts. Only `check` makes them."""
