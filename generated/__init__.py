"""Packages that codra makes from specs, one per spec; edits are lost. Renew: codra compile."""
