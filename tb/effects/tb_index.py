"""effect_index against the cell that is meant: at, just below and just above each border of a cell, of both kinds."""

import math
import random

import cocotb
import numpy as np
from cocotb.triggers import Timer

from rtds_host.motor.effect_program import TABLE_ORIGIN, TABLES

CELLS = 256
RANDOM_WORDS = 4000


def meant(word, origin):
    """The cell of a scaled argument: floor(u) + origin, held in the table; a NaN is in the cell of zero."""
    u = float(np.array(word, np.uint32).view(np.float32))
    if math.isnan(u):
        return origin
    return int(np.clip(np.floor(np.clip(u, -1e4, 1e4)) + origin, 0, CELLS - 1))


def arguments():
    """Words of u: each whole number of cells and both its neighbours, the ends of the format, random ones."""
    whole = np.arange(0, CELLS + 2, dtype=np.float32).view(np.uint32).astype(np.int64)
    sizes = {int(w) for w in np.concatenate([whole, whole + 1, np.maximum(whole, 1) - 1])}
    sizes |= {0x00000001, 0x007FFFFF, 0x00800000, 0x4F000000, 0x7F7FFFFF, 0x7F800000, 0x7F800001, 0x7FC00000}
    rng = random.Random(47)
    sizes |= {rng.randrange(0x3E000000, 0x44000000) for _ in range(RANDOM_WORDS)}
    return [size | sign for size in sorted(sizes) for sign in (0, 1 << 31)]


@cocotb.test()
async def every_border_of_every_cell(dut):
    """The first and the last cell of both kinds of tables among them."""
    reached = {0: set(), 1: set()}
    for signed, table in ((1, "command"), (0, "ripple")):
        assert table in TABLES
        dut.signed_i.value = signed
        for word in arguments():
            dut.u_i.value = word
            await Timer(1, "ns")
            cell = int(dut.cell_o.value)
            assert cell == meant(word, TABLE_ORIGIN[table]), f"u = {word:08x} in a table of {table}"
            reached[signed].add(cell)
    assert all(cells == set(range(CELLS)) for cells in reached.values())
