"""The blind check: worlds that make logs whose cause is withheld, sealing, and scoring.

Nothing here imports the diagnoser or its replay: what it makes is evidence only as long as it is independent.
"""
