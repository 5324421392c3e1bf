"""Three recordings of a table with a dead band that the declared model does not have, as CSV files and as bags."""

import laboratory
import numpy as np

import shake_ros as sr

TIME = np.arange(0.0, 1.5, laboratory.SAMPLE)


def multisine(amplitude, highest, seed):
    """A command of many frequencies with random phases, softly started [-]."""
    frequencies = np.arange(0.5, highest, 0.5)
    phases = np.random.default_rng(seed).uniform(0.0, 2 * np.pi, len(frequencies))
    waves = np.sin(2 * np.pi * np.outer(TIME, frequencies) + phases).sum(axis=1)
    return amplitude * waves / np.abs(waves).max() * np.minimum(TIME / 0.2, 1.0)


for seed, (amplitude, highest) in enumerate([(0.6, 8.0), (0.35, 10.0), (0.15, 12.0)], start=1):
    command = multisine(amplitude, highest, seed)
    noise = np.random.default_rng(seed).normal(size=(2, len(TIME)))
    position, acceleration = laboratory.measured(command, noise, dead_band=0.02)
    columns = np.column_stack([TIME, command, 1e3 * position, acceleration])
    np.savetxt(f"run{seed}.csv", columns, "%.9g", ",", header="t_s,u,x,a", comments="")
    named = {"time": "t_s", "command": "u", "position": "x*0.001", "acceleration": "a"}
    sr.import_csv(f"run{seed}.csv", f"run{seed}", **named)
print(sr.read("run1", "run2", "run3"))
