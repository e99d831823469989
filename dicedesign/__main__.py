"""`python -m dicedesign`."""

import sys

from dicedesign.cli.main import main

sys.exit(main())
