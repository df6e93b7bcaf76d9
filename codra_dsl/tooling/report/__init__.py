"""Reports for people and tools: findings and graphs, in every format."""
