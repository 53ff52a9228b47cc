"""Physics of a precariously balanced rock on a shaking pedestal.

SI units throughout: metres, seconds, kilograms, radians, accelerations in m/s^2. The frame is
right-handed with z up and the table shaking along x. Quaternions are ordered x, y, z, w.
The package reads and writes no files.
"""

GRAVITY = 9.80665
"""Standard gravity [m/s^2] (CGPM 1901); a PGA of 1 g is this acceleration."""
