"""What people look at: charts, rendered views, figures and pages."""

import logging

# Where nothing can be written at home, matplotlib says so whenever it is imported.
logging.getLogger("matplotlib").setLevel(logging.ERROR)
