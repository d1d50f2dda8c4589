"""Registers of the RTL that each instance has for itself although others hold the same: a tool must not join them.

What a tool has to be told for it is said here for Yosys, and in quartus/*.qsf for Quartus (DONT_MERGE_REGISTER). The
RTL says nothing of tools.
"""

from __future__ import annotations

# Module -> registers: control beside the operands that it chooses (rtl/core/rtds_row.v).
OWN_REGISTERS = {
    "rtds_row": ("add_q", "mul_q", "add_en_q", "mul_en_q", "save_p_q", "save_hi_q", "save_lo_q"),
    "rtds_motor": ("ahead_q",),
}


def keep_commands() -> str:
    """Commands for Yosys, between `proc` and `flatten`, that keep these registers as they are.

    Yosys ends with an error where one of them is no flop: a name that has changed is found.
    """
    commands = []
    for module, registers in OWN_REGISTERS.items():
        for register in registers:
            flop = f"*{module}*/w:{register} %ci1:+$adff[Q] *{module}*/t:$adff %i"
            commands += [f"select -assert-min 1 {flop}", f"setattr -set keep 1 {flop}"]
    return "; ".join(commands) + "; "
