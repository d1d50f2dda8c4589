"""What all figures do with names that come from outside: they are text, whatever stands in them."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

from rtds_host.errors import visible

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure


def caption(figure: Figure, text: str) -> None:
    """The figure's title: no formula between two `$`, no control character."""
    figure.suptitle(visible(text), fontsize=9, parse_math=False)


def save(figure: Figure, path: Path, **options) -> None:
    """`figure.savefig`; a character that the font lacks becomes a box, without a word to the terminal."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph", UserWarning)
        figure.savefig(path, **options)
