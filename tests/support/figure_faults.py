"""What is wrong with a figure, by what its renderer says: curves outside, empty axes, text over text or a curve."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox

# Least part of the width and of the height of axes that data and limits cover: with matplotlib's own margins it is
# 0.91, a symmetrical axis of a curve on one side has 0.45.
WIDTH_PART = 0.6
HEIGHT_PART = 0.35
# Boxes of letters have a margin: what touches by this many pixels does not hide anything.
TOUCH_PX = 1.5


def faults_of(figure: Figure) -> list[str]:
    """Every fault, in words; empty for a good figure."""
    canvas = figure.canvas
    if not isinstance(canvas, FigureCanvasAgg):
        canvas = FigureCanvasAgg(figure)
    # Twice: a constrained layout settles in the first.
    canvas.draw()
    canvas.draw()
    found = []
    for axes in figure.axes:
        if axes.get_visible() and axes.axison:
            found += [f"{_name(axes)}: {fault}" for fault in _faults_of_axes(axes)]
            found += [
                f"{_name(axes)}: {fault}" for fault in _faults_of_legend(figure, axes, canvas.get_renderer())
            ]
    return found + _faults_of_text(figure, canvas.get_renderer())


def _name(axes: Axes) -> str:
    titles = [axes.get_title(loc) for loc in ("left", "center", "right")]
    return next(filter(None, [*titles, axes.get_ylabel(), axes.get_xlabel()]), "axes")


def _faults_of_axes(axes: Axes) -> Iterator[str]:
    points = _data_of(axes)
    if not len(points):
        yield "nothing is drawn"
        return
    for k, (way, limits, low_part) in enumerate(
        (("width", axes.get_xlim(), WIDTH_PART), ("height", axes.get_ylim(), HEIGHT_PART))
    ):
        scale = axes.transScale.transform
        ends = np.sort(scale(np.array([axes.get_xlim(), axes.get_ylim()]).T)[:, k])
        values = scale(points)[:, k]
        values = values[np.isfinite(values)]
        size = ends[1] - ends[0]
        if values.min() < ends[0] - 1e-3 * size or values.max() > ends[1] + 1e-3 * size:
            yield f"a curve leaves the {way}: {values.min():g} .. {values.max():g} in {limits[0]:g} .. {limits[1]:g}"
        # Panels that share an axis fill it together.
        group = (axes.get_shared_x_axes(), axes.get_shared_y_axes())[k].get_siblings(axes)
        marks = np.concatenate([scale(_marks_of(each))[:, k] for each in group])
        inside = marks[np.isfinite(marks) & (marks >= ends[0]) & (marks <= ends[1])]
        covered = (inside.max() - inside.min()) / size
        # A constant has no extent: it lies in the middle.
        if values.max() - values.min() > 1e-9 * max(1e-9, np.abs(values).max()) and covered < low_part:
            yield f"data cover {100.0 * covered:.0f} % of the {way}, less than {100.0 * low_part:.0f} %"


def _faults_of_legend(figure: Figure, axes: Axes, renderer: Any) -> Iterator[str]:
    """A legend, of these axes or of the figure, over one of their curves, markers, bars or filled areas."""
    for legend in (*figure.legends, axes.get_legend()):
        if legend is None or not legend.get_visible():
            continue
        box = legend.get_window_extent(renderer)
        # A curve that leaves its axes is cut off there.
        box = Bbox.intersection(box, axes.bbox)
        if box is None or min(box.width, box.height) < TOUCH_PX:
            continue
        for line in axes.lines:
            path = line.get_transform().transform_path(line.get_path())
            marked = line.get_marker() not in {"None", "none", "", " ", None}
            if marked and box.count_contains(path.vertices):
                yield f"the legend covers markers of {line.get_label()!r}"
            elif line.get_linestyle() != "None" and path.intersects_bbox(box, filled=False):
                yield f"the legend covers {line.get_label()!r}"
        for patch in axes.patches:
            path = patch.get_transform().transform_path(patch.get_path())
            if patch.get_visible() and path.intersects_bbox(box, filled=True):
                yield f"the legend covers {patch.get_label()!r}"
        for collection in axes.collections:
            offsets = collection.get_offset_transform().transform(np.asarray(collection.get_offsets()))
            marked = len(offsets) > 0 and box.count_contains(offsets) > 0
            paths = [collection.get_transform().transform_path(path) for path in collection.get_paths()]
            if marked or any(path.intersects_bbox(box, filled=True) for path in paths):
                yield f"the legend covers {collection.get_label()!r}"


def _data_of(axes: Axes) -> Any:
    """Points of curves, markers, bars and filled areas in data coordinates."""
    points = [np.empty((0, 2))]
    for line in axes.lines:
        if line.get_transform() == axes.transData and line.get_visible():
            points.append(np.asarray(line.get_xydata(), dtype=float))
    for patch in axes.patches:
        if (
            patch.get_visible()
            and patch.get_transform().contains_branch(axes.transData)
            and patch.get_data_transform() == axes.transData
        ):
            corners = patch.get_path().transformed(patch.get_patch_transform()).vertices
            points.append(np.asarray(corners))
    for collection in axes.collections:
        if collection.get_visible():
            offsets = np.asarray(collection.get_offsets())
            if collection.get_offset_transform() == axes.transData and len(offsets) and offsets.any():
                points.append(offsets)
            elif collection.get_transform() == axes.transData:
                points += [path.vertices for path in collection.get_paths()]
    together = np.concatenate(points)
    return together[np.isfinite(together).all(axis=1)]


def _marks_of(axes: Axes) -> Any:
    """Data, and the limits that are drawn as lines across: a reader needs both."""
    points = _data_of(axes)
    more = [points]
    for line in axes.lines:
        x, y = np.asarray(line.get_xdata(), float), np.asarray(line.get_ydata(), float)
        # Across the whole axes, in one coordinate only: the other is that of a point.
        if len(points) and line.get_transform() == axes.get_yaxis_transform(which="grid"):
            more.append(np.column_stack([np.full(len(y), points[0, 0]), y]))
        elif len(points) and line.get_transform() == axes.get_xaxis_transform(which="grid"):
            more.append(np.column_stack([x, np.full(len(x), points[0, 1])]))
    return np.concatenate(more)


def _faults_of_text(figure: Figure, renderer: Any) -> list[str]:
    boxes = [(text.get_text(), text.get_window_extent(renderer)) for text in _texts(figure)]
    page = figure.bbox
    found = [
        f"{words!r} leaves the figure: {box.x0:.0f} .. {box.x1:.0f}, {box.y0:.0f} .. {box.y1:.0f} pixels"
        for words, box in boxes
        if box.x0 < page.x0 - TOUCH_PX
        or box.y0 < page.y0 - TOUCH_PX
        or box.x1 > page.x1 + TOUCH_PX
        or box.y1 > page.y1 + TOUCH_PX
    ]
    for k, (words, box) in enumerate(boxes):
        found += [f"{words!r} over {other!r}" for other, beside in boxes[k + 1 :] if _over(box, beside)]
    return found


def _over(one: Bbox, other: Bbox) -> bool:
    width = min(one.x1, other.x1) - max(one.x0, other.x0)
    height = min(one.y1, other.y1) - max(one.y0, other.y0)
    return width > TOUCH_PX and height > TOUCH_PX


def _texts(figure: Figure) -> Iterator[Text]:
    """Every text that is drawn: of tick labels those of ticks inside the axes."""
    labels: set[Text] = set()
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            ticks = [*axis.get_major_ticks(), *axis.get_minor_ticks()]
            labels |= {label for tick in ticks for label in (tick.label1, tick.label2)}
            if not (axes.get_visible() and axes.axison and axis.get_visible()):
                continue
            low, high = sorted(axis.get_view_interval())
            for tick in ticks:
                slack = 1e-9 * (high - low)
                if low - slack <= tick.get_loc() <= high + slack:
                    yield from (t for t in (tick.label1, tick.label2) if t.get_visible() and t.get_text())
            labels.add(axis.get_offset_text())
            if axis.get_offset_text().get_visible() and axis.get_offset_text().get_text():
                yield axis.get_offset_text()
    hidden = {text for axes in figure.axes if not axes.axison for text in axes.findobj(Text)}
    for text in figure.findobj(Text):
        assert isinstance(text, Text)
        if text not in labels and text not in hidden and text.get_visible() and text.get_text().strip():
            yield text


@contextmanager
def watched(monkeypatch: Any) -> Iterator[dict[str, list[str]]]:
    """Faults of every figure that is saved, by its titles."""
    found: dict[str, list[str]] = {}
    save: Callable[..., None] = Figure.savefig

    def checked(figure: Figure, *args: Any, **options: Any) -> None:
        name = " | ".join(dict.fromkeys(_name(axes) for axes in figure.axes))
        # First, and so the same to the byte as where nobody watches.
        save(figure, *args, **options)
        found[f"{len(found)} {name}"] = faults_of(figure)

    with monkeypatch.context() as patch:
        patch.setattr(Figure, "savefig", checked)
        yield found
