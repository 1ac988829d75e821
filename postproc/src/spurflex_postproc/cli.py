"""The command `spurflex-figures`."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from spurflex_postproc import __version__, style
from spurflex_postproc.figures import FIGURES, Options
from spurflex_postproc.layout import ResultError
from spurflex_postproc.output import save
from spurflex_postproc.published import PAPER_STIFFNESS
from spurflex_postproc.quantities import QUANTITIES
from spurflex_postproc.reading import coverage, open_result, require

COMPLETE, FAILED, UNUSABLE = 0, 1, 2


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw one figure from one result file.

    Args:
        arguments: Command line without the program's name; `sys.argv` if absent.

    Returns:
        0 if the files were written, 1 if they could not be written, 2 if the result file
        cannot be used. (argparse itself leaves with 2 on wrong usage.)
    """
    parser = _parser()
    chosen = parser.parse_args(arguments)
    if chosen.list:
        for number, entry in FIGURES.items():
            print(f"{number:>3}  {entry.title}")
        return COMPLETE
    if chosen.figure is None or not chosen.result:
        parser.error("name a figure and a result file, or --list")
    if len(chosen.result) > 1 and not FIGURES[chosen.figure].several:
        parser.error(f"figure {chosen.figure} is drawn from one result file")
    options = Options(
        stiffness=chosen.stiffness,
        mesh_axis=chosen.mesh_axis,
        speed=chosen.speed,
        quantity=chosen.quantity,
        rigid=chosen.rigid,
        log=chosen.log,
    )
    try:
        _draw(chosen.figure, chosen.result, chosen.output, options)
    except ResultError as error:
        print(f"spurflex-figures: {error}", file=sys.stderr)
        return UNUSABLE
    except OSError as error:
        print(f"spurflex-figures: cannot write: {error}", file=sys.stderr)
        return FAILED
    except KeyboardInterrupt:
        print("spurflex-figures: interrupted", file=sys.stderr)
        return 130
    return COMPLETE


def _draw(number: str, paths: Sequence[Path], folder: Path, options: Options) -> None:
    """Read, draw, write and report."""
    entry = FIGURES[number]
    results = [open_result(path) for path in paths]
    style.apply()
    for result, path in zip(results, paths, strict=True):
        require(result, entry.needs)
        for support, name in (("flexible", "status"), ("rigid", "rigid_status")):
            if name in (entry.needs or result):
                print(f"{path}, {support} support: {coverage(result, support)}")
    for drawing in entry.draw(results if entry.several else results[0], options):
        if drawing.report:
            print(drawing.report)
        for file in save(drawing.figure, folder, drawing.name):
            print(f"wrote {file}")


def _parser() -> argparse.ArgumentParser:
    """Describe the command line."""
    parser = argparse.ArgumentParser(
        prog="spurflex-figures", description="Draw a figure from a spurflex result file."
    )
    parser.add_argument("figure", nargs="?", choices=list(FIGURES), help="name of the figure")
    parser.add_argument(
        "result", nargs="*", type=Path, help="result file (HDF5); several for figure 'starts'"
    )
    parser.add_argument(
        "--output", type=Path, default=Path(), metavar="FOLDER", help="where to (default: here)"
    )
    parser.add_argument(
        "--stiffness",
        type=_positive,
        default=PAPER_STIFFNESS,
        metavar="N/M",
        help="take the row nearest to this support stiffness (default: %(default)g)",
    )
    parser.add_argument(
        "--speed",
        type=_positive,
        metavar="REV/MIN",
        help="figures 4 to 8, point: take the point nearest to this speed",
    )
    parser.add_argument(
        "--quantity",
        choices=list(QUANTITIES),
        default="y1",
        metavar="NAME",
        help=f"what was recorded: {', '.join(QUANTITIES)} (default: %(default)s)",
    )
    parser.add_argument(
        "--rigid", action="store_true", help="figures 4 to 8, point: the rigid support"
    )
    parser.add_argument(
        "--log", action="store_true", help="figures 4 to 8, point: logarithmic spectrum"
    )
    parser.add_argument(
        "--mesh-axis", action="store_true", help="figure 2: mesh frequency as a second axis"
    )
    parser.add_argument("--list", action="store_true", help="list the figures and stop")
    parser.add_argument("--version", action="version", version=f"%(prog)s {__version__}")
    return parser


def _positive(text: str) -> float:
    """Read a positive finite number."""
    value = float(text)
    if not 0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text} is not a positive number")
    return value
