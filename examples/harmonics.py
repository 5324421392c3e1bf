"""How much the oil distorts a sine: harmonics of the acceleration without and with the thesis's soft zone."""

import numpy as np

import shake_ros as sr

time = np.arange(0.0, 3.0, 1e-3)
command = 0.2 * np.sin(2 * np.pi * 5.0 * time)
for depth in (0.0, 0.84):
    model = sr.model("full", set={"effects.soft_zone.depth": depth})
    found = sr.simulate(model, command).thd(harmonics=9)
    print(f"soft zone of depth {depth}: THD {100 * found.thd:.1f} %")
