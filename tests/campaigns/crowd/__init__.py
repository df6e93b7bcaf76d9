"""Eight threads use one context manager: does it ever hang, lose a wake-up, or run an undeclared observer?"""
