"""How runs began and when their commands act, where a log does not say it: a value that belongs to a fit.

The contract has runs begin as their first samples say, heading 0 where a log holds none, and commands act when they
were given. A real run may have begun elsewhere, which is estimated with an explanation (`Problem.aligned`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Start:
    """Initial states and delays of runs that were estimated; what is not named is as declared.

    headings : rad, by a run's name. speeds : rad/s at the wheel, of an axis, by a searched run's name and first time.
    command_delays : s, by how much later than in the other runs a run's commands act, by its name.
    """

    headings: tuple[tuple[str, float], ...] = ()
    speeds: tuple[tuple[tuple[str, float], float], ...] = ()
    command_delays: tuple[tuple[str, float], ...] = ()

    def with_headings(self, headings: Mapping[str, float]) -> Start:
        """The same with other headings."""
        return replace(self, headings=tuple(headings.items()))

    def with_speeds(self, speeds: Mapping[tuple[str, float], float]) -> Start:
        """The same with other speeds."""
        return replace(self, speeds=tuple(speeds.items()))

    def with_command_delays(self, command_delays: Mapping[str, float]) -> Start:
        """The same with commands that act at other times."""
        return replace(self, command_delays=tuple(command_delays.items()))


DECLARED = Start()
