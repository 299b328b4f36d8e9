"""A figure that notebooks show by itself, also where pyplot was never imported."""

from __future__ import annotations

import io

from matplotlib.figure import Figure


class ShownFigure(Figure):
    """A figure of matplotlib with a picture for IPython's display."""

    def _repr_png_(self) -> bytes:
        """Return the figure as a PNG."""
        content = io.BytesIO()
        self.savefig(content, format="png", bbox_inches="tight")
        return content.getvalue()
