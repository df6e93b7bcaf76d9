"""The robots and experiments of the papers P1 and P2, on top of `codra_dsl`."""
