"""The error-state Kalman filter: inertial navigation, aided; ``navigator.InertialNavigator`` is what a pipeline uses.

    states.py      what is estimated: nine or fifteen errors, and errors of what aids
    kernels.py     one step of state and covariance, one update with a scalar (compiled)
    estimate.py    the estimate at one time; what it says in latitude, longitude, north, east, down
    aiding.py      what aids: ``compute_matrices(here) -> (z, H, R)``, one small class each
    gate.py        which innovations are believed, and for how long one may be refused
    timeline.py    measurements that come late are taken at the time at which they were true
    navigator.py   alignment, mode and reasons

    x = truth - estimate,     z = measured - expected = H x + noise,     z is the innovation

The error is in the earth frame (``fti.nav.inertial.ins_error_model``); everything said outside is in n at the point.
"""
