"""Computations of the laboratory's robot on frames: tags, poses, and the functions that `specs/lab.yaml` names."""
