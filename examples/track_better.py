"""What the repaired table is worth: the same loop with the declared and with the repaired table as its model."""

import shake_ros as sr

real = sr.model("full", table="out/loop/table.yaml").table  # as close_the_loop.py has found it
for name, carried in (("declared", sr.model("full").table), ("repaired", real)):
    run = sr.simulate(
        real,
        "sine_20mm_2hz",
        controller="super_twisting_model",
        observer="model_sliding_mode",
        model=carried,
        delay=1,
    )
    print(f"{name} table as the model")
    print(run.error)
