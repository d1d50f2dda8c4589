"""TurtleBot3 bags by another hand, with a truth, and the table of what the program makes of them: `python -m
foreign`.
"""
