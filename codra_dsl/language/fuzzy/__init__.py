"""Fuzzy engines as values, which are read from and written to the FuzzyLite Language (FLL), and compiled to Python."""

from codra_dsl.language.fuzzy.compile import compile_engine
from codra_dsl.language.fuzzy.read import Read, read_fll
from codra_dsl.language.fuzzy.rules import RULES
from codra_dsl.language.fuzzy.write import write_fll

__all__ = ["RULES", "Read", "compile_engine", "read_fll", "write_fll"]
