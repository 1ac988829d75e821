"""A thin strip that tells the class of the motion at each speed."""

from collections.abc import Mapping

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import ArrayLike, NDArray

from spurflex_postproc import style
from spurflex_postproc.figures.scale import edges
from spurflex_postproc.flags import LARGEST_PERIOD, LONG_PERIOD, NO_VALUE, Motion
from spurflex_postproc.published import published_regimes

LONGER_PERIODS = (*range(4, LARGEST_PERIOD + 1), *range(LONG_PERIOD, 2 * LONG_PERIOD))
"""Flags of the periods that share a class."""

CLASSES: tuple[tuple[str, str, tuple[int, ...]], ...] = (
    ("1T", style.SILVER, (1,)),
    ("2T", style.SKY_BLUE, (2,)),
    ("3T", style.NAVY, (3,)),
    ("4T and more", style.GREEN, LONGER_PERIODS),
    ("quasi-periodic", style.ORANGE, (Motion.QUASI_PERIODIC,)),
    ("chaotic", style.PURPLE, (Motion.CHAOTIC,)),
    ("unresolved", style.BLACK, (Motion.UNRESOLVED,)),
    ("no value", "white", (NO_VALUE,)),
)
"""Name, colour and flags of each class. T is the mesh period."""

LINES = {"1T": style.GREY}
"""Colours of lines and dots where that of a class is too pale for them."""

HEIGHT = 0.7
"""Height of a row, as a fraction of the distance of the rows."""


def motion_class(motion: ArrayLike) -> NDArray[np.int64]:
    """Return the position in `CLASSES` of each motion flag.

    Args:
        motion: Motion flags, any shape.

    Returns:
        Positions, same shape; a flag that is not known counts as unresolved.
    """
    flags = np.asarray(motion)
    unresolved = [name for name, _, _ in CLASSES].index("unresolved")
    found = np.full(flags.shape, unresolved, dtype=np.int64)
    for at, (_, _, members) in enumerate(CLASSES):
        found[np.isin(flags, members)] = at
    return found


def line_colour(flag: int) -> str:
    """Return the colour of a line or a dot for a motion flag."""
    name, colour, _ = CLASSES[int(motion_class(flag))]
    return LINES.get(name, colour)


def line_legend(flags: ArrayLike) -> list[Artist]:
    """Return legend entries for the classes that occur among motion flags."""
    names = [(CLASSES[at][0], CLASSES[at][1]) for at in np.unique(motion_class(flags))]
    return [
        Line2D([], [], color=LINES.get(name, colour), lw=1.5, label=name)
        for name, colour in names
        if name != "no value"
    ]


def published_motion(support: str, speed: ArrayLike) -> NDArray[np.int64]:
    """Return the published motion as flags.

    Args:
        support: 'rigid' or 'flexible'.
        speed: Rotating speeds [rev/min], shape (n,).

    Returns:
        The flags, `NO_VALUE` outside the published range, shape (n,).
    """
    x = np.asarray(speed, dtype=float)
    flags = np.full(x.shape, NO_VALUE, dtype=np.int64)
    for at, (name, first, last) in enumerate(published_regimes(support)):
        flag = int(Motion.CHAOTIC) if name == "chaotic" else int(name[:-1])
        flags[(x > first) & (x <= last) | (x == first) & (at == 0)] = flag
    return flags


def draw_motion(axes: Axes, speed: ArrayLike, rows: Mapping[str, ArrayLike]) -> None:
    """Draw a coloured row for each support, and a legend of the classes that occur.

    Args:
        axes: Where to; its speed axis is shared with the curves.
        speed: Rotating speeds [rev/min], shape (n,).
        rows: Name of each row and its motion flags, shape (n,), from top to bottom.
    """
    x = np.asarray(speed, dtype=float)
    borders = edges(x) if len(x) > 1 else np.array([x[0] - 0.5, x[0] + 0.5])
    colours = ListedColormap([colour for _, colour, _ in CLASSES])
    seen: set[int] = set()
    for at, (name, motion) in enumerate(rows.items()):
        found = motion_class(motion)
        seen.update(found.tolist())
        axes.pcolormesh(
            borders,
            [-at - HEIGHT / 2, -at + HEIGHT / 2],
            found[np.newaxis, :],
            cmap=colours,
            vmin=-0.5,
            vmax=len(CLASSES) - 0.5,
            rasterized=True,
            gid=name,
        )
    axes.set_yticks(-np.arange(len(rows)), list(rows))
    axes.set_ylim(0.5 - len(rows), 0.5)
    axes.tick_params(axis="both", which="both", length=0, labelbottom=False)
    axes.spines[:].set_visible(False)
    handles: list[Artist] = [
        Patch(facecolor=colour, edgecolor=style.GREY, linewidth=0.3, label=name)
        for at, (name, colour, _) in enumerate(CLASSES)
        if at in seen
    ]
    handles.append(Line2D([], [], ls="none", label="T: mesh period"))
    axes.legend(
        handles=handles,
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncol=len(CLASSES) + 1,
        borderaxespad=0.2,
        borderpad=0,
        handlelength=1.2,
        columnspacing=1.2,
    )
