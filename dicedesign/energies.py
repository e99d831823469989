"""Energy of the paper's method: its terms, their weights and their state."""

from dicedesign.optimize.clusters import ClusteredRests as ClusteredRests
from dicedesign.optimize.clusters import Clusters as Clusters
from dicedesign.optimize.clusters import cluster as cluster
from dicedesign.optimize.energy import Energy as Energy
from dicedesign.optimize.energy import energy_terms as energy_terms
from dicedesign.optimize.preferences import Preferences as Preferences
from dicedesign.optimize.terms import EnergyWeights as EnergyWeights
