"""What people and tools read: findings and graphs, in every form."""
