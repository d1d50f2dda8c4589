"""The run that would tell: a manoeuvre for a robot and a floor, as a table, csv and a ROS 2 script."""

from __future__ import annotations

import sys
import types
from typing import Any


class _Callable(types.ModuleType):
    """This sub-package bears the name of the function `rtds_host.plan`, and can be called in its place."""

    def __call__(self, *args: Any, **options: Any) -> Any:
        from rtds_host import api

        return api.plan(*args, **options)


sys.modules[__name__].__class__ = _Callable
