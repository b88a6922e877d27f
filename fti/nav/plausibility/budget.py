"""Budget of false refusals: 1e-3 per hour for all tests of one source together.

Independent decisions per hour: a window of w seconds counts as 4 independent ones in w, on three axes.

    test         decisions per hour           level        false refusals per hour
    jump         3 axes x 45,000 (12.5 Hz)    6.0 sigma    2.7e-4
    drift        3 axes x 4 x 3600 / w, five  5.5 sigma    3.3e-4
                 windows w: 8,640
    scatter      3 axes x 360 (every 10 s)    1e-8         1.1e-5
    ranges       residuals and position, each  1e-8 and     1.0e-4
                 360 (every 10 s)              2.7e-7
    repeated     3 steps and 5.5 sigma of the noise without a change of digit, in 3 fixes: below 1e-7
    impossible   limits of the aircraft plus 5.5 sigma: below jump
    undulation   a constant of the position: no random part
    time         5 messages in a row against a clock: no random part
    attitude     5.5 sigma of the difference plus 1 deg for 2 s: below 1e-5

Measured by ``python -m tests.nav.false_refusals``; the decision record has the results.
"""

from __future__ import annotations

#: Sigmas that a contradiction must exceed: in general, and from fix to fix, the most frequent test.
K_FALSE = 5.5
K_JUMP = 6.0
#: Sigmas within which a step back cancels a contradiction.
K_CLOSURE = 4.2
#: Probability of one false decision of the scatter test.
P_SCATTER = 1e-8
