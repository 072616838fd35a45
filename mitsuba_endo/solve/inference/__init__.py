"""What can be said of a result: covariance, observability, alternative solutions, consistency."""
