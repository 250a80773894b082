"""Figures as pixels and vector graphics: for files and for one HTML file, in parallel.

Traversing a figure's artists takes longer than writing either format, and the layout takes equally
long. So both formats share one layout, one traversal, and the text sizes.
"""

from __future__ import annotations

import base64
import io
import json
import os
import re
import struct
import warnings
import zlib
from collections.abc import Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backend_bases import GraphicsContextBase, RendererBase
from matplotlib.backends.backend_agg import FigureCanvasAgg, RendererAgg
from matplotlib.backends.backend_svg import RendererSVG
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.text import Text

from bywire.core.copies import may_copy, processes
from bywire.core.errors import FileError
from bywire.core.machine import worker_count
from bywire.core.scratch import replacing
from bywire.report.document import Picture
from bywire.report.wording import clean

if TYPE_CHECKING:
    from bywire.report.document import FigureBlock

_COMPRESSION = 3
"""zlib's next level takes twice as long, to save 1 % of many points, 15 % of few lines"""
_FONTS = "'DejaVu Sans', 'Bitstream Vera Sans', Verdana, sans-serif"
"""matplotlib's font, and fonts of equal width where it is not installed"""
_Pixels = np.ndarray[Any, np.dtype[np.uint8]]
_ANONYMOUS = {"Date": None, "Creator": None, "Format": None, "Type": None}


def drawn(figure: Figure, dpi: float) -> tuple[bytes, bytes]:
    """Return a figure as PNG and as SVG file.

    The figure's layout is computed only once: a second layout would shift it by fractions of a
    pixel, so the same figure would give different bytes.

    Parameters
    ----------
    figure
        Figure to draw.
    dpi
        Pixels per inch.
    """
    canvas, resolution = figure.canvas, figure.dpi
    settings = mpl.rc_context({"svg.hashsalt": "bywire"})
    with settings, warnings.catch_warnings():
        # matplotlib draws a character that is missing in the font as a box, which is not an error.
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        try:
            figure.dpi = dpi
            both = _Canvas(figure).get_renderer()
            settle(figure)
            figure.draw(both)
        finally:
            figure.dpi = resolution
            figure.set_canvas(canvas)
    figure.stale = False  # resetting the resolution does not change the drawing
    return _png(both.pixels[:, :, :3], dpi), both.vector.file(*figure.get_size_inches())


def settle(figure: Figure) -> None:
    """Compute the layout of a figure once."""
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
        with mpl.rc_context({"figure.autolayout": False, "figure.constrained_layout.use": False}):
            figure.set_layout_engine(None)


class _Vector(RendererSVG):
    """Vector graphics in pixels, with texts as text.

    Texts are stretched to their intended width if another font is used.
    """

    def __init__(self, width: float, height: float, dpi: float) -> None:
        self._text, self._points = io.StringIO(), dpi / 72.0
        super().__init__(width, height, self._text, metadata=_ANONYMOUS)

    def draw_text(
        self,
        gc: GraphicsContextBase,
        x: float,
        y: float,
        s: str,
        prop: FontProperties,
        angle: float,
        ismath: Any = False,
        mtext: Text | None = None,
        width: float = 0.0,
    ) -> None:
        size = self._points * float(prop.get_size_in_points())
        if ismath:
            scaled = prop.copy()
            scaled.set_size(size)
            with mpl.rc_context({"svg.fonttype": "path"}):
                super().draw_text(gc, x, y, s, scaled, angle, ismath, mtext)
            return
        look = {"font-size": f"{size:.2f}px"}
        red, green, blue, alpha = gc.get_rgb()
        if red or green or blue:
            look["fill"] = f"rgb({red:.1%} {green:.1%} {blue:.1%})"
        if alpha != 1.0:
            look["opacity"] = f"{alpha:.3g}"
        if prop.get_weight() not in ("normal", 400):
            look["font-weight"] = str(prop.get_weight())
        place = {"x": f"{x:.1f}", "y": f"{y:.1f}", "textLength": f"{width:.1f}"}
        if angle:
            place["transform"] = f"rotate({-angle:g} {x:.1f} {y:.1f})"
        style = "; ".join(f"{key}: {value}" for key, value in look.items())
        self.writer.element(
            "text", text=s, attrib=place, lengthAdjust="spacingAndGlyphs", style=style
        )

    def draw_pixels(self, x: int, y: int, pixels: _Pixels) -> None:
        """Draw an image, upside down, whose lower left corner is at (x, y)."""
        data = _png(pixels)
        height, width, _ = pixels.shape
        self.writer.element(
            "image",
            attrib={
                "id": self._make_id("image", data),
                "xlink:href": "data:image/png;base64,\n" + base64.b64encode(data).decode("ascii"),
                "transform": f"scale(1 -1) translate(0 {-height})",
                "x": f"{x}",
                "y": f"{y + height - self.height:g}",
                "width": f"{width}",
                "height": f"{height}",
            },
        )

    def _get_style_dict(self, gc: GraphicsContextBase, rgbFace: Any) -> dict[str, Any]:
        scaled = self.new_gc()
        scaled.copy_properties(gc)
        scaled.set_linewidth(self._points * gc.get_linewidth())
        dashes: Any = gc.get_dashes()
        offset, lengths = dashes
        if lengths is not None:
            scaled.set_dashes(self._points * offset, [self._points * each for each in lengths])
        style: dict[str, Any] = super()._get_style_dict(scaled, rgbFace)
        return style

    def file(self, width: float, height: float) -> bytes:
        """Return the file of a figure with a size in inches."""
        self.finalize()
        size = f'width="{72.0 * width:g}pt" height="{72.0 * height:g}pt" font-family="{_FONTS}"'
        text = re.sub(r' width="[^"]*" height="[^"]*"', f" {size}", self._text.getvalue(), count=1)
        return text.encode()


class _Both(RendererBase):
    """Renderer of pixels and vector graphics together; the pixels determine all sizes."""

    def __init__(self, agg: Any) -> None:
        super().__init__()
        self._agg, self.vector = agg, _Vector(agg.width, agg.height, agg.dpi)
        self._image: Any = None
        self.width, self.height, self.dpi = agg.width, agg.height, agg.dpi
        self._sizes: dict[tuple[str, int, Any], tuple[float, float, float]] = {}
        for name in (
            "new_gc",
            "points_to_pixels",
            "get_canvas_width_height",
            "get_image_magnification",
            "flipy",
        ):
            setattr(self, name, getattr(agg, name))
        for name in (
            "draw_path",
            "draw_markers",
            "draw_path_collection",
            "draw_quad_mesh",
            "draw_image",
            "draw_gouraud_triangles",
        ):
            setattr(self, name, self._twice(name))

    @property
    def pixels(self) -> _Pixels:
        """Red, green, blue and opacity, shape ``(height, width, 4)``."""
        return np.asarray(self._agg.buffer_rgba())

    def draw_text(
        self,
        gc: GraphicsContextBase,
        x: float,
        y: float,
        s: str,
        prop: FontProperties,
        angle: float,
        ismath: Any = False,
        mtext: Text | None = None,
    ) -> None:
        self._agg.draw_text(gc, x, y, s, prop, angle, ismath, mtext)
        width, _, _ = self.get_text_width_height_descent(s, prop, ismath)
        self.vector.draw_text(gc, x, y, s, prop, angle, ismath, mtext, width)

    def get_text_width_height_descent(
        self, s: str, prop: FontProperties, ismath: Any
    ) -> tuple[float, float, float]:
        """Return the size of a text in pixels, measured only once for the layout."""
        key = s, hash(prop), ismath
        if key not in self._sizes:
            self._sizes[key] = self._agg.get_text_width_height_descent(s, prop, ismath)
        return self._sizes[key]

    def _twice(self, name: str) -> Any:
        on_pixels, as_vectors = getattr(self._agg, name), getattr(self.vector, name)

        def draw(*args: Any, **settings: Any) -> None:
            on_pixels(*args, **settings)
            beside = as_vectors if self._image is None else getattr(self._image, name)
            beside(*args, **settings)

        return draw

    def start_rasterizing(self) -> None:
        """Begin a part that is an image even in vector graphics, such as a color scale."""
        self._image = RendererAgg(self.width, self.height, self.dpi)

    def stop_rasterizing(self) -> None:
        """End this part, and draw the image."""
        if self._image is None:
            return
        pixels = np.asarray(self._image.buffer_rgba())
        rows, columns = (np.flatnonzero(pixels[..., 3].any(axis=axis)) for axis in (1, 0))
        self._image = None
        if rows.size:
            image = pixels[
                rows[-1] : rows[0] - 1 if rows[0] else None : -1, columns[0] : columns[-1] + 1
            ]
            below = len(pixels) - int(rows[-1]) - 1
            self.vector.draw_pixels(int(columns[0]), below, image)


class _Canvas(FigureCanvasAgg):
    """A canvas with this renderer, which layouts ask for sizes."""

    _both: _Both | None = None

    def get_renderer(self) -> _Both:
        if self._both is None:
            self._both = _Both(super().get_renderer())
        return self._both


def _png(pixels: _Pixels, dpi: float = 0.0) -> bytes:
    """Return pixels of three or four channels as a PNG file; Pillow would load five other formats.

    Pillow's encoder also takes twice as long.
    """
    height, width, colors = pixels.shape
    rows = np.zeros((height, 1 + colors * width), np.uint8)  # each row begins with its filter: none
    rows[:, 1:] = pixels.reshape(height, -1)
    per_meter = round(dpi / 0.0254)
    size = _chunk(b"pHYs", struct.pack(">IIB", per_meter, per_meter, 1)) if dpi else b""
    kind = {3: 2, 4: 6}[colors]  # opaque colors, or with opacity
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        [
            _chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, kind, 0, 0, 0)),
            size,
            _chunk(b"IDAT", zlib.compress(rows.data, _COMPRESSION)),
            _chunk(b"IEND", b""),
        ]
    )


def _chunk(name: bytes, data: bytes) -> bytes:
    check = zlib.crc32(name + data)
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", check)


# --- Figures to bytes and files: equal input gives equal bytes, and no file is half written

PNG_DPI = 160
"""pixels per inch of a PNG"""

_KINDS = ("png", "svg")
_drawn: WeakKeyDictionary[Figure, tuple[bytes, bytes]] = WeakKeyDictionary()


def figure_bytes(figure: Figure | Picture, kind: str = "png") -> bytes:
    """Return a figure as a PNG or SVG file; both are drawn together, and again only when changed.

    ``figure``: figure to draw; ``kind``: ``"png"`` or ``"svg"``.

    Raises
    ------
    FileError
        For any other kind.
    """
    if kind not in _KINDS:
        raise FileError(
            f"bywire cannot write figures as {kind!r}. Change the extension to .png or .svg"
        )
    if isinstance(figure, Picture):
        return figure.png if kind == "png" else figure.svg
    if figure.stale or figure not in _drawn:
        _drawn[figure] = drawn(figure, PNG_DPI)
    return _drawn[figure][_KINDS.index(kind)]


def save_figure(figure: Figure | Picture, path: str | os.PathLike[str]) -> Path:
    """Write a figure as PNG or SVG, depending on the path's extension.

    Raises
    ------
    FileError
        When the path has another extension or the file cannot be written.
    """
    target = Path(path)
    return write_bytes(target, figure_bytes(figure, target.suffix.removeprefix(".").lower()))


def write_bytes(path: str | os.PathLike[str], content: bytes) -> Path:
    """Write a complete file or nothing; an older file remains until the new one is complete.

    The function creates a missing folder.

    Raises
    ------
    FileError
        When the folder cannot be created or is not writable. The message contains file and reason.
    """
    target = Path(path)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with replacing(target) as fresh:
            fresh.write_bytes(content)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise FileError(
            f"cannot write {target}: {reason}. Free some space there, or choose a writable folder",
            name=str(target),
        ) from None
    return target


# --- Figures for one HTML file: vector graphics with ids of their own, or pixels where smaller

_TIME = re.compile(r"time \[(m?s)\]")  # the label of an abscissa
_DECIMALS = re.compile(r"(\.\d)\d+")  # of a coordinate; what is kept of them
_SECONDS = {"s": 1.0, "ms": 1e-3}

BUDGET = 2_000_000
"""maximum total size of vector graphics on a page [byte]"""


def inline_figures(
    figures: Sequence[tuple[Figure | Picture, str]], budget: int = BUDGET
) -> list[str]:
    """Return the HTML of figures with their captions as descriptions.

    All are SVG at first. While they exceed the budget, the largest one becomes a PNG if the PNG is
    smaller.

    ``figures``: figures and their alternative texts; ``budget``: bytes for all of them.
    """
    markup = [_svg(figure, text, f"f{k}-") for k, (figure, text) in enumerate(figures, 1)]
    largest_first = sorted(range(len(markup)), key=lambda k: -len(markup[k]))
    for k in largest_first:
        if sum(map(len, markup)) <= budget:
            break
        markup[k] = min(markup[k], _as_pixels(*figures[k]), key=len)
    return markup


def _svg(figure: Figure | Picture, text: str, prefix: str) -> str:
    """Return a figure as SVG element with ids that are unique on the page."""
    whole = figure_bytes(figure, "svg").decode("utf-8")
    svg = whole[whole.index("<svg") :].strip()
    svg = re.sub(r"<!--.*?-->|<metadata>.*?</metadata>|<style.*?</style>", "", svg, flags=re.S)
    head, body = svg.split(">", 1)
    kept = " ".join(re.findall(r'(?:viewBox|font-family)="[^"]*"', head))
    body = re.sub(r"<[^>]*>", lambda tag: _tag(tag[0], prefix), body)
    # A pattern that may begin with any blank would take five times as long.
    body = re.sub(r"\n\s+", "\n", body.replace(" \n", "\n"))
    return f'<svg {kept} role="img" aria-label="{_attribute(text)}"{axes_of(figure)}>{body}'


def axes_of(figure: Figure | Picture) -> str:
    """Return an attribute with the positions of axes, relative to the figure, and their limits."""
    if isinstance(figure, Picture):
        return figure.axes
    known = [
        {
            "box": [round(float(each), 5) for each in axes.get_position().extents],
            "x": _span(axes.get_xlim(), axes.get_xscale()),
            "y": _span(axes.get_ylim(), axes.get_yscale()),
            **_time(axes),
        }
        for axes in figure.axes
        if {axes.get_xscale(), axes.get_yscale()} <= {"linear", "log"} and axes.axison
    ]
    text = json.dumps(known, separators=(",", ":"))
    return f' data-axes="{escape(text, quote=True)}"' if known else ""


def _time(axes: Axes) -> dict[str, float]:
    """Return the length of a unit of a time axis [s]; None for any other axis."""
    together = axes.get_shared_x_axes().get_siblings(axes)
    labels = (_TIME.fullmatch(each.get_xlabel()) for each in together)
    return next(({"t": _SECONDS[found[1]]} for found in labels if found), {})


def _span(limits: tuple[float, float], scale: str) -> list[float | bool]:
    return [*(float(f"{each:.8g}") for each in limits), scale == "log"]


def _tag(tag: str, prefix: str) -> str:
    """Return a tag with unique ids, and coordinates at visible resolution."""
    tag = tag.replace("xlink:href=", "href=").replace(' id="', f' id="{prefix}')
    tag = tag.replace('href="#', f'href="#{prefix}').replace("url(#", f"url(#{prefix}")
    # Assembled from its parts, in half the time that replacements would take.
    return re.sub(r' d="[^"]*"', lambda m: "".join(_DECIMALS.split(m[0])), tag)


def _as_pixels(figure: Figure | Picture, text: str) -> str:
    content = figure_bytes(figure, "png")
    width, height = struct.unpack(">II", content[16:24])  # of the header
    data = base64.b64encode(content).decode("ascii")
    return (
        f'<svg viewBox="0 0 {width} {height}" role="img" aria-label="{_attribute(text)}"'
        f"{axes_of(figure)}>"
        f'<image width="{width}" height="{height}" href="data:image/png;base64,{data}"/></svg>'
    )


def _attribute(text: str) -> str:
    return escape(clean(text).replace("\n", " "), quote=True)


# --- Figures drawn side by side, in copies of this process

FEW = 4
"""number of figures up to which processes are not worth their start"""

# Data of a copy of this process, which shares them.
_blocks: list[FigureBlock] = []


@contextmanager
def drawn_side_by_side(blocks: Sequence[FigureBlock]) -> Iterator[None]:
    """Draw figures while the block runs, if there are many and this process can be forked.

    The drawn figures replace them at the end of the block. Other figures are drawn on request.
    """
    count = worker_count(most=len(blocks))
    if len(blocks) <= FEW or count == 1 or not may_copy():
        yield
        return
    _blocks[:] = blocks
    with processes(count, list, is_copied=True) as pool:
        # Long ones start first, because at the end all other processes would wait for them.
        order = sorted(range(len(blocks)), key=lambda k: not blocks[k].is_long)
        drawn = {k: pool.submit(_picture, k) for k in order}
        yield
        try:
            for k, each in drawn.items():
                blocks[k].__dict__["figure"] = each.result()
        except BrokenProcessPool:  # killed, most likely out of memory: the rest is drawn here
            pass
    _blocks.clear()


def _picture(k: int) -> Picture:
    figure = _blocks[k].figure
    png, svg = (figure_bytes(figure, kind) for kind in ("png", "svg"))
    return Picture(png, svg, axes_of(figure))
