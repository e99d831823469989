"""Starting shapes."""

from dicedesign.optimize.starts.built_in import hendecahedron as hendecahedron
from dicedesign.optimize.starts.built_in import mesh_start as mesh_start
from dicedesign.optimize.starts.built_in import prism as prism
from dicedesign.optimize.starts.half_space_odds import repulsion as repulsion
from dicedesign.optimize.starts.start import Start as Start
from dicedesign.optimize.starts.start import normalised_start as normalised_start
