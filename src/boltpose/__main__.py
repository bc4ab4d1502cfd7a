"""`python -m boltpose` is `boltpose`."""

import sys

from boltpose.cli.app import main

if __name__ == "__main__":
    sys.exit(main())
