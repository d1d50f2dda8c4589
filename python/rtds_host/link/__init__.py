"""Links: one small interface to the motors: the bit-exact model, the RTL in a simulator, the whole chip, or a board."""

from __future__ import annotations

from typing import Any

from rtds_host.errors import InputError
from rtds_host.link.base import Exchange, Link

__all__ = ["LINKS", "Exchange", "Link", "open_link"]

LINKS = ("model", "rtl", "chip", "ad2", "hps")


def open_link(kind: str, **options: Any) -> Link:
    """Open a link to the motors.

    Parameters
    ----------
    kind : "model" (bit-exact model, in process), "rtl" (the motor units' Verilog in a simulator), "chip" (the whole
    chip
        in a simulator, through its pins), "ad2" (a board behind two Analog Discovery 2) or
        "hps" (a board's FPGA, from its own processor: `rtds_host.link.hps.HpsLink`).
    **options : of `chip` see `rtds_host.link.chip.ChipLink`, of `ad2` `rtds_host.link.ad2.Ad2Link`; of `rtl`
    `rtds_host.link.rtl.RtlLink`: `sim` ("verilator" or "icarus"), `step_clocks`
        (clocks from one step to the next, 500 as on the board, or "min": the next as soon as the unit is ready),
        `timeout_s`, `progress`. The model ignores `sim` and `step_clocks`: its results do not depend on them.

    Raises
    ------
    InputError : unknown kind or option value.
    LinkError : the simulator cannot be built or started.
    """
    if kind == "model":
        from rtds_host.link.model import ModelLink

        return ModelLink()
    if kind == "rtl":
        from rtds_host.link.rtl import RtlLink

        return RtlLink(**options)
    if kind == "chip":
        from rtds_host.link.chip import ChipLink

        return ChipLink(**options)
    if kind == "ad2":
        from rtds_host.link.ad2 import Ad2Link

        return Ad2Link(**options)
    if kind == "hps":
        from rtds_host.link.hps import HpsLink

        return HpsLink(**options)
    raise InputError(f"link: {kind!r} is unknown, choose one of {', '.join(LINKS)}")
