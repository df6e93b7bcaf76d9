"""The arithmetic of fuzzy inference: what the compiled modules of engines import.

Values equal those of the FuzzyLite libraries (J. Rada-Vilela, fuzzylite.com), which P2 uses for its two stages of
inference (section 5.2): for missing inputs (NaN), infinities and degenerate parameters too.
"""
