"""What the laboratory's robot computes from frames: tags, poses, and the functions that `specs/lab.yaml` names."""
