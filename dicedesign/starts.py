"""Starting shapes."""

from dicedesign.optimize.starts.kinds.hendecahedron import hendecahedron as hendecahedron
from dicedesign.optimize.starts.kinds.mesh import mesh_start as mesh_start
from dicedesign.optimize.starts.kinds.prism import prism as prism
from dicedesign.optimize.starts.repulsion import repulsion as repulsion
from dicedesign.optimize.starts.start import Start as Start
from dicedesign.optimize.starts.start import normalised_start as normalised_start
