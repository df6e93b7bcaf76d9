"""`python -m codra_dsl` is `codra`."""

from codra_dsl.cli import main

if __name__ == "__main__":
    main()
