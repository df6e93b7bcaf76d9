"""Writers of journals, killed at random instants: `python -m tests.kills 2000`, or `make kills`."""
