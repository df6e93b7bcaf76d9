"""The experiments that `codra experiment` lists: each module or package here with an `EXPERIMENT`."""
