"""The quantities that a run can record, and how figures write them."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Quantity:
    """One recorded quantity.

    Attributes:
        name: Its name in decks and result files.
        symbol: Mathematical symbol, without dollar signs.
        unit: Unit in the file.
        shown: Unit in figures.
        factor: What turns a value of the file into the unit of figures.
        rate_shown: Unit of the rate in figures.
        rate_factor: What turns a rate of the file into that unit.
    """

    name: str
    symbol: str
    unit: str
    shown: str
    factor: float
    rate_shown: str
    rate_factor: float

    @property
    def label(self) -> str:
        """Label of an axis with the value."""
        return f"${self.symbol}$ ({self.shown})"

    @property
    def rate_label(self) -> str:
        """Label of an axis with the rate."""
        return f"d${self.symbol}$/d$t$ ({self.rate_shown})"

    @property
    def amplitude_label(self) -> str:
        """Label of an axis with the lines of a spectrum."""
        return f"amplitude of ${self.symbol}$ ({self.shown})"


_LENGTH = ("m", "µm", 1e6, "mm/s", 1e3)
_ANGLE = ("rad", "µrad", 1e6, "mrad/s", 1e3)
_FORCE = ("N", "kN", 1e-3, "MN/s", 1e-6)

QUANTITIES: dict[str, Quantity] = {
    name: Quantity(name, symbol, *kind)
    for name, symbol, kind in (
        ("x1", "x_1", _LENGTH),
        ("y1", "y_1", _LENGTH),
        ("theta1", r"\theta_1", _ANGLE),
        ("x2", "x_2", _LENGTH),
        ("y2", "y_2", _LENGTH),
        ("theta2", r"\theta_2", _ANGLE),
        ("xm", r"x_\mathrm{M}", _LENGTH),
        ("ym", r"y_\mathrm{M}", _LENGTH),
        ("thetam", r"\theta_\mathrm{M}", _ANGLE),
        ("mesh_deflection", r"\delta", _LENGTH),
        ("mesh_force", r"F_\mathrm{m}", _FORCE),
        ("bearing1_deformation", r"\delta_{\mathrm{b}1}", _LENGTH),
        ("bearing2_deformation", r"\delta_{\mathrm{b}2}", _LENGTH),
    )
}
