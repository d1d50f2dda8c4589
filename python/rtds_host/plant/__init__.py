"""The plant: each equation of motors, gears, wheels and sensors as one function, and one table of its parameters.

Replays, the simulator's coupling, the tables of the effect unit, exports and the blocks driven by measured signals all
use these functions. Two copies stay apart on purpose, because they check this one: the worlds of `rtds_host.blind` and
`rtds_host.motor.effect_reference`.
"""
