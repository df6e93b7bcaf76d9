"""The types of conditions, and their lowering to a form that solvers read."""
