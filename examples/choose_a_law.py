"""The same table with another published law for its oil: copy the YAML file, change one section."""

from pathlib import Path

import numpy as np
import yaml

import shake_ros as sr
from shake_ros.settings import config_folder

table = yaml.safe_load((config_folder() / "table" / "bergamo.yaml").read_text())
time = np.arange(0.0, 2.0, 1e-3)
for law in ("lee", "hoffmann"):
    table["bulk_modulus"] = yaml.safe_load((config_folder() / "bulk_modulus" / f"{law}.yaml").read_text())
    Path("my_table.yaml").write_text(yaml.safe_dump(table))
    run = sr.simulate("my_table.yaml", 0.2 * np.sin(2 * np.pi * 5.0 * time))
    print(f"{law}: THD {100 * run.thd(harmonics=9).thd:.1f} %")
