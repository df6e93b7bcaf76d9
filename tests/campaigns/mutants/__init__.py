"""Change one token of a valid spec, and check whether the compiler reports it, and how near."""
