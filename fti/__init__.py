"""``fti``: a flight-test data service.  This page holds the conventions; no other page repeats them.

Flow
    device -> link -> RawFrame -> triple buffer -> MCAP (raw)                 recorder process, bytes only
                         \\-> ring -> decoder -> Measurement -> nav -> outputs -> MCAP (derived), bus
    hil: trajectory -> sensor models -> faults -> encoder -> pty, CAN, UDP -> the same links

Units
    SI and radians everywhere inside.  No suffix means SI or radian; anything else carries its unit
    (``_deg _ft _kt _ns _ms _hz``) and lives at the edge: configuration, command line, display, wire.
    Unknown is ``None`` or an enum member, never a number that could be a value.

Time
    ``int`` nanoseconds.  FTI time = CLOCK_MONOTONIC + session epoch (real time at the start rounded to 20 ms,
    written once; it may be wrong and never changes).  Only ``fti.clock`` reads clocks.
    ``t_rx_ns``     arrival of the first byte of a message, FTI time
    ``t_dev_ns``    what the device said, in its own ``time_scale``; None when it said nothing
    ``t_valid_ns``  when the quantity was true, FTI time; the navigation process fills it, a decoder never

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
    Bytes first: a frame is stamped and buffered before anyone understands it.  Decoders and filters are pure;
    only transports wait.  Live, HIL and replay are one program.  Every buffer is bounded and says what it lost.
"""
