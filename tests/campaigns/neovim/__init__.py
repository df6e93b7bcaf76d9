"""Neovim, with the settings of the docs, shows a finding and follows a definition."""
