"""The probability of overturning when rock and shaking are known within priors."""
