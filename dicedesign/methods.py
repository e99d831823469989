"""Solvers with their options and coordinates."""

from dicedesign.optimize.coordinates import FacetCoordinates as FacetCoordinates
from dicedesign.optimize.coordinates import SymmetricCoordinates as SymmetricCoordinates
from dicedesign.optimize.coordinates import VertexCoordinates as VertexCoordinates
from dicedesign.optimize.options import ExactOptions as ExactOptions
from dicedesign.optimize.options import PaperOptions as PaperOptions
from dicedesign.optimize.options import PaperWeights as PaperWeights
from dicedesign.optimize.options import RefineOptions as RefineOptions
from dicedesign.optimize.options import SobolevOptions as SobolevOptions
from dicedesign.optimize.solvers.exact import solve_exact as solve_exact
from dicedesign.optimize.solvers.paper import solve_paper as solve_paper
