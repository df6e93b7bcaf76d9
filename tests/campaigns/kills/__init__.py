"""Kill writers of journals at random instants: `python -m tests.campaigns.kills 2000 1 50`, or `make kills`."""
