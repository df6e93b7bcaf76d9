"""A household robot in a kitchen: the functions that specs/kitchen.yaml calls."""
