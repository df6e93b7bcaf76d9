"""The perception of the laboratory's robot: tags and poses in frames, and the functions that `specs/lab.yaml` calls."""
