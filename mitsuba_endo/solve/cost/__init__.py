"""What is minimised: the robust cost, its derivatives and its normal equations."""
