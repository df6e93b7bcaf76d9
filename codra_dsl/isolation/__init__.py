"""What runs in the process of an isolated perception algorithm. It imports nothing else of ours, to start soon."""
