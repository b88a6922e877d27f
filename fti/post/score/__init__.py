"""Score of a recorded flight: the session of the daemon against the expectations of its scenario.

truth_reader.py     from the truth file: begin of the flight, ground truth, times at which the bench was late
observed_flags.py   from the session (messages.py): flags and their intervals
reference_setup.py  the configuration of the emulator, and how the recorded one differs
comparison.py       the score: expected flags (flag_rows.py), other flags (unexpected_flags.py), ``[[expect]]``;
                    rows.py has the rows
outcome.py          holds, failed or inconclusive; unit_findings.py  checks of every flight
results.py          all rows as a flat list; report.py  text and JSON; junit.py  JUnit XML; plot.py  over time
"""
