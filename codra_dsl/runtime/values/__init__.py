"""Values of context: readings, evidence, conditions, and the declarations of generated code."""
