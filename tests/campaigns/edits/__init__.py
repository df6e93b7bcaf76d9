"""Edit a project at random, and compare each run that uses results of earlier runs with a run that uses none."""
