"""What the daemon said of a flight against what its scenario expected.

flown.py    from the truth file: when the flight began, what was true, when the bench was late
said.py     from the session: words, and from when until when they stood
promised.py by which configuration: the emulator's, and how the recorded one differs
judging.py  the comparison, of flags that are due (flag_rows.py), of others (unexpected_flags.py), of ``[[expect]]``
            (expectations.py); what comes of it stands in rows.py
outcome.py  holds, failed or not proved, and how much the bench excused; unit_findings.py  what is asked of every flight
results.py  all of it as a flat list  report.py  as text and JSON  junit.py  for Jenkins, GitLab  picture.py  over time
"""
