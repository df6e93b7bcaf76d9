"""Run the tests of the store with other seeds: `python -m tests.campaigns.stores ordinary=5`."""
