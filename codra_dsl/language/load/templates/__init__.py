"""Templates, their parameters, and the substitution of arguments."""
