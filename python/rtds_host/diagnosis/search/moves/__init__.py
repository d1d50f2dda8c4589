"""Moves from one explanation to others: functions of a store and a fit.

What proposes alone returns proposals, which the store fits; what needs fits to go on has the store fit them and returns
these.
"""
