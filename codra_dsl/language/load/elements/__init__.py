"""Convert nodes to the frozen values of `codra_dsl.language.model`."""
