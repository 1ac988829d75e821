"""Write the reference of this case from harmonic balance."""

from pathlib import Path

from solutions.hill import reference

reference(Path(__file__).parent)
