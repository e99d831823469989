"""Classes that declare extensions, and their registries."""

from dicedesign.fabricate.printers import PRINTERS as PRINTERS
from dicedesign.fabricate.printers import Printer as Printer
from dicedesign.optimize.preferences import PREFERENCES as PREFERENCES
from dicedesign.optimize.preferences import OutcomeFacets as OutcomeFacets
from dicedesign.optimize.preferences import Preference as Preference
from dicedesign.optimize.starts.start import STARTS as STARTS
from dicedesign.optimize.starts.start import StartKind as StartKind
from dicedesign.optimize.starts.start import Task as Task
from dicedesign.optimize.terms import TERMS as TERMS
from dicedesign.optimize.terms import Term as Term
from dicedesign.optimize.terms import TermOption as TermOption
from dicedesign.recipe.pipeline import STAGES as STAGES
from dicedesign.recipe.pipeline import Stage as Stage
from dicedesign.recipe.pipeline import Work as Work
from dicedesign.report.figures import BODY_FIGURES as BODY_FIGURES
from dicedesign.report.figures import FIGURES as FIGURES
from dicedesign.report.figures import BodyFigure as BodyFigure
from dicedesign.report.figures import Figure as Figure
from dicedesign.rest.prior import PRIORS as PRIORS
from dicedesign.rest.prior import PriorKind as PriorKind
from dicedesign.runtime.registry import Extension as Extension
from dicedesign.throws.engines import ENGINES as ENGINES
from dicedesign.throws.engines import Engine as Engine
