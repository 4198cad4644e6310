"""The dashboard: an agent that only looks on, and shows in a browser what the robot sees, learns and why.

The way of what it shows: topics are polled (`collector`) into what is kept, all of it bounded (`sights`, `past`,
`ground`, `scene`); the learner is asked for more while somebody watches (`questions`); `diagnosis` says what keeps it
from learning; `server` hands each browser the newest, when that browser is ready for it. The page is in `page/`.
"""
