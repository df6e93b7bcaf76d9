"""CoDRA DSL: context-driven observers for robots, declared in YAML and compiled to behaviour trees."""

__all__ = ["__version__"]

__version__ = "0.1.0"
