"""What the store's robot does with orders: the leaves of its behaviour trees, and orders served one by one."""
