"""Every output that the configuration promises: is it there, at its rate, and right?

row.py           one check of one output and its verdict
presence.py      rate, gaps, order and times of a topic
availability.py  is it valid where it must be?
errors.py        errors of each quantity against the ground truth
accuracy.py      does an error fit its limit and its sigma?
consistency.py   fields of one message that must agree with each other
pairs.py         outputs that belong together
protection.py    error of the navigated altitude beside what the monitor says of it
measured.py      decoded numbers beside what devices meant to state
recorded_links.py  bytes on each link beside what was sent
check.py         all of them for one flight
"""
