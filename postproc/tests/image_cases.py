"""The pictures whose layout is compared with stored ones, and how they are compared.

To store them anew after a wanted change: `python tests/image_cases.py`; look at them before.
"""

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib as mpl
import numpy as np
from matplotlib import image
from matplotlib.figure import Figure
from numpy.typing import NDArray
from result_files import write_motions, write_result

from spurflex_postproc import open_result, style
from spurflex_postproc.figures import FIGURES, Options

FOLDER = Path(__file__).parent / "images"
"""Where the stored pictures are."""
DRAWN_WITH = FOLDER / "drawn-with.txt"
"""Tells the version of matplotlib that drew them."""
DPI = 75
"""Small, so that the stored pictures are: panels, legends and colours still show."""


@dataclass(frozen=True)
class Comparison:
    """How exactly two pictures are compared: by the means of blocks of pixels.

    Attributes:
        block: Side of a block [pixels].
        tolerance: Largest rms difference of the means, as a fraction of black to white.
    """

    block: int
    tolerance: float


STRICT = Comparison(6, 0.02)
"""For the same series of matplotlib: allows for other edges of letters (0.013 at most when all are
blurred by a pixel), not for a panel out of place (0.03) or an absent title (0.025)."""
LOOSE = Comparison(36, 0.022)
"""For other series, whose letters are set wider or narrower and move panels by a few pixels
(matplotlib 3.7 against 3.11: 0.018)."""

Pixels = NDArray[np.float64]


def figure_10(folder: Path) -> Figure:
    """A map whose eta changes its sign with the speed."""
    path = write_result(
        folder / "figure9.h5", np.linspace(300.0, 6000.0, 96), np.logspace(3, 12, 31)
    )
    result = open_result(path)
    stripes = np.where(result["speed"].values // 900 % 2, -10.0, 10.0)
    soft = result["support_stiffness"].values < 1e11
    result["eta1"].values[...] = np.outer(soft, stripes)
    return FIGURES["10"].draw(result, Options())[0].figure


def figure_3(folder: Path) -> Figure:
    """Waterfalls and bifurcation diagrams of made-up motions."""
    result = open_result(write_motions(folder / "figure3.h5"))
    return FIGURES["3"].draw(result, Options())[0].figure


def figure_6(folder: Path) -> Figure:
    """The four panels of one motion."""
    result = open_result(write_motions(folder / "figure6.h5"))
    return FIGURES["6"].draw(result, Options(speed=5100.0))[0].figure


CASES = {"figure3": figure_3, "figure6": figure_6, "figure10": figure_10}
"""Name of the stored picture, and what draws it from files in a folder."""


def write(name: str, path: Path) -> Path:
    """Draw one case into a small PNG file."""
    style.apply()
    with TemporaryDirectory() as folder:
        CASES[name](Path(folder)).savefig(path, dpi=DPI, metadata={"Software": None})
    return path


def pixels(path: Path) -> Pixels:
    """Read a PNG file as red, green and blue from 0 to 1, shape (rows, columns, 3)."""
    return np.asarray(image.imread(path), dtype=float)[:, :, :3]


def comparison() -> Comparison:
    """Return how pictures of this matplotlib are compared with the stored ones."""
    stored = DRAWN_WITH.read_text("utf-8").split(".")[:2]
    return STRICT if mpl.__version__.split(".")[:2] == stored else LOOSE


def difference(one: Pixels, other: Pixels, block: int) -> float:
    """Return the rms difference of the means of blocks; infinite if the sizes differ."""
    if one.shape != other.shape:
        return float("inf")
    rows, columns = (length // block for length in one.shape[:2])
    off = (one - other)[: rows * block, : columns * block]
    means = off.reshape(rows, block, columns, block, 3).mean(axis=(1, 3))
    return float(np.sqrt(np.mean(means**2)))


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for case in CASES:
        print(write(case, FOLDER / f"{case}.png"))
    DRAWN_WITH.write_text(f"{mpl.__version__}\n", "utf-8")
