"""The look of all figures: sizes, fonts, lines, colours."""

from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib import font_manager

MILLIMETRE = 1 / 25.4
"""One millimetre in inches, the unit of matplotlib's figure sizes."""

SINGLE = 89.0
"""Width of one journal column [mm]."""
DOUBLE = 183.0
"""Width of two journal columns [mm]."""

DPI = 300
"""Resolution of bitmaps and of bitmap parts of vector files [1/inch]."""

# Palette of M. Okabe and K. Ito, told apart with any colour vision.
BLACK = "#000000"
ORANGE = "#E69F00"
SKY_BLUE = "#56B4E9"
GREEN = "#009E73"
YELLOW = "#F0E442"
BLUE = "#0072B2"
VERMILION = "#D55E00"
PURPLE = "#CC79A7"

GREY = "#6E6E6E"
"""What is published, and helping lines."""
PALE = "#D0D0D0"
"""Points without value."""
SILVER = "#D8D8D8"
"""What is usual and should not draw the eye."""
NAVY = "#003F6B"

RIGID = BLUE
FLEXIBLE = VERMILION

SEQUENTIAL = "viridis"
"""Colour map for amplitudes: even steps in lightness, safe for colour-blind readers."""

MICROMETRE = 1e6
"""Micrometres in a metre."""

RC: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "mathtext.fontset": "dejavusans",
    "font.size": 7,
    "axes.labelsize": 7,
    "axes.titlesize": 7,
    "xtick.labelsize": 6,
    "ytick.labelsize": 6,
    "legend.fontsize": 6,
    "axes.linewidth": 0.5,
    "lines.linewidth": 0.9,
    "lines.markersize": 3,
    "hatch.linewidth": 0.3,
    "patch.linewidth": 0.5,
    "xtick.major.width": 0.5,
    "ytick.major.width": 0.5,
    "xtick.minor.width": 0.35,
    "ytick.minor.width": 0.35,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "xtick.minor.size": 1.5,
    "ytick.minor.size": 1.5,
    "xtick.direction": "out",
    "ytick.direction": "out",
    "legend.frameon": False,
    "legend.handlelength": 1.8,
    "axes.axisbelow": True,
    "figure.dpi": 100,
    "savefig.dpi": DPI,
    "pdf.fonttype": 42,
    "pdf.compression": 9,
    "image.cmap": SEQUENTIAL,
}


def apply() -> None:
    """Make the style and the drawing of files, not windows, the default of matplotlib."""
    mpl.use("Agg")
    mpl.rcdefaults()
    mpl.rcParams.update(RC)
    _own_fonts_first()


def _own_fonts_first() -> None:
    """Prefer the fonts that come with matplotlib.

    The list of fonts that matplotlib keeps in the user's cache can lack them, and a system font
    of the same name draws other bytes.
    """
    manager = font_manager.fontManager
    folder = Path(mpl.get_data_path()) / "fonts" / "ttf"
    listed = [entry for entry in manager.ttflist if Path(entry.fname).parent != folder]
    manager.ttflist.clear()
    for file in sorted(folder.glob("*.ttf")):
        manager.addfont(file)
    manager.ttflist.extend(listed)


def size(width: float, height: float) -> tuple[float, float]:
    """Turn a size in millimetres into the inches that matplotlib wants."""
    return width * MILLIMETRE, height * MILLIMETRE


def power_of_ten(value: float) -> str:
    """Write a positive number as a product with a power of ten, for matplotlib's math text."""
    mantissa, exponent = f"{value:.2e}".split("e")
    mantissa = mantissa.rstrip("0").rstrip(".")
    power = f"10^{{{int(exponent)}}}"
    return f"${power}$" if mantissa == "1" else rf"${mantissa}\times {power}$"
