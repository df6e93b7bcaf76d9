"""The experiments that `codra experiment` lists: each module or package in this folder that has an `EXPERIMENT`."""
