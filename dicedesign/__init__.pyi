"""The public names, listed here once; the package imports each on first use."""

from dicedesign import energies as energies
from dicedesign import extensions as extensions
from dicedesign import methods as methods
from dicedesign import starts as starts
from dicedesign.balance.balanced import balance_body as balance_body
from dicedesign.balance.best_center import best_center as best_center
from dicedesign.balance.goals import EqualProbabilities as EqualProbabilities
from dicedesign.balance.goals import FewestRests as FewestRests
from dicedesign.balance.goals import GivenProbabilities as GivenProbabilities
from dicedesign.balance.goals import Standing as Standing
from dicedesign.balance.options import BalanceOptions as BalanceOptions
from dicedesign.errors import DegenerateBodyError as DegenerateBodyError
from dicedesign.errors import DiceError as DiceError
from dicedesign.errors import EngravingError as EngravingError
from dicedesign.errors import InputError as InputError
from dicedesign.errors import NoStartError as NoStartError
from dicedesign.errors import OutputError as OutputError
from dicedesign.geometry.meshes.body import Body as Body
from dicedesign.geometry.meshes.body import make_body as make_body
from dicedesign.geometry.meshes.manifold import weighted_body as weighted_body
from dicedesign.geometry.meshes.reading import read_body as read_body
from dicedesign.geometry.point_groups import point_group as point_group
from dicedesign.gradient.differentiable_rest import differentiable_rest as differentiable_rest
from dicedesign.gradient.differentiable_rest import (
    differentiable_rest_batch as differentiable_rest_batch,
)
from dicedesign.gradient.height import height as height
from dicedesign.gradient.rest_probabilities import RestEvaluation as RestEvaluation
from dicedesign.gradient.rest_probabilities import evaluate_rests as evaluate_rests
from dicedesign.optimize.targets import Target as Target
from dicedesign.optimize.targets import binomial as binomial
from dicedesign.optimize.targets import custom as custom
from dicedesign.optimize.targets import fair as fair
from dicedesign.optimize.targets import sum_of_dice as sum_of_dice
from dicedesign.recipe.design_die import Die as Die
from dicedesign.recipe.design_die import design as design
from dicedesign.recipe.pipeline import Callbacks as Callbacks
from dicedesign.recipe.pipeline import run as run
from dicedesign.recipe.reading import parse_recipe as parse_recipe
from dicedesign.recipe.reading import read_recipe as read_recipe
from dicedesign.recipe.recipe import Recipe as Recipe
from dicedesign.rest.density_priors import DensityFunction as DensityFunction
from dicedesign.rest.density_priors import SphericalCap as SphericalCap
from dicedesign.rest.density_priors import VonMisesFisher as VonMisesFisher
from dicedesign.rest.poses import RestPoses as RestPoses
from dicedesign.rest.poses import rest_poses as rest_poses
from dicedesign.rest.prior import Prior as Prior
from dicedesign.rest.prior import SampledDirections as SampledDirections
from dicedesign.rest.roll import roll as roll
from dicedesign.results.folder import read_result as read_result
from dicedesign.results.parts import Status as Status
from dicedesign.results.result import Result as Result
from dicedesign.results.result import Step as Step
from dicedesign.throws.momentum_probabilities import throw_probabilities as throw_probabilities
from dicedesign.throws.rigid_body import rigid_body as rigid_body
from dicedesign.throws.simulation import Throws as Throws
from dicedesign.throws.simulation import simulate as simulate
from dicedesign.throws.tables import Table as Table
from dicedesign.throws.tables import load_table as load_table
from dicedesign.throws.tables import mixture_tables as mixture_tables

__version__: str
