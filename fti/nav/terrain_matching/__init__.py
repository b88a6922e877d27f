"""Horizontal position by comparison of a measured height profile with elevation.

    profile        heights of the ground below the track, at navigated positions
    window         the posts of the terrain around a profile, on one grid
    search         chi-square of the profile for every shift of a lattice; five-point search
    likelihood     chi-square at any shift, with its derivatives
    fix            the shift with the smallest chi-square, its covariance, and why it may be refused
    reach          window and lattice of a search up to a distance
    apparent_surface  the ground as a banked altimeter with a beam sees it, as a window
    nearest_surface   the same for the nearest return of a radar, from posts
    selection      the samples that contain most information
    beam_profile   the ranges of an altimeter with several beams as one profile
    beam_choice    which beam to measure with next: switching and steering by forecast
    acquisition    three independent fixes that agree
    printed_metric the metric and the covariance of the source, for comparison

Frame: east, north, up of the terrain's local frame [m].  A shift is true minus navigated position.

Likelihood.  Sample k has the navigated position (east, north), the height g of the ground (navigated height minus
height above ground) and the standard deviation s of its independent error.  The error b of the navigated height is
common to all samples, with the prior N(0, s_b^2).  For a shift d, with r = g - terrain(position + d) and w = 1 / s^2,

    chi2(d) = sum w r^2 - (sum w r)^2 / (sum w + 1 / s_b^2)         -2 log of the likelihood, b integrated out
    b(d)    = sum w r / (sum w + 1 / s_b^2)

Source: Spiegel 2018, section 4.1 (matching, removal of the mean offset, eq. 4.10).  His metric is the mean absolute
residual (eq. 4.11); here the likelihood takes its place, because its error is 1.25 times smaller for Gaussian noise.
Bergman 1999, section 3 (likelihood of a terrain profile, Cramer-Rao bound).
"""
