"""The simulated store: the robot's body, people, sensors, and ground truth."""
