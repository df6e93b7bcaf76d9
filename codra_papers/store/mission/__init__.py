"""The robot's handling of orders: the leaves of its behaviour trees, and a mission that serves orders one by one."""
