"""`llrp experiment`: studies that anyone repeats with one command.

A study names its trials, and makes figures and claims of their results. A trial is a pure function of its parameters,
seed included, and gives JSON; so trials may run in any order, in any process, on any machine, be kept, and be skipped
when a study that was killed goes on.
"""
