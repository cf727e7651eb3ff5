"""Run the command line: ``bemt``."""

import sys

from bemt.commands.cli import main

if __name__ == "__main__":
    sys.exit(main())
