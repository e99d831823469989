"""Numerical tolerances by which the package decides about bodies, in one place.

None depends on the unit of length: each says what it is relative to, or is an angle, a probability,
a count or a limit of the number format. These alone decide which facets of a body are rests,
whether a surface is valid and whether a solid can be printed. Constants of steps and stopping
rules, of simulated contacts, of drawings and of benchmarks are where they are used.
"""

from __future__ import annotations

import math

COPLANAR_TOLERANCE = 1e-11
"""Two hull triangles are one facet when all corners lie within this distance of one plane,
relative to half the largest extent of the points, for coordinates that were computed in float64 (a
rotated cube has errors near 1e-16)."""

COPLANAR_TOLERANCE_FLOAT32 = 2e-6
"""Coplanar tolerance, as `COPLANAR_TOLERANCE`, of coordinates rounded to float32 (STL, most PLY):
2^-24 per coordinate, times the extrapolation from a facet's largest triangle to its far corners."""

REUSE_FLATNESS = 1e-14
"""A hull keeps its connectivity only if the corners of every facet are this near to its plane,
relative to half the largest extent of the points; then any triangles that Qhull makes of it are one
facet to COPLANAR_TOLERANCE. Anything smaller counts as rounding."""

REUSE_MARGIN = 1e-7
"""A hull keeps its connectivity only if all corners of every facet's neighbors but those of the
common edge are this far below its plane, relative to half the largest extent: four orders of
magnitude above what counts as coplanar. Then no edge is shorter either."""

REUSE_LEVERAGE = 100.0 * REUSE_FLATNESS
"""A hull keeps its connectivity only if this depth times the length of the edge, and times the
facet's area over its number of corners, is larger than this, relative to powers of half the largest
extent: a short edge or a small facet fixes a plane less well."""

REUSE_TURN = 5e-3
"""A hull keeps its connectivity only if its facets turn at each corner by more than this, in
radians: three corners almost on a line fix no plane."""

REUSE_OFFSET = 8.0
"""A hull keeps its connectivity only if no coordinate is larger than this, relative to half the
largest extent: farther from the origin, coordinates are rounded too coarsely."""

FLATNESS_TOLERANCE = 1e-12
"""Where a hull is refused, singular values of the points below this part of the largest count as 0:
the error then says "on one plane" or "on one line". This affects the wording only."""

BALANCED_PROBABILITIES = 1e-11
"""Largest error of probabilities at which reshaping an object stops. The rounding of files in
double precision changes them by a hundred times as much, in single precision by a hundred thousand
times."""

BOUNDARY_TOLERANCE = 1e-13
"""A center of mass nearer than this to a facet's plane, relative to the largest offset of a vertex
from the mean of all, counts as lying on the hull's boundary."""

CLOSURE_TOLERANCE = 1e-9
"""The basins' areas must sum to 4 pi within this. A larger gap is reported rather than returned."""

PROBABILITY_SUM_TOLERANCE = 1e-9
"""Target probabilities must sum to 1 within this."""

EQUAL_PROBABILITIES = 1e-12
"""Relative difference up to which two outcomes of a target count as equally probable."""

EQUAL_LIKELIHOOD = 1e-14
"""Difference between the logarithms of the likelihoods of two tables of counts up to which they
count as equally likely, relative to the sum of the absolute values of the terms that make up such a
logarithm: what rounding them adds up to, and some more."""

SYMMETRY_TOLERANCE = 1e-5
"""A shape is symmetric when each facet's image differs from another facet by no more than this: in
the direction of its normal, in radians, and in the logarithm of its distance. Single precision
keeps to it."""

ENGRAVED_VOLUME_TOLERANCE = 1e-4
"""Largest relative difference between the volume removed by engraving and the volume of the labels:
the unevenness of a facet with float32 corners over the depth of a pocket."""

FILE_ANGLE = math.radians(0.05)
"""Angles between rests, and from rests to saddles, may fall short of what is wanted by this, in
radians, where coordinates are rounded to the single precision of an STL file."""

FILE_WALL = 1e-4
"""Share of the least thickness of walls around cavities by which they may be thinner in a file,
whose coordinates are rounded."""

FILE_PROBABILITIES = 1e-6
"""Probabilities may change by this, and the die's tolerance be exceeded up to it, where coordinates
are rounded to the single precision of an STL file."""

FILLED_GAP = 1e-4
"""A surface fills a hull when the two are no farther apart than this, relative to the diagonal of
the surface's box."""

FLAT_FOLD = 1e-6
"""Two triangles with a common edge overlap when the angle between them is no more than this, in
radians: a surface that was pressed onto a plane is flat only to within rounding."""

LEAST_MARGIN = math.radians(0.1)
"""Least margin of an outcome, in radians: no table is more level."""

LEVEL_ANGLE = math.radians(5.0)
"""A facet is level on top of a die, and opposite to the one that it rests on, when its normal is
within this of up, in radians: labels on it look level."""

LEAST_MM = 1e-3
"""Least largest distance between two corners of a solid, in millimeters."""

MOST_MM = 1000.0
"""Most largest distance between two corners of a solid, in millimeters."""

NEAR_ANTIPODE = 0.05
"""The area of a basin is measured from its rest's normal unless its border comes nearer to the
antipode than this, as 1 + cosine: some 18 degrees."""

NOTED_ROUNDING = 1e-5
"""A note says that digits are lost if coordinates are rounded to more than this part of the body's
extent, as the body is far from the origin; probabilities may be wrong by about as much."""

PRINT_TOLERANCE = 1e-6
"""Edges and slivers thinner than this, relative to the diagonal of the body's box, are taken out of
a solid before it is printed."""

ROUNDED_DIGITS = 12
"""Coordinates of a file that all have at most this many significant decimal digits were rounded
more coarsely than COPLANAR_TOLERANCE allows for; they count as single precision."""

VOLUME_TOLERANCE = 1e-11
"""A closed surface whose volume over the cube of its largest extent is below this bounds no solid,
and a shell of it no body and no cavity; at this size rounding leaves the centroid about five
digits."""

SAME_REST_ANGLE = math.radians(5.0)
"""Two rests count as one outcome if their normals differ by at most this, in radians: the facets
then look like one."""

ROUNDING = 32.0 * 2.0**-53
"""Relative bound on the rounding error of the sums of products that decide about a body (at most a
dozen operations each, plus a margin). Signs of values within it are computed exactly."""

SLIVER = 2.0**-30
"""A facet of no more than this part of the square over its longest edge has its normal computed in
exact arithmetic: rounding would turn it noticeably."""

SLIVER_ANGLE = math.radians(1.0)
"""A triangle of a surface is reported as a sliver when its smallest angle is below this, in
radians."""

STANDING_ANGLE = math.radians(1.0)
"""A body that has stopped rests on a facet when the facet's normal is within this of down, in
radians."""

SHARP_TURN = math.radians(170.0)
"""Two triangles with a common edge count as folded together when the surface turns by more than
this there, in radians: the wedge between them is then narrower than ten degrees."""

THIN_VOLUME = 1e-3
"""A body is thin when its volume is less than this part of the cube of its largest coordinate from
its middle: a needle about 90 times as long as thick, a plate 8000 times. Its centroid is then
computed of a thicker linear image."""

TIE_TOLERANCE = 1e-14
"""A body is tied where a move of its center of mass by this, relative to its extent plus its
largest coordinate, could change its rests: a computed center of mass is not known better."""

WARP_TOLERANCE = 0.01
"""Largest sine of the angle between an edge of merged facets and the line where their planes meet.
It is larger where an edge or a facet is hardly wider than its facets are uneven, as among clustered
points."""

SMALLEST_EXTENT = 1e-40
"""Least extent of a body, and inverse of the largest coordinate, in any unit: products of up to six
coordinates must neither underflow nor overflow."""

UNDERFLOW = 1e-200
"""Products of coordinates below this decide nothing, as they may have lost digits to underflow. A
product of four at `SMALLEST_EXTENT` is far above it."""
