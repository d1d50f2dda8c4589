"""The search for explanations, sets of (effect, side).

- `store`: the best fit of each explanation so far, and how probable each is;
- `screening`: by how much effects are predicted to improve a fit;
- `moves`: functions from a fit to proposals, where to start the fit of another explanation;
- `driver`: one search, which decides on the next move and when to end; `limits`: how much work it may do;
- `beam`: several explanations of each number of effects, by the same moves.
"""
