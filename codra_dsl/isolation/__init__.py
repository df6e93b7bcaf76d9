"""The code in the process of an isolated perception algorithm. It imports no other codra modules, to start fast."""
