"""What learns: network, masked loss, learner thread, predictor, odometry, drift, metrics, figures, configuration.

The middle floor. It imports `replay` below it, and nothing of `agents` above it.
"""
