"""From the residual between a model and a measured record to the physical effect that the model lacks."""
