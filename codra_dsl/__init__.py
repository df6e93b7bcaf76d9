"""CoDRA DSL: context-driven observers for robots, declared in YAML and compiled to behaviour trees."""

from typing import TYPE_CHECKING

__all__ = ["__version__"]

__version__: str
"""The version of the installed distribution `codra-dsl`; `0.0.0.dev0` if codra is not installed."""

if not TYPE_CHECKING:

    def __getattr__(name: str) -> str:
        """Return the version. It is looked up when it is used, because the look-up takes longer than this import."""
        if name != "__version__":
            raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
        from importlib.metadata import PackageNotFoundError, version  # noqa: PLC0415

        try:
            globals()[name] = version("codra-dsl")
        except PackageNotFoundError:
            globals()[name] = "0.0.0.dev0"
        return globals()[name]
