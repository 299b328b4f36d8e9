"""``python -m fogwatch``: the command."""

import sys

from fogwatch.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
