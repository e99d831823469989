"""The public names, listed here once; the package imports each on first use."""

from . import energies as energies
from . import extensions as extensions
from . import figures as figures
from . import methods as methods
from . import starts as starts
from .balance.balanced import balance_body as balance_body
from .balance.balanced import best_center as best_center
from .balance.goals import EqualProbabilities as EqualProbabilities
from .balance.goals import FewestRests as FewestRests
from .balance.goals import GivenProbabilities as GivenProbabilities
from .balance.goals import Standing as Standing
from .balance.options import BalanceOptions as BalanceOptions
from .errors import DegenerateBodyError as DegenerateBodyError
from .errors import DiceError as DiceError
from .errors import EngravingError as EngravingError
from .errors import InputError as InputError
from .errors import NoStartError as NoStartError
from .errors import OutputError as OutputError
from .geometry.meshes.body import Body as Body
from .geometry.meshes.body import make_body as make_body
from .geometry.meshes.manifold import weighted_body as weighted_body
from .geometry.meshes.reading import read_body as read_body
from .geometry.point_groups import point_group as point_group
from .gradient.differentiable_rest import differentiable_rest as differentiable_rest
from .gradient.differentiable_rest import (
    differentiable_rest_batch as differentiable_rest_batch,
)
from .gradient.height import height as height
from .gradient.rest_probabilities import RestEvaluation as RestEvaluation
from .gradient.rest_probabilities import evaluate_rests as evaluate_rests
from .optimize.targets import Target as Target
from .optimize.targets import binomial as binomial
from .optimize.targets import custom as custom
from .optimize.targets import fair as fair
from .optimize.targets import sum_of_dice as sum_of_dice
from .recipe.design_die import Die as Die
from .recipe.design_die import design as design
from .recipe.pipeline import Callbacks as Callbacks
from .recipe.pipeline import run as run
from .recipe.reading import parse_recipe as parse_recipe
from .recipe.reading import read_recipe as read_recipe
from .recipe.recipe import Recipe as Recipe
from .rest.density_priors import DensityFunction as DensityFunction
from .rest.density_priors import SphericalCap as SphericalCap
from .rest.density_priors import VonMisesFisher as VonMisesFisher
from .rest.poses import RestPoses as RestPoses
from .rest.poses import rest_poses as rest_poses
from .rest.prior import Prior as Prior
from .rest.prior import SampledDirections as SampledDirections
from .rest.roll import roll as roll
from .results.folder import read_result as read_result
from .results.parts import Status as Status
from .results.result import Result as Result
from .results.result import Step as Step
from .throws.momentum_probabilities import throw_probabilities as throw_probabilities
from .throws.rigid_body import rigid_body as rigid_body
from .throws.simulation import Throws as Throws
from .throws.simulation import simulate as simulate
from .throws.tables import Table as Table
from .throws.tables import load_table as load_table
from .throws.tables import mixture_tables as mixture_tables

__version__: str
