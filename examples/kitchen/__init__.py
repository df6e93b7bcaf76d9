"""A household robot in a kitchen: what specs/kitchen.yaml calls."""
