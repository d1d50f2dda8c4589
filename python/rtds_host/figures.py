"""What all figures do with names that come from outside: they are text, whatever they hold."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

from rtds_host.errors import visible

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from matplotlib.axis import Axis
    from matplotlib.figure import Figure
    from matplotlib.typing import RcKeyType

# Of all figures of runs.
STYLE: dict[RcKeyType, float] = {
    "font.size": 8,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "lines.linewidth": 0.9,
    "legend.fontsize": 7,
    "legend.frameon": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
}


def caption(figure: Figure, text: str) -> None:
    """The figure's title: no formula between two `$`, no control character."""
    figure.suptitle(visible(text), fontsize=9, parse_math=False)


def name_ticks(axis: Axis, names: Sequence[str], **options) -> None:
    """Ticks at 0, 1, 2, ... of an x or y axis with these names, as plain text as a caption; options are those of a
    text.
    """
    axis.set_ticks(range(len(names)), [visible(name) for name in names], parse_math=False, **options)


def save(figure: Figure, path: Path, **options) -> None:
    """`figure.savefig`; a character that the font lacks becomes a box, without a word to the terminal."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph", UserWarning)
        figure.savefig(path, **options)
