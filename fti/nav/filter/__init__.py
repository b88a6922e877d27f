"""The error-state Kalman filter of aided inertial navigation; a pipeline uses ``navigator.InertialNavigator``.

    error_states.py          the states: nine or fifteen errors, and slow errors of the aiding sources
    kernels.py               one step of state and covariance, one update with a scalar (compiled)
    estimate.py              the estimate at one time, in latitude, longitude, north, east, down
    aiding.py                measurements: ``compute_matrices(estimate) -> (z, H, R)``, one small class each
    innovation_gate.py       which innovations are accepted
    delayed_measurements.py  late measurements are processed at their time of validity
    navigator.py             alignment, mode and reasons

    x = truth - estimate,     z = measured - expected = H x + noise,     z is the innovation

The error is in the earth frame (``fti.nav.inertial.ins_error_model``); all outputs are in n at the point.
"""
