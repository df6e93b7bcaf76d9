"""Inputs made to break a reader, and a watch over the effects of reading them."""
