"""The command `codra`."""

import gc

__all__ = ["main"]

_YOUNG_OBJECTS = 10_000
"""Python's collector runs after this many new objects, not after 700: modules and values stay in use, with few cycles.
"""


def main() -> None:
    """Run the command line and exit: 0 clean, 1 findings or failed, 2 usage, 70 internal error, 130 interrupted."""
    gc.set_threshold(_YOUNG_OBJECTS)
    try:
        from codra_dsl.cli.app import command_line

        code = command_line()
    except KeyboardInterrupt:  # also while modules are still being loaded
        code = 130
    gc.freeze()  # Python collects garbage twice at its end, and would traverse all modules and values for nothing
    raise SystemExit(code)
