"""Five lines: recordings in, the repaired table out."""

import shake_ros as sr

runs = sr.read("run1", "run3")  # recordings, or a CSV file with its columns
model = sr.model("full", table="bergamo")  # the declared model, or your own YAML file
found = sr.close_loop(model, estimation=runs, validation=sr.read("run2"))
found.report("out/loop")  # report.html, report.json, and table.yaml with what was missing
print(found)
