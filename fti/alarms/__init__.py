"""Alarms: each stays in a list until its condition has ended and a person has acknowledged it.

``condition`` says what can be wrong; navigation and the supervisor find conditions.  ``alarm_list`` keeps an alarm for
each, from its begin until it has ended and was acknowledged.  Pure: times come from outside.
Source: docs/alarms.md.
"""
