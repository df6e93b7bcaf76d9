"""Sites: files with the values of a spec that differ on one site."""
