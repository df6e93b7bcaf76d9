"""What codra makes from specs, one package each; edits are lost. Renew: codra compile."""
