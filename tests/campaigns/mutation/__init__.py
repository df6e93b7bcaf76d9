"""Change one expression of the product, and check whether its tests notice."""
