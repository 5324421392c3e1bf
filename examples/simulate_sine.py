"""Simulate the declared table under a sine of its valve command."""

import numpy as np

import shake_ros as sr

time = np.arange(0.0, 3.0, 1e-3)  # [s]
run = sr.simulate("bergamo", 0.3 * np.sin(2 * np.pi * 2.0 * time))
print(run)
print(f"stroke {1e3 * np.ptp(run.position):.1f} mm, up to {np.abs(run.acceleration).max():.2f} m/s²")
run.plot().savefig("sine.png")
run.write("sine", overwrite=True)  # a recording that `./shake thd sine`, PlotJuggler and Foxglove open
