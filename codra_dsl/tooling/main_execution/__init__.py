"""Main executions that a team already has: their decisions, a first spec, and what a spec covers (`codra import`)."""
