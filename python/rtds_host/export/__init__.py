"""A diagnosis in the user's own simulator: the robot with what was found in it, as MJCF, URDF, SDF, USD attributes or
Python.
"""
