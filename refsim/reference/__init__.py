"""The same mathematics in plain NumPy, generic in the float type: float32 for the kernels' bits, float64 for bounds."""
