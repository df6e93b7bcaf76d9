"""The values that only `check` makes: a specification without errors."""
