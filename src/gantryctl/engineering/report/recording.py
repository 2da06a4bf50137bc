"""Figures of a report: a printed picture, and where there is a recording, its samples for the viewer on the screen."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, NamedTuple

from gantryctl.engineering.report.drawing import draw_picture, looks_of
from gantryctl.engineering.report.pictures import Panel, Picture
from gantryctl.engineering.report.svg import svg

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class ShownFigure(NamedTuple):
    """A figure of a page.

    Attributes:
        name: no other figure's on the page; two reports of one kind have the same names.
        picture: an `<svg>` element, which is printed, and shown where scripts do not run.
        recording: samples as JSON for the viewer, "" for a figure without any.
    """

    name: str
    caption: str
    picture: str
    recording: str = ""


def still(figure: Figure, name: str, caption: str) -> ShownFigure:
    """A figure without a recording."""
    return ShownFigure(name, caption, svg(figure, name))


def recorded(picture: Picture, name: str, caption: str = "") -> ShownFigure:
    """A picture with its samples; its title is the caption unless another is given."""
    data = {
        "columns": picture.columns or len(picture.panels),
        "panels": [_panel(panel) for panel in picture.panels],
    }
    # Within a script element only "<" could end it.
    text = json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    return ShownFigure(name, caption or picture.title, svg(draw_picture(picture), name), text)


def _panel(panel: Panel) -> dict[str, Any]:
    return {
        "title": panel.title,
        "x": panel.x_label,
        "y": panel.y_label,
        "xBegin": panel.x_dial.begin_deg,
        "yBegin": panel.y_dial.begin_deg,
        "limits": panel.limits,
        "lines": [
            {"name": curve.name, **look._asdict(), "x": curve.x, "y": curve.y}
            for curve, look in zip(panel.lines, looks_of(panel), strict=True)
        ],
    }
