"""`python -m dicedesign`."""

import sys

from dicedesign.cli import main

sys.exit(main())
