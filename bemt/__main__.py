"""Run the command line: ``bemt``."""

import sys

from bemt.app.cli import main

if __name__ == "__main__":
    sys.exit(main())
