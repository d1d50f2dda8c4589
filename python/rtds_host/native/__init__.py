"""The motor units as a C library (`c/rtds_motor.h`): the model's bytes without Python.

`library` compiles it and calls it from Python, `words` writes a robot's numbers as C. The FMUs of
`rtds_host.export.fmu` are made of the same sources.
"""
