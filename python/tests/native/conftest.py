"""The C library, compiled once."""

import pytest

from rtds_host.native.library import SOURCES, compile_shared


@pytest.fixture(scope="session")
def motor_library(tmp_path_factory):
    target = tmp_path_factory.mktemp("native") / "librtds_motor.so"
    compile_shared([SOURCES / "rtds_motor.c"], target)
    return target
