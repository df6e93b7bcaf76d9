"""A module that must never be imported: specs name it in `call`."""

raise AssertionError("a perception function that a spec names was imported")
