"""The test kit: pytest runs a robot's observers and its main execution in a world that a timeline tells.

`plugin` is what pytest loads in every project, so nothing is imported here.
"""
