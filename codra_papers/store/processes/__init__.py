"""The agents of the robot's body as processes of their own, which share the robot's body and its knowledge graph."""
