"""The same robot, another logger: transformations of a case and what must stay of its answer, `python -m
invariance`.
"""
