"""What the residuals say about the model: pure functions of residual images.

Residuals (H, W, 2) are whitened, so that a right model leaves noise of one variance, independent
from pixel to pixel; weights (H, W) are those of the robust loss in [0, 1]. NaN is missing.
"""
