"""Write the reference of this case from the exact solution."""

from pathlib import Path

from solutions.kahraman_singh import reference

reference(Path(__file__).parent)
