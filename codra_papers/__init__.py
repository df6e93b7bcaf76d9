"""The robots and experiments of the papers P1 and P2, on top of `codra_dsl`."""

__version__ = "0.1.0"
