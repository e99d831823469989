"""Figures for papers. Each function returns a figure of matplotlib, 3.3 inches wide if not given,
whose `savefig` writes PDF, SVG or PNG with text of 7 and 8 points.

They take a `Result`, `RestPoses`, arrays, or the `finished` data of a designed `Die`.
"""

from dicedesign.report.bar_charts import Bars as Bars
from dicedesign.report.bar_charts import outcome_chart as outcome_chart
from dicedesign.report.bar_charts import probabilities as probabilities
from dicedesign.report.bar_charts import reshaped_probabilities as reshaped_probabilities
from dicedesign.report.bar_charts import roll_frequencies as roll_frequencies
from dicedesign.report.bar_charts import table_probabilities as table_probabilities
from dicedesign.report.curve_charts import hands as hands
from dicedesign.report.curve_charts import history as history
from dicedesign.report.curve_charts import rounds as rounds
from dicedesign.report.curve_charts import trade_off as trade_off
from dicedesign.report.gauss_map import gauss_map as gauss_map
from dicedesign.report.gauss_map import heights as heights
from dicedesign.report.gauss_map import paths as paths
from dicedesign.report.motion_pictures import drop as drop
from dicedesign.report.renderer import RenderMesh as RenderMesh
from dicedesign.report.solid_figures import candidates as candidates
from dicedesign.report.solid_figures import faces as faces
from dicedesign.report.solid_figures import print_orientation as print_orientation
from dicedesign.report.solid_figures import reading as reading
from dicedesign.report.solid_figures import views as views
from dicedesign.report.surface_figures import balance as balance
from dicedesign.report.surface_figures import before_after as before_after
from dicedesign.report.surface_figures import crossings as crossings
from dicedesign.report.surface_figures import displacement as displacement
from dicedesign.report.surface_figures import hull as hull
from dicedesign.report.surface_figures import repair as repair
from dicedesign.report.surface_figures import reshaped as reshaped
from dicedesign.report.surface_figures import rests as rests
