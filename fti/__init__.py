"""``fti``: a flight-test data service.  This docstring defines the conventions of all packages.

Flow
    device -> link -> RawFrame -> triple buffer -> MCAP (raw)                 recorder process, bytes only
                         \\-> ring -> decoder -> Measurement -> nav -> outputs -> MCAP (derived), bus
    hil: trajectory -> sensor models -> faults -> encoder -> pty, CAN, UDP -> the same links

Units
    SI and radians everywhere inside.  No suffix means SI or radian; anything else carries its unit
    (``_deg _ft _kt _ns _ms _hz``) and is used at the edge only: configuration, command line, display, wire.
    An unknown value is ``None`` or an enum member, never a number.

Time
    ``int`` nanoseconds.  FTI time = CLOCK_MONOTONIC + session epoch (real time at the start rounded to 20 ms,
    written once; it may be wrong and never changes).  Only ``fti.clock`` reads it.
    ``t_rx_ns``     arrival of the first byte of a message, FTI time
    ``t_dev_ns``    time that the device reports, in its own ``time_scale``; None when it reports none
    ``t_valid_ns``  time of validity of the quantity, FTI time; set by the navigation process, never by a decoder

Frames (a vector names its frame, ``vel_n``; a matrix names two, ``mat_nb`` takes b to n)
    e   earth-centred earth-fixed            i   inertial
    n   north, east, down at the point       l   local east, north, up (terrain and ray casting)
    b   body: forward, right, down           s   sensor: boresight along +z
    m   measurement: at the sensor, +z along one measured direction
    ``lat lon`` [rad], ``alt`` = height above the WGS84 ellipsoid; otherwise ``alt_msl``, ``alt_press``.
    ``roll`` right wing down, ``pitch`` nose up, ``heading`` clockwise from true north in [0, 2 pi).
    ``lever_arm_b`` leads from the reference point P of the aircraft to the sensor.
    A height names its datum (ELLIPSOID, MSL, PRESSURE, AGL) and its point (ANTENNA, P, WHEELS).
    ``accel_b`` is specific force.  ``_sd`` is one sigma.

Names
    ``P Q R H F K z`` in ``nav`` only.  ``innovation``, not residual, in filters.
    One verb each: ``decode`` / ``encode`` bytes, ``feed`` a decoder, ``step`` a filter, ``record``, ``replay``,
    ``serve``.

Rules
    Bytes first: a frame is stamped and buffered before it is decoded.  Decoders and filters are pure;
    only transports wait.  Live, HIL and replay are one program.  Every buffer is bounded and counts its losses.
"""
