"""Refused commands end with exit code 2, one line of error, and no files."""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Callable
from pathlib import Path

import pytest
import trimesh
import yaml
from common.dented_cube import write_cube

from dicedesign.cli.main import COMMANDS as COMMAND_LINE
from dicedesign.cli.main import main, make_parser

RECIPE = "name: good\ntarget: {fair: 4}\nstart: {repulsion: {}}\n"

CONCAVE = "name: c\ntarget: {fair: 6}\nstart: {mesh: {path: dented.obj}}\nmethod: concave\n"

PAPER = "name: few\ntarget: {binomial: 2}\nstart: {prism: {}}\nmethod: {paper: {steps: 30}}\n"

LINK = "<robot><link name='a'><visual><geometry>{}</geometry></visual></link></robot>"

MJCF = "<mujoco><worldbody><body name='a'><geom {}/></body></worldbody></mujoco>"

SVG = '<svg xmlns="http://www.w3.org/2000/svg">{}</svg>'

FILES = {
    "empty.obj": "",
    "flat.xyz": "0 0 0\n1 0 0\n0 1 0\n1 1 0\n2 3 0\n",
    "line.xyz": "0 0 0\n1 0 0\n2 0 0\n3 0 0\n",
    "few.xyz": "0 0 0\n1 0 0\n0 1 0\n",
    "nan.xyz": "0 0 0\n1 0 0\n0 1 0\n0 0 1\nnan 0 0\n",
    "cloud.xyz": "0 0 0\n1 0 0\n0 1 0\n0 0 1\n",
    "open.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\n",
    "short.csv": "0,0,1\n1,2\n",
    "words.csv": "0,0,1\na,b,c\n",
    "zeros.csv": "0,0,1\n0,0,0\n",
    "names.csv": "0,zero,1\n0,0,1\n",
    "plain": "1 2 3\n",
    "good.yaml": RECIPE,
    "die.yaml": "name: die\ntarget: {fair: 4}\nsymmetry: none\nmethod: {exact: {prefer: {}}}\n",
    "bad.yaml": RECIPE + "color: red\n",
    "concave.yaml": CONCAVE,
    "few.yaml": PAPER,
    "refined.yaml": RECIPE + "method: {exact: {probabilities: thrown, refine: {}}}\n",
    "lost.yaml": RECIPE.replace("repulsion: {}", "mesh: {path: gone.stl}"),
    "counts.csv": "label,count\n1,3\n",
    "entity.urdf": '<!DOCTYPE r [<!ENTITY a "b">]><robot>&a;</robot>',
    "svg.xml": "<svg/>",
    "bare.urdf": '<robot><link name="a"/></robot>',
    "gone.urdf": LINK.format("<mesh filename='gone.stl'/>"),
    "cone.urdf": LINK.format("<cone/>"),
    "flat.urdf": LINK.format("<box size='1 0 1'/>"),
    "short.urdf": LINK.format("<box size='1 1'/>"),
    "loop.xml": '<mujoco><include file="loop.xml"/></mujoco>',
    "class.xml": MJCF.format("class='none'"),
    "asset.xml": MJCF.format("type='mesh' mesh='none'"),
    "turn.xml": MJCF.format("size='1' quat='0 0 0 0'"),
    "axis.xml": MJCF.format("size='1' axisangle='0 0 0 1'"),
    "copies.xml": MJCF.format("/><replicate count='2'"),
    "light.xml": MJCF.format("size='1' mass='-1'"),
    "unknown.csv": "file,density\nothers.stl,1\n",
    "twice.csv": "file,density\nbox.stl,1\nbox.stl,1\n",
    "part.csv": "file,x,y,z\nbox.stl,1,,2\n",
    "minus.csv": "file,density\nbox.stl,-1\n",
    "names_of.csv": "name,density\nbox.stl,1\n",
    "other.csv": "label,count\n7,3\n",
    "rubbish/bad.stl": "rubbish",
    "half/result.json": "{",
    "broken.otf": "OTTO no font",
    "blank.svg": SVG.format(""),
    "script.svg": SVG.format("<script>1</script><circle r='1'/>"),
    "text.svg": SVG.format("<text>3</text>"),
    "broken.svg": "<svg><circle",
}

COMMANDS = {
    "rest entity.urdf": "entity.urdf: expected XML without document type and entities",
    "rest svg.xml": "svg.xml: expected robot (URDF) or mujoco (MJCF) as root element, got 'svg'",
    "rest plain.urdf": "plain.urdf: no such file",
    "rest bare.urdf": "bare.urdf: expected a link with shapes",
    "rest gone.urdf": "gone.urdf: link a: gone.stl: no such file",
    "rest cone.urdf": "cone.urdf: link a: geometry: expected mesh, box, cylinder",
    "rest flat.urdf": "link a: box: expected sizes above 0",
    "rest short.urdf": "link a: size: expected 3 numbers, got '1 1'",
    "rest loop.xml": "loop.xml: include: expected at most 100",
    "rest class.xml": "class.xml: class: expected a default class, got 'none'",
    "rest asset.xml": "asset.xml: link a: mesh: expected an asset, got 'none'",
    "rest turn.xml": "turn.xml: link a: orientation: expected a rotation",
    "rest axis.xml": "axis.xml: link a: orientation: expected a rotation",
    "rest copies.xml": "copies.xml: replicate: expected bodies written out",
    "rest light.xml": "light.xml: link a: ",
    "rest box.stl --density 0": "--density: expected g/cm3 above 0",
    "rest box.stl --masses unknown.csv": "unknown.csv: expected files that are analyzed",
    "rest box.stl --masses twice.csv": "twice.csv: expected columns file and x,y,z or density",
    "rest box.stl --masses part.csv": "part.csv: expected columns file and x,y,z or density",
    "rest box.stl --masses minus.csv": "minus.csv: expected columns file and x,y,z or density",
    "rest box.stl --masses names_of.csv": "names_of.csv: expected columns file and x,y,z or",
    "rest box.stl --out a.csv --figure a.png": "--figure: expected one mesh, got --out a.csv",
    "pose box.stl --facet 6 --out out.stl": "choose a --facet from 0 to 5",
    "pose box.stl --facet -1 --out out.stl": "choose a --facet from 0 to 5",
    "balance sheet.stl --equal 2 --out new": "sheet.stl",
    "rest missing.obj": "missing.obj: no such file",
    "rest empty.obj": "empty.obj",
    "rest flat.xyz": "one plane",
    "rest line.xyz": "one line",
    "rest few.xyz": "at least 4",
    "rest nan.xyz": "finite",
    "rest garbage.stl": "garbage.stl",
    "rest box.stl --com 5,0,0": "outside",
    "rest box.stl --com 0.5,0,0": "on the boundary",
    "rest box.stl --com 1,2": "--com: expected 3 numbers",
    "rest box.stl --figure no/such/folder.png": "folder",
    "rest box.stl --coplanar-tolerance -1": "--coplanar-tolerance: expected",
    "rest box.stl --table glass": "--table: table glass: expected board-game, hard-wood, carpet",
    "rest .": "--out: expected the path of a table that ends in .csv",
    "rest . --out t.xlsx": "--out: expected the path of a table that ends in .csv",
    "rest . --out t.csv --coplanar-tolerance nan": "expected a number in [0, 1), got nan",
    "rest . --out gone/t.csv": "gone/t.csv: expected to write a file in an existing",
    "rest . --out t.csv --json": "--json: expected one mesh, got the folder",
    "rest . --out other.csv": "other.csv: expected a table of an earlier run or no file, but",
    "rest . --table board-game --out a.csv": "--table: expected one mesh, got the folder",
    "rest . --prior half:0,0,1 --out a.csv": "--prior",
    "rest box.stl --prior vmf:0,0,0:1": "not all zero",
    "rest box.stl --prior half": "half:x,y,z",
    "rest box.stl --prior samples:": "samples:FILE.csv",
    "rest box.stl --prior samples:none.csv": "none.csv",
    "rest box.stl --prior half:0,0,1 --table paper": "--table",
    "rest box.stl --prior samples:short.csv": "in line 2",
    "rest box.stl --prior samples:words.csv": "in line 2",
    "rest box.stl --prior samples:zeros.csv": "zeros.csv",
    "rest box.stl --prior samples:names.csv": "in line 1",
    "drop box.stl --down 0,0,0": "down: expected",
    "drop box.stl --down up": "--down: expected 3 numbers",
    "drop box.stl --down 0,0,1 --max-angle-deg -1": "--max-angle-deg: expected at least 0.0057",
    "pose box.stl --out box.stl": "--out: expected another file than an input",
    "pose box.stl --out out.stl --pose 7": "at least 7 poses, got one of 6",
    "pose box.stl --out out.stl --pose 0": "--pose",
    "pose box.stl --out out.docx": "format that can be written",
    "pose box.stl --out out.stl --format obj": "--format",
    "pose box.stl --out out --random --seed -1": "--seed",
    "pose none.stl --out out.stl": "no such file",
    "pose cloud.xyz --out out.stl": "points alone",
    "pose box.stl --out missing/out.stl": "create the folder",
    "pose box.stl within/box.stl --out posed": "different names",
    "pose nothing --out posed": "folder with meshes",
    "pose box.stl --com 9,0,0 --out out.stl": "center of mass",
    "scatter within --out room.obj": "--out: expected a path that ends in",
    "scatter within --out room.glb --count 0": "--count",
    "scatter within --out room.glb --count 100000000": "--count",
    "scatter within --out room.glb --floor 0,5": "--floor",
    "scatter within --out room.glb --floor 5": "--floor: expected 2 numbers",
    "scatter within --out room.glb --size nan": "--size",
    "scatter within --out room.glb --size 1e300": "--size",
    "scatter within --out room.glb --floor 1e-300,1": "--floor",
    "scatter within --out room.glb --seed -1": "--seed",
    "scatter within --out missing/room.glb": "create the folder",
    "scatter nowhere --out room.glb": "nowhere",
    "scatter rubbish --out room.glb": "mesh that can be read, got 1",
    "figure pie box.stl": "kind of figure: expected heights, paths, complex, drop",
    "figure heights none.stl": "no such file",
    "figure heights box.stl --out box.jpg": "--out: expected a path that ends in .pdf, .svg or",
    "figure heights box.stl --out box.csv": "--out: expected a path that ends in .pdf, .svg or",
    "figure history box.stl --out a.txt": "expected a path that ends in .pdf, .svg, .png or .csv",
    "figure history box.stl": "folder written by `dicedesign run`",
    "figure complex box.stl --width 0": "--width: expected 2.5 to 20 inches",
    "rest box.stl --figure box.gif": "--figure: expected a path that ends in .pdf, .svg or .png",
    "figure heights box.stl --out missing/box.png": "create the folder",
    "figure heights box.stl --down 1,0,0": "--down: expected with paths or drop",
    "figure drop box.stl --down 0,0,0": "down: expected three finite numbers",
    "figure before_after box.stl": "--before",
    "figure complex .": "recipe.yaml",
    "figure complex few.yaml --com hull": "--com",
    "throw box.stl --drops 0": "drops: expected a whole number above 0, got 0; raise it",
    "throw box.stl --engine havok": "engine: expected native, got 'havok'; take",
    "throw box.stl --table felt": "--table: table felt: expected board-game, hard-wood, carpet",
    "throw box.stl --hand foot": "hand: expected cup, hand, tower, got 'foot'; take one",
    "throw box.stl --size 5000": "expected a die no larger than the least drop height of",
    "throw box.stl --size nan": "expected a size of 0.0001 to 10 m, got nan",
    "throw box.stl --com 9,0,0": "center of mass: expected a point strictly inside the hull",
    "throw box.stl --seed -1": "seed: expected a whole number of at least 0, got -1",
    "rolls box.stl counts.csv --confidence 0.49": "--confidence: expected at least 0.5 and less",
    "rolls box.stl counts.csv --confidence nan": "--confidence: expected at least 0.5 and less",
    "rolls box.stl other.csv": "expected a label of the die (1, 2, 3, 4, 5, 6), got '7'",
    "rolls box.stl none.csv": "none.csv",
    "rolls none.obj counts.csv": "none.obj",
    "rolls within counts.csv": "result.json: expected the result of a finished run",
    "balance box.stl --out within --equal 1": "equal: expected a whole number of at least 2",
    "balance box.stl --out within --stand 77": "stand: expected the number of a pose from 1 to",
    "balance box.stl --out within --target 0.5,0.7": "target: expected probabilities",
    "balance box.stl --out within --target 0.5,x": "--target: expected numbers",
    "balance box.stl --out within --target 1/2 --poses a": "--poses: expected numbers of poses",
    "balance box.stl --out within --fewest --poses 1": "--poses: expected --target",
    "balance box.stl --out within --fewest --size-mm 40 --wall-mm 100": "wall_mm",
    "balance box.stl --fewest --out within.obj": "--out: expected a folder or a file that ends in",
    "balance box.stl --stand 1 --out box.stl": "--out: expected another file than an input",
    "balance open.obj --out within --fewest": "repair",
    "balance none.stl --out within --fewest": "none.stl",
    "set d6 six": "six: target: expected dice, weights, probabilities",
    "set d6 D6": "D6: expected dice that differ",
    "set d6 --edges wide": "edges.shape: expected 'fillet' or 'chamfer', got 'wide'",
    "set d6 --edges 9": "edges.radius_mm: expected at most",
    "set d6 --size -3": "size_mm: expected a number of at least",
    "set d6 --printer ink": "printer: expected fdm, sla, sls",
    "sweep good.yaml": "--set: expected it, or --seeds, got none",
    "sweep good.yaml --seeds 0": "--seeds: expected a whole number above 0, got 0",
    "sweep good.yaml --seeds 3 --set seed=1,2": "--set seed: expected none with --seeds, got both",
    "sweep good.yaml --seeds 3 --jobs -1": "--jobs: expected a whole number above 0, got -1",
    "sweep good.yaml --seeds 3 --scheduler far": "--scheduler: expected an address such as tcp:",
    "sweep good.yaml --seeds 2 --set size_mm=20,wide": "size_mm: expected a length in mm",
    "sweep good.yaml --set sizes=20,30": "sizes: unknown key",
    "sweep good.yaml --set size_mm": "--set size_mm: expected a key of its own and its values",
    "sweep good.yaml --set size_mm=": "--set size_mm=: expected a key of its own and its values",
    "sweep good.yaml --set seed=1 --set seed=2": "--set seed=2: expected a key of its own and its",
    "sweep good.yaml --set size_mm=20,20.0": "--set: expected combinations that differ",
    "sweep lost.yaml --seeds 2": "gone.stl",
    "repair cloud.xyz out.stl": "point cloud",
    "repair sheet.stl out.stl": "thickness",
    "repair hollow.stl out.stl": "got an empty one",
    "run missing.yaml": "missing.yaml",
    "run bad.yaml": "bad.yaml: color: unknown key",
    "run good.yaml --out box.stl/x": "folder that can be written",
    "run good.yaml --resume": "method: {concave: {}} or with method.exact.refine, got exact",
    "run good.yaml --set 'start={mesh: {path: missing.stl}}'": "missing.stl",
    "run good.yaml --set 'start={prism: {sides: 5}}'": "start.prism.sides: expected 4",
    "run good.yaml --set 'start={prism: {sides: 99}}'": "expected 3 to 12, got 99",
    "run good.yaml --set 'start={mesh: {path: box.stl}}' --set target.fair=7": "7",
    "run good.yaml --set 'center_of_mass=[0, 0, 9]'": "got [0.0, 0.0, 9.0], which is",
    "run concave.yaml --resume": "checkpoint of a run that was interrupted, got none",
    "run concave.yaml --set start.mesh.path=open.obj": "got 3 edges with one triangle (the mesh is "
    "open); write start: {mesh: {path: FILE, repair",
    "run concave.yaml --set start.mesh.path=few.xyz": "at least 4 distinct points",
    "run concave.yaml --set start.mesh.path=cloud.xyz": "got a point cloud",
    "run concave.yaml --set start.mesh.path=two.stl": "repair: true}}",
    "run concave.yaml --set start.mesh.path=sheet.stl": "flat sheet",
    "run concave.yaml --set start.mesh.path=ball.stl --set target.fair=3": "nearly a sphere",
    "run concave.yaml --set start.mesh.path=box.stl --set target.fair=3": "take method: {exact",
    "run concave.yaml --set 'start={prism: {}}'": "start: expected a surface to keep",
    "view none.stl --port 0": "no such file",
    "view flat.xyz --port 0": "one plane",
    "view nan.xyz --port 0": "finite",
    "view bad.yaml --port 0": "bad.yaml: color: unknown key",
    "view lost.yaml --port 0": "gone.stl",
    "view nothing --port 0": "expected a folder with meshes",
    "view half --port 0": "half/result.json: expected the result of a finished run",
    "design --target 2d6,1/2": "--target: expected a number, a fraction such as",
    "design --target 1/0,1/2": "--target: expected a number, a fraction such as",
    "design --target 1e400,1/2": "--target: expected a number, a fraction such as",
    "design --target 1/2,1/2,": "--target: expected a number, a fraction such as",
    "design --target 1/2,1/3": "--target: expected a sum of 1, got 0.833333333333",
    "design 1": "--target: expected dice, weights, probabilities",
    "design coin": "--target: expected dice, weights, probabilities",
    "design 50,30,20": "did you mean 50%,30%,20% or 50:30:20?",
    "design 33.3,33.3,33.3": "did you mean 33.3:33.3:33.3?",
    "design --target 1,2,3": "--target: expected a sum of 1, got 6; did you mean 1:2:3?",
    "design 2d6kh3": "--target: expected to keep 1 to all",
    "design 99d6-2d6": "--target: expected at most 200 outcomes",
    "design d6 --sise-mm 3": "--sise-mm: expected an option of dicedesign design; did you mean --",
    "rolls -log die": "-log: expected an option of dicedesign rolls",
    "dezign d6": "got 'dezign'; did you mean design?",
    "roll die.stl": "did you mean rolls?",
    "design d6 --size-mm 0.03": "--size-mm: expected at least 1 mm, got 0.03; did you mean 30?",
    "design d6 --size-mm 3ft": "--size-mm: expected a length in mm such as 30, or with a unit",
    "design d6 --icons skull.svg": "--icons: expected label=FILE.svg, got 'skull.svg'",
    "design d6 --icons 7=blank.svg": "--icons: expected labels of the target",
    "design d6 --table nowhere": "--table: table nowhere: expected board-game",
    "design d7 --faces 7": "--faces: expected an even number of at least 7",
    "design d6 --font Nowhere": "--font: expected the family of an installed font",
    "design d6 --edges 7": "--edges: expected at most 6",
    "design d6 --edges smooth": "--edges: expected 'fillet' or 'chamfer', got 'smooth'",
    "design 1/2,1/2 --mesh box.stl --edges 1": "--edges: expected none with the concave method",
    "design --target=-1/2,3/2": "--target: expected numbers between 0 and 1, got -0.5",
    "design --target 'fair: 1'": "--target: expected a whole number of at least 2, got 1",
    "design --target 'fair: 201'": "--target: expected at most 200 outcomes, got 201",
    "design --target 'sum_of_dice: [6, 1]'": "--target: expected a whole number of at least 2",
    "design --target '2d6: 3'": "target.2d6: unknown key",
    "design --target 'fair: [7'": "--target: expected a comma or a closing bracket",
    "design --target 1/2,1/2 --labels a": "--labels: expected 2, one for each probability, got",
    "design --target 1/2,1/2 --labels a,a": "--labels: expected at least two different ones",
    "design --target 1/2,1/2 --labels a,": "--labels: expected 1 to 24 characters, as no face can",
    "design --target 1/2,1/2 --labels a,日": "label '日': expected characters of the font DejaVu",
    "design --target 1/2,1/2 --seed -1": "--seed: expected a number of at least 0, got -1",
    "design --target 1/2,1/2 --size-mm 0": "--size-mm: expected a number of at least 0.001",
    "design --target 1/2,1/2 --size-mm nan": "--size-mm: expected a length in mm",
    "design --target 1/2,1/2 --name a/b": "--name: expected letters, digits, spaces",
    "design --target 1/2,1/2 --printer lathe": "--printer: printer: expected fdm, sla, sls, got",
    "design --target 1/2,1/2 --files obj,dxf": "--files: expected formats out of stl, 3mf, obj",
    "design --target 1/2,1/2 --files ''": "--files: expected formats out of stl, 3mf, obj",
    "design --target 1/2,1/2 --repair": "--mesh",
    "design --target 1/2,1/2 --mesh open.obj": "--repair",
}

ENTRIES = {
    "{labels: [骰, b, c, d]}": "label '骰': expected characters of the font DejaVu Sans Bold, got",
    "{engrave: {font: No Such Font}}": "engrave.font: expected the family of an installed font",
    "{engrave: {font: none.ttf}}": "none.ttf: no such file",
    "{engrave: {font: broken.otf}}": "broken.otf: expected a TTF or OTF font with outlines",
    "{labels: [1, 2, 3, X], engrave: {content: pips}}": "label 'X': expected a whole number from 1",
    "{engrave: {icons: {3: none.svg}}}": "none.svg: no such file; check the path",
    "{engrave: {icons: {9: text.svg}}}": "engrave.icons: expected labels",
    "{engrave: {icons: {3: blank.svg}}}": "expected at least one filled path or shape, got none",
    "{engrave: {icons: {3: script.svg}}}": "expected no scripts",
    "{engrave: {icons: {3: text.svg}}}": "expected paths and shapes only, got <text>",
    "{engrave: {icons: {3: broken.svg}}}": "expected an SVG file, got no XML",
    "{engrave: {depth_mm: -0.6}}": "depth_mm: expected a number above 0, got -0.6",
    "{engrave: {depth_mm: 1.0e-12}}": "engrave.depth_mm: expected at least 3e-05",
    "{engrave: {depth_mm: 25}}": "reduce depth_mm",
    "{engrave: {min_height_mm: 40, max_height_mm: 50}}": "expected room on facet ",
    "{engrave: {depth_mm: 30, margin_mm: 0, min_height_mm: 0.01}}": "on facet ",
    "{labels: [8, b, c, d], engrave: {stroke_mm: 6}}": "label '8' on facet ",
    "{engrave: {stroke_mm: 50.0}}": "for digits of at least min_height_mm",
    "{edges: {radius_mm: 6.1}}": "edges.radius_mm: expected at most 6",
    "{edges: {radius_mm: 0.29}}": "edges.radius_mm: expected at least 0.3",
    "{edges: {radius_mm: 5.9}}": "radius of the flat circle on facet",
    "{files: [stl, dxf]}": "files: expected formats out of",
}
"""Changes of a recipe for a fair d4, and the error."""

KEYS = (
    "engrave.depth_mm margin_mm min_height_mm max_height_mm stroke_mm border_mm content icons font "
    "upright ambiguous style balance read",
    "edges radius_mm shape",
    "print printer nozzle_mm material density_g_cm3 oriented infill walls_mm errors",
    "print.errors dimensional_mm shrinkage density_gradient bubble_mm3",
    "method.exact tolerance coordinates probabilities",
    "method.paper steps weights step",
    "method.concave attempts hull fill",
    *["target", "start", "seed", "size_mm", "assignment", "center_of_mass", "symmetry", "prior"],
    *["numbering", "files", "clock"],
)
"""Entries of a recipe, each with its nested entries."""

WRONG = "-1 .nan .inf 1.0e+300 wrong [1] {wrong: 1}".replace("wrong: 1", "wrong:_1").split()


NAMES = [400 * "9", "loop/x", "a\0b", "plain/x"]
"""Names that no file can have."""

NAMED = [
    "rest NAME",
    "throw NAME",
    "throw plain --table NAME.json",
    "rolls NAME plain",
    "run good.yaml --out NAME/x",
    "run lost.yaml --set start.mesh.path=NAME",
    "rest . --out NAME/t.csv",
]


def run_with(change: str) -> list[str]:
    """Arguments that run a recipe for a fair d4 with other entries."""
    entries = {"target": {"fair": 4}, **yaml.safe_load(change)}
    labels = entries.pop("labels", "1234")
    entries["target"]["labels"] = [str(label) for label in labels]
    if "icons" in entries.get("engrave", {}):
        entries["engrave"]["icons"] = {str(k): v for k, v in entries["engrave"]["icons"].items()}
    changes = [f"--set={key}={json.dumps(value)}" for key, value in entries.items()]
    return ["run", "die.yaml", "--no-figures", *changes]


def with_name(command: str, name: str) -> list[str]:
    value = json.dumps(name) if "--set" in command else name
    return [word.replace("NAME", value) for word in command.split()]


REFUSALS = (
    *((shlex.split(command), piece) for command, piece in COMMANDS.items()),
    *((run_with(change), piece) for change, piece in ENTRIES.items()),
    *((with_name(command, name), "") for command in NAMED for name in NAMES),
)
"""Arguments, and a piece of the error."""


@pytest.fixture(scope="session")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with meshes, recipes, fonts and pictures, most of them broken."""
    folder = tmp_path_factory.mktemp("inputs")
    for name in ("within", "rubbish", "nothing", "half"):
        (folder / name).mkdir()
    for name, text in FILES.items():
        (folder / name).write_text(text)
    (folder / "loop").symlink_to("loop")
    (folder / "garbage.stl").write_bytes(bytes(range(256)) * 3)
    (folder / "hollow.stl").touch()
    for path in ("box.stl", "within/box.stl"):
        trimesh.creation.box((1, 2, 3)).export(folder / path)
    ball = trimesh.creation.icosphere(3)
    ball.export(folder / "ball.stl")
    (ball + ball.copy().apply_translation([1, 0, 0])).export(folder / "two.stl")
    grid = trimesh.Trimesh([(x, y, 0) for x in range(4) for y in range(4)], process=False)
    grid.faces = [(k, k + 4, k + 5) for k in range(11) if k % 4 < 3] + [
        (k, k + 5, k + 1) for k in range(11) if k % 4 < 3
    ]
    grid.export(folder / "sheet.stl")
    write_cube(folder / "dented.obj")
    return folder


LIBRARY = "Input should|validation error|pydantic|type=|Field required|Extra inputs|Value error"


def contents() -> dict[Path, bytes]:
    return {path: path.read_bytes() if path.is_file() else b"" for path in Path().rglob("*")}


@pytest.fixture
def refusal(
    inputs: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[[list[str]], str]:
    """Runs a command in the folder, and returns its one line of error."""
    monkeypatch.chdir(inputs)
    before = contents()

    def refuse(arguments: list[str]) -> str:
        assert main(arguments) == 2
        captured = capsys.readouterr()
        assert captured.out == ""
        (line,) = [line for line in captured.err.splitlines() if not line.startswith("note: ")]
        assert line.startswith("dicedesign: ")
        assert "; " in line, "no remedy"
        assert not re.search(LIBRARY, line)
        assert contents() == before
        return line

    return refuse


@pytest.mark.parametrize(("arguments", "piece"), REFUSALS)
def test_refusals(arguments: list[str], piece: str, refusal: Callable[[list[str]], str]) -> None:
    assert piece in refusal(arguments)


@pytest.mark.parametrize("keys", KEYS, ids=lambda keys: keys.split()[0])
def test_wrong_values_are_refused_by_their_key(
    keys: str, refusal: Callable[[list[str]], str]
) -> None:
    parent, *others = keys.replace("engrave.", "engrave ").split()
    for key in [f"{parent}.{other}" for other in others] or [parent]:
        for value in WRONG:
            change = f"{key}={value.replace('_', ' ')}"
            line = refusal(["run", "good.yaml", "--no-figures", "--set", change])
            assert key.split(".")[-1] in line, change


@pytest.mark.parametrize("command", COMMAND_LINE)
def test_help_fits_a_screen_and_its_example_is_valid(
    command: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    monkeypatch.setenv("COLUMNS", "90")
    with pytest.raises(SystemExit):
        main([command, "--help"])
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) <= 40
    program, *words = shlex.split(" ".join(lines).rpartition("Example: ")[2])
    assert program == "dicedesign"
    assert make_parser(command).parse_args(words).command == command
    if command in ("rest", "drop", "pose", "scatter", "figure"):
        monkeypatch.chdir(tmp_path)
        box = trimesh.creation.box((1.0, 2.0, 3.0))
        Path("meshes").mkdir()
        for name in ("die.stl", "bunny.obj", "meshes/box.stl"):
            box.export(name)
        assert main(words) == 0


@pytest.mark.parametrize(
    "command",
    [
        "design",
        "design d6 --target d6",
        "rolls die",
        "rolls die counts.csv --log log.csv",
    ],
)
def test_usage(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(command.split())
    assert ended.value.code == 2
    assert "error: " in capsys.readouterr().err
