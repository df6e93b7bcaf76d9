"""Writers of journals, killed at random instants: `python -m tests.kills 2000 1 50`, or `make kills`."""
