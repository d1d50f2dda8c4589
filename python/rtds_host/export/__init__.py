"""A diagnosis in the user's own simulator: the robot with what was found in it, as MJCF, URDF, SDF, USD attributes or
Python.
"""

from __future__ import annotations

import sys
import types
from typing import Any


class _Callable(types.ModuleType):
    """This sub-package bears the name of the function `rtds_host.export`, and can be called in its place."""

    def __call__(self, *args: Any, **options: Any) -> Any:
        from rtds_host import api

        return api.export(*args, **options)


sys.modules[__name__].__class__ = _Callable
