"""The energy of the paper's method: its terms, weights and what they see."""

from dicedesign.optimize.energy.clusters import ClusteredRests as ClusteredRests
from dicedesign.optimize.energy.clusters import Clusters as Clusters
from dicedesign.optimize.energy.clusters import cluster as cluster
from dicedesign.optimize.energy.energy import Energy as Energy
from dicedesign.optimize.energy.energy import energy_terms as energy_terms
from dicedesign.optimize.energy.term import EnergyWeights as EnergyWeights
from dicedesign.optimize.preferences.preference import Preferences as Preferences
