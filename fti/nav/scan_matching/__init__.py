"""Drift of the inertial system from two looks at the same ground, without a map.

    look.py            a look: points of a scan or an image, placed with the inertial solution
    plane_lattice.py   the surface of a look: local planes on a lattice
    registration.py    the drift between two looks, its covariance, and the directions that the ground determines
    shift_search.py    the start of the registration, and other shifts that fit as well
    residuals.py       kernel: range residuals, scores and information of patches
    triangulation.py   the registration as the source prints it, for comparison

Source: Spiegel 2018, chapter 5, as corrected in docs/errata.md.
"""
