"""Horizontal position from the ground by sequential filters: each height sample updates a probability of the shift.

    drift_model    linear-Gaussian errors of the navigated position and height, and the estimate of a filter
    height_sample  residual of one height sample at many positions, and its likelihood
    point_mass     point-mass filter: the probability on an adaptive grid
    sir            particle filter; its measurement is exchangeable
    marginalised   particle filter with a velocity error
    recovery       test whether a filter is lost
    terrain_filter the form that the uncertainty of the position needs; it starts again when lost
    bound          posterior Cramer-Rao bound along a flight

Frame: east, north, up of the terrain's local frame [m].  A shift is true minus navigated position, as in
``fti.nav.terrain_matching``.  The navigated position of each sample contains the displacement of the inertial solution,
so the time update adds only the drift of the inertial solution.

A sample measures the height of the ground (navigated height minus height above ground), with h the terrain:

    z = h(navigated position + shift) + b + noise      b : navigated minus true height, common to all samples

For a given shift the height error b is linear and Gaussian.  Each cell or particle has its mean and variance of b
(Rao-Blackwellisation); its likelihood is that of the residual z - h - mean, with the variance of b and of the noise.

Unknown ground.  Where a position is over unknown ground, a sample has the mean likelihood of the other positions: it
does not change the probability that the position is over unknown ground.

Source: Bergman 1999, chapters 3 to 5 (point-mass filter, Cramer-Rao bound of terrain navigation).
"""
