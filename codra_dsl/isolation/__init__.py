"""The code in the process of an isolated perception algorithm. To start fast, it imports no other codra modules."""
