"""Eight threads at one context manager: does it ever hang, lose a wake-up, or run what it should not?"""
