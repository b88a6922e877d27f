"""Alarms: each stays in a list until its condition has ended and a person has acknowledged it.

``condition`` defines conditions, which navigation and the supervisor report.  ``alarm_list`` holds an alarm for each,
from its begin until it has ended and was acknowledged.  Pure functions of reported times.
Source: docs/alarms.md.
"""
