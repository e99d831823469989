"""The public names, listed here once; the package imports each on first use."""

from dicedesign.design.targets import Target as Target
from dicedesign.errors import DegenerateBodyError as DegenerateBodyError
from dicedesign.errors import DiceError as DiceError
from dicedesign.errors import EngravingError as EngravingError
from dicedesign.errors import InputError as InputError
from dicedesign.errors import LabelRoomError as LabelRoomError
from dicedesign.errors import MeshFileError as MeshFileError
from dicedesign.errors import NoStartError as NoStartError
from dicedesign.errors import OutputError as OutputError
from dicedesign.errors import OutsideHullError as OutsideHullError
from dicedesign.errors import RecipeError as RecipeError
from dicedesign.geometry.meshes.body import Body as Body
from dicedesign.geometry.meshes.reading import read_body as read_body
from dicedesign.gradient.differentiable_rest import differentiable_rest as differentiable_rest
from dicedesign.recipe.design_die import Die as Die
from dicedesign.recipe.design_die import design as design
from dicedesign.recipe.run import run as run
from dicedesign.recipe.schema.reading import read_recipe as read_recipe
from dicedesign.recipe.schema.recipe import Recipe as Recipe
from dicedesign.rest.poses import RestPoses as RestPoses
from dicedesign.rest.poses import rest_poses as rest_poses
from dicedesign.rest.roll import RollStep as RollStep
from dicedesign.rest.roll import roll as roll
from dicedesign.results.reading import read_result as read_result
from dicedesign.results.record import Result as Result
from dicedesign.results.record import Step as Step
from dicedesign.throws.momentum.momentum_odds import thrown_odds as thrown_odds
from dicedesign.throws.rigid_body import RigidBody as RigidBody
from dicedesign.throws.rigid_body import rigid_body as rigid_body
from dicedesign.throws.simulation.simulation import Throws as Throws
from dicedesign.throws.simulation.simulation import simulate as simulate
from dicedesign.throws.tables import Table as Table
from dicedesign.throws.tables import table_named as table_named

__version__: str
