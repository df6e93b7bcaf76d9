"""What the experiments beyond the paper have in common: what the robot does, and how arms are set beside each other."""
