"""MAPE-K at run time: what analyses knowledge and plans by it."""
