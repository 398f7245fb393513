"""``python -m refsim`` is the command ``refsim``."""

import sys

from refsim.cli import main

if __name__ == "__main__":
    sys.exit(main())
