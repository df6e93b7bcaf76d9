"""The test kit: pytest runs a robot's observers and its main execution in a world that a timeline describes.

pytest loads `plugin` in every project, so this module imports nothing.
"""
