"""Numerical tolerances by which the package decides about bodies, in one place.

None depends on the unit of length: each says what it is relative to, or is an angle, a probability,
a count or a limit of the number format. What a body's rests are, whether a surface is sound and
whether a solid can be printed is decided by these alone. The constants of steps and stops, in
solvers, searches, fills and simulated contacts, and those of drawing and of the benches' verdicts
have names and a sentence each where they are used.
"""

from __future__ import annotations

import math
from typing import Final

COPLANAR_TOLERANCE: Final = 1e-11
"""Two hull triangles are one facet when all corners lie within this distance of one plane,
relative to half the largest extent of the points, for coordinates that were computed in float64 (a
rotated cube has errors near 1e-16)."""

COPLANAR_TOLERANCE_FLOAT32: Final = 2e-6
"""The same for coordinates that were rounded to float32 (STL, most PLY): 2^-24 per coordinate,
times the extrapolation from a facet's largest triangle to its far corners."""

COPLANAR_WIDENINGS: Final = (1.0, 10.0, 100.0, 1000.0)
"""Factors of the coplanar tolerance, tried in turn until the merged facets make a polyhedron:
clusters of points at one spacing can leave facets that a tolerance of that size cuts apart."""

COPLANAR_COARSEST: Final = 0.5
"""No coplanar tolerance is widened beyond this where facets are as uneven as they bend."""

REUSE_FLATNESS: Final = 1e-14
"""A hull keeps its connectivity only if the corners of every facet are this near to its plane,
relative to half the largest extent of the points; then any triangles that Qhull makes of it are one
facet to COPLANAR_TOLERANCE. What is not above this counts as rounding."""

REUSE_MARGIN: Final = 1e-7
"""A hull keeps its connectivity only if all corners of every facet's neighbors but those of the
common edge are this far below its plane, relative to the same: four orders of magnitude above what
counts as coplanar. Then no edge is shorter either."""

REUSE_LEVERAGE: Final = 100.0 * REUSE_FLATNESS
"""The same depth times the length of the edge, and times the facet's area over its number of
corners, relative to powers of the same: a short edge or a small facet fixes a plane less well."""

REUSE_TURN: Final = 5e-3
"""A hull keeps its connectivity only if its facets turn at each corner by more than this, in
radians: three corners almost on a line fix no plane."""

REUSE_OFFSET: Final = 8.0
"""A hull keeps its connectivity only if no coordinate is larger than this, relative to the same:
farther from the origin, coordinates are rounded too coarsely."""

FLATNESS_TOLERANCE: Final = 1e-12
"""Where a hull is refused, singular values of the points below this part of the largest count as
none: the error then says "on one plane" or "on one line". It decides about the wording only."""

BALANCED_PROBABILITIES: Final = 1e-11
"""An object is led to its target until its probabilities differ by no more than this: files of all
digits hold a hundred times as much, those of single precision a hundred thousand times."""

BOUNDARY_TOLERANCE: Final = 1e-13
"""A center of mass nearer than this to a facet's plane, relative to the largest offset of a vertex
from the mean of all, counts as lying on the hull's boundary."""

CLOSURE_TOLERANCE: Final = 1e-9
"""The basins' areas must sum to 4 pi within this. A larger gap is reported rather than returned."""

PROBABILITY_SUM_TOLERANCE: Final = 1e-9
"""Target probabilities must sum to 1 within this."""

EQUAL_PROBABILITIES: Final = 1e-12
"""Relative difference up to which two outcomes of a target count as equally probable."""

EQUAL_LIKELIHOOD: Final = 1e-14
"""Difference between the logarithms of the likelihoods of two tables of counts up to which they
count as equally likely, relative to the sum of the absolute values of the terms that make up such a
logarithm: what rounding them adds up to, and some more."""

SYMMETRY_TOLERANCE: Final = 1e-5
"""A shape is symmetric when each facet's image differs from another facet by no more than this: in
the direction of its normal, in radians, and in the logarithm of its distance. Single precision
keeps to it."""

ENGRAVED_VOLUME_TOLERANCE: Final = 1e-4
"""The volume that engraving takes away must be that of the labels within this part of it: the
unevenness of a facet with float32 corners over the depth of a pocket."""

FILE_ANGLE: Final = math.radians(0.05)
"""Angles between rests, and from rests to saddles, may fall short of what is wanted by this, in
radians, where coordinates are rounded to the single precision of an STL file."""

FILE_WALL: Final = 1e-4
"""Part of the least thickness of walls around cavities that they may be thinner by in a file, whose
coordinates are rounded."""

FILE_PROBABILITIES: Final = 1e-6
"""Probabilities may change by this, and the die's tolerance be exceeded up to it, where coordinates
are rounded to the single precision of an STL file."""

FILLED_GAP: Final = 1e-4
"""A surface fills a hull when the two are no farther apart than this, relative to the diagonal of
the surface's box."""

FLAT_FOLD: Final = 1e-6
"""Two triangles with a common edge lie on each other when the angle between them is no more than
this, in radians: a surface that was pressed onto a plane keeps to it only to within rounding."""

LEAST_MARGIN: Final = math.radians(0.1)
"""A die that leaves an outcome when it is tipped by less than this, in radians, is left at a nudge:
no table is more level."""

LEVEL_ANGLE: Final = math.radians(5.0)
"""A facet is level on top of a die, and opposite to the one that it rests on, when its normal is
within this of up, in radians: labels on it are seen as if it were level."""

LEAST_MM: Final = 1e-3
"""Smallest distance, in millimeters, between two corners of a solid that can be made."""

MOST_MM: Final = 1000.0
"""Largest distance, in millimeters, between two corners of a solid that can be made."""

MATCHED_PROBABILITIES: Final = 0.02
"""Outcomes whose probabilities without momentum are told belong to the rests of a mesh that have
these to within this: files of printed dice differ from what was published about them."""

NEAR_ANTIPODE: Final = 0.05
"""The area of a basin is measured from its rest's normal unless its border comes nearer to the
antipode than this, as 1 + cosine: some 18 degrees."""

PRINT_TOLERANCE: Final = 1e-6
"""Edges and slivers thinner than this, relative to the diagonal of the body's box, are taken out of
a solid before it is printed."""

ROUNDED_DIGITS: Final = 12
"""Coordinates of a file that all have at most this many significant decimal digits were rounded
more coarsely than COPLANAR_TOLERANCE allows for; they count as single precision."""

VOLUME_TOLERANCE: Final = 1e-11
"""A closed surface whose volume over the cube of its largest extent is below this bounds no solid,
and a shell of it no body and no cavity; at this size
rounding leaves the centroid about five digits."""

SAME_REST_ANGLE: Final = math.radians(5.0)
"""Two rests are one outcome to the eye when their normals differ by at most this, in radians:
the body then stands on nearly the same facet."""

ROUNDING: Final = 32.0 * 2.0**-53
"""Relative bound on the rounding error of the sums of products that decide about a body (at most a
dozen operations each, plus a margin). Signs of values within it are found in exact arithmetic."""

SLIVER: Final = 2.0**-30
"""A facet of no more than this part of the square over its longest edge has its normal computed in
exact arithmetic: rounding would turn it noticeably."""

SLIVER_ANGLE: Final = math.radians(1.0)
"""A triangle of a surface is reported as a sliver when its smallest angle is below this, in
radians."""

STANDING_ANGLE: Final = math.radians(1.0)
"""A body at a stand is on a facet when that facet's normal is within this of down, in radians."""

SHARP_TURN: Final = math.radians(170.0)
"""Two triangles with a common edge count as folded together when the surface turns by more than
this there, in radians: the wedge between them is then narrower than ten degrees."""

THIN_VOLUME: Final = 1e-3
"""A body is thin when its volume is less than this part of the cube of its largest coordinate from
its middle: a needle about 90 times as long as thick, a plate 8000 times. Its centroid is then
computed of a thicker linear image."""

TIE_TOLERANCE: Final = 1e-14
"""A body is tied where a move of its center of mass by this, relative to its extent plus its
largest coordinate, could change what it does: a computed center of mass is not known better."""

WARP_TOLERANCE: Final = 0.01
"""Facets that were merged within a tolerance make a body as long as no edge is turned by more than
this sine from where the planes beside it meet. It is where an edge or a facet is hardly wider than
its facets are uneven, as among points that lie in clusters."""

TRANSPORT_TOLERANCE: Final = 1e-10
"""Part of the mass that a transport plan may leave behind or make up: HiGHS takes no less."""

SMALLEST_EXTENT: Final = 1e-40
"""Products of up to six coordinates must neither underflow nor overflow: no body is smaller than
this, and no coordinate larger than its inverse, whatever the unit."""

UNDERFLOW: Final = 1e-200
"""Products of coordinates below this may have lost digits to underflow: they decide nothing. A
product of four at `SMALLEST_EXTENT` is far above it."""
