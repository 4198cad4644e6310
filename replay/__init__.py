"""What is remembered: poses, targets, the label rule, the trajectory store, the replay buffer, recordings.

The ground floor. Nothing here knows of a network, a message bus or a clock: plain classes over numpy arrays, fed with
sensor time, so that the same code runs live and, deterministically, over recordings.
"""
