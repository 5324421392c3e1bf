"""Fit the declared model, and see what it cannot explain."""

import shake_ros as sr

model = sr.model("full")  # or table="my_table.yaml", set={"specimen_mass": 200.0}
fitted = sr.identify(model, estimation=sr.read("run1", "run3"), validation=sr.read("run2"))
print(fitted)
fitted.plot().savefig("identified.png")
fitted.report("out/identified", force=True)
