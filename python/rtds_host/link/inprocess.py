"""What the links share whose motors are computed by a call in this process."""

from __future__ import annotations

import numpy as np

from rtds_host.compat import Self
from rtds_host.errors import InputError, LinkError
from rtds_host.link.base import CLOSED, NO_PARAMETERS, Exchange, exchange_of, input_words, whole_steps
from rtds_host.link.configured import ConfiguredLink
from rtds_host.vectors import Vector


class InProcessLink(ConfiguredLink):
    """`Link.exchange` by way of `_step`, and `close`, which ends nothing but the link's own use."""

    _closed = False

    def exchange(
        self,
        voltages: Vector,
        torques: Vector,
        interval_s: float,
        sample_s: float | None = None,
    ) -> Exchange:
        """See `Link.exchange`."""
        self._check_open()
        if self.step_s == 0.0:
            raise InputError(NO_PARAMETERS)
        v, t = input_words("voltages", voltages), input_words("torques", torques)
        steps = whole_steps("interval_s", interval_s, self.step_s)
        sample_steps = steps if sample_s is None else whole_steps("sample_s", sample_s, self.step_s)
        self._exchanged = True
        return exchange_of(self._step(v, t, steps, sample_steps), steps, sample_steps, self.step_s)

    def _step(self, v: np.ndarray, t: np.ndarray, steps: int, sample_steps: int) -> np.ndarray:
        """Samples (n, 4) float32, i_l w_l i_r w_r, of `steps` steps with the inputs (2,) float32 held."""
        raise NotImplementedError

    def close(self) -> None:
        """See `Link.close`."""
        self._closed = True

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc_info: object) -> None:
        self.close()

    def _check_open(self) -> None:
        if self._closed:
            raise LinkError(CLOSED)
