"""Every tolerance that the program promises or its tests use, once, with its reason."""

from math import pi

ACCOUNT = 1e-6
"""Suns + residual = source, per channel, as computed. Suns are what the float32 residual lacks,
in float64, so only the summation itself is left; of a wide map also the rounding of the narrow one
to float32, about 1e-8 in all. This is room, not need."""

UNDERFLOW = 4 * pi * 2.0**-149
"""Scalar irradiance that a residual of means, narrower or of cells, may be wrong by besides: below
1e-38 a mean is rounded to a multiple of 2^-149 by float32, in a narrower Voronoi map twice."""

ACCOUNT_FLOAT32 = 1e-6
"""The same, read back from a float32 file: the stored residual is the computed one."""

ACCOUNT_HALF = 1e-3
"""The same, read back from a half file: 11 bits of mantissa round each pixel by up to 4.9e-4."""

HALF_ENERGY = 1e-4
"""How much energy of a channel may be lost by rounding to half before float32 is written."""

HALF_MAXIMUM = 65504.0
"""The largest finite half float (IEEE 754 binary16)."""

EQUIVARIANCE = 1e-6
"""How far suns may differ, relatively, between a map and the same map turned or mirrored: what is
filled in under a sun is stored as float32, and the solver's last digit decides how it rounds."""

UNIT = 1e-12
"""How far from 1 the length of a direction may be: normalising leaves 1e-16, the sines and cosines
of an angle 1e-15. This is room, not need."""

TIE = 1e-14
"""Chords that differ by less are equal, and the lowest index wins: a unit vector made of a pixel's
position is wrong by up to 1e-15, and no tie by symmetry would survive that."""

ROUNDING = 1e-14
"""By so much a squared chord from a dot product may be too large: 2 - 2 cos is wrong by 2e-15."""

NEGLIGIBLE = 1e-100
"""Part of the largest F below which F counts as 0, so that 1 / F and all costs stay finite."""

ROUNDED = 8 * 2.0**-52
"""Part of a pixel that a product with its solid angle and a division by it may change."""
