"""From a raw scan, rock and ground in one open mesh, to a closed rock and the ground beneath it.

Throughout, vertices are of shape (n, 3) in metres, z up; faces are of shape (m, 3), corners of each
in counter-clockwise order seen from outside; what is known of each face is of shape (m,).
"""
