"""Lets ``python -m spurflex_postproc`` stand for ``spurflex-figures``."""

import sys

from spurflex_postproc.cli import main

if __name__ == "__main__":
    sys.exit(main())
