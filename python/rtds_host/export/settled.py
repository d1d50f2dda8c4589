"""The current of a winding whose voltage has a curve over the current itself, for robots that leave inductance out.

Its source goes into exported modules.
"""

from __future__ import annotations

# laws: begin
from rtds_host.plant.forms import OVER_CODE, TERM_CODE, VALUES, reads

V_OVER_I = TERM_CODE["voltage"], OVER_CODE["i"]
# laws: end


def settled(rows, ohm, current, made):
    """The current, A, that the curves of a side allow, and their voltage, V, there: ohm i - f(i) is what else drives.

    rows : curves of the side; current : A, now; made : V, what the curves gave to it.
    """
    if not any(row[0] == V_OVER_I[0] and row[1] == V_OVER_I[1] for row in rows):
        return current, 0.0
    free = ohm * current - made
    high = (abs(free) + sum(abs(value) for row in rows for value in row[VALUES:])) / ohm
    low = -high
    for _ in range(48):
        middle = 0.5 * (low + high)
        if ohm * middle - reads(rows, V_OVER_I[0], V_OVER_I[1], middle) < free:
            low = middle
        else:
            high = middle
    found = 0.5 * (low + high)
    return found, reads(rows, V_OVER_I[0], V_OVER_I[1], found)
