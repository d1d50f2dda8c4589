"""What the standard library has since Python 3.11, for 3.10 too (Ubuntu 22.04): `from rtds_host.compat import
tomllib`.
"""

from __future__ import annotations

import sys
from datetime import timezone

if sys.version_info >= (3, 11):
    from typing import Self

    import tomllib
else:
    import tomli as tomllib
    from typing_extensions import Self

__all__ = ["UTC", "Self", "tomllib"]

UTC = timezone.utc
