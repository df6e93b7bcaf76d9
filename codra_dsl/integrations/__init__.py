"""Integrations: main executions that are not plain Python, graphs of other libraries, tests, and inspection."""
