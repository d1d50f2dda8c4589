"""Two DC motors on a fixed step: the bit-exact model of the RTL, and the float64 references it is judged by.

`MotorPair` is what the in-process link drives. `CoreModel` is the same arithmetic seen strobe by strobe, with the
parameter unit's fault rule, for comparison with the RTL. `reference` shares no code with either.
"""

from rtds_host.motor.model import SAMPLE_COLUMNS, CoreModel, EnergyTerms, MotorPair
from rtds_host.motor.parameters import METHODS, PARAMETER_NAMES, coefficients, parameter_words

__all__ = [
    "METHODS",
    "PARAMETER_NAMES",
    "SAMPLE_COLUMNS",
    "CoreModel",
    "EnergyTerms",
    "MotorPair",
    "coefficients",
    "parameter_words",
]
