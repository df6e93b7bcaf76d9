"""Runs in the laboratory: arms, trials, outcomes and scores."""
