"""A figure that a notebook shows by itself, whether or not pyplot was ever imported there.

Imports matplotlib: load it where a figure is made.
"""

from __future__ import annotations

import io
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

_DOTS = 100  # per inch


class ShownFigure(Figure):
    """A figure on the Agg canvas that notebooks display as a picture."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        FigureCanvasAgg(self)

    def _repr_png_(self) -> bytes:
        """PNG picture, which IPython asks for."""
        data = io.BytesIO()
        self.savefig(data, format="png", dpi=_DOTS)
        return data.getvalue()
