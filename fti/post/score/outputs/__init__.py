"""Checks of every output that the configuration requires: present, at its rate, and correct.

row.py           one check of one output and its result
presence.py      rate, gaps, order and times of a topic
availability.py  validity where it is required
errors.py        errors of each quantity against the ground truth
accuracy.py      errors against limits and sigmas
consistency.py   fields of one message that must agree with each other
pairs.py         outputs that belong together
protection.py    errors against protection levels
value_check.py   decoded numbers against the intended values of devices
recorded_links.py  recorded bytes on each link against the sent ones
check.py         all of them for one flight
"""
