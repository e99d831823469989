"""Starting shapes."""

from dicedesign.optimize.starts.shapes import hendecahedron as hendecahedron
from dicedesign.optimize.starts.shapes import mesh_start as mesh_start
from dicedesign.optimize.starts.shapes import prism as prism
from dicedesign.optimize.starts.shapes import repulsion as repulsion
from dicedesign.optimize.starts.start import Start as Start
from dicedesign.optimize.starts.start import normalize_start as normalize_start
