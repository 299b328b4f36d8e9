"""``python -m fogwatch``: the command."""

import sys

from fogwatch.cli.app import main

if __name__ == "__main__":
    sys.exit(main())
