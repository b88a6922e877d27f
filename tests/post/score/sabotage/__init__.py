"""An attacker for the score: a recorded session, falsified in one way, must not hold.

``session_copy`` reads a session and writes it again as an honest writer would; ``message_edits`` changes what its
messages say; ``catalogue`` lists the falsifications, each with the reason why the score must detect it; ``campaign``
applies them.  ``python -m tests.post.score.sabotage --scenario nominal`` prints what the score detects.
"""
