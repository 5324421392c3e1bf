"""The Python face: every public name of shake_ros with its own docstring."""

from __future__ import annotations

import shake_ros

HEAD = """# Python

```python
import shake_ros as sr
```

Every name below is imported when it is first used; none but `sr.demo` needs ROS. Each example runs in the test suite.
Wrong input raises `ShakeError`, a `ValueError` whose message is one line that says what and where.

## Verbs

| name | does |
|---|---|
"""


def first_line(name: str) -> str:
    """What the docstring begins with."""
    return (getattr(shake_ros, name).__doc__ or "").strip().splitlines()[0]


def directive(kind: str, name: str) -> str:
    """The directive that takes in a name's docstring."""
    options = "   :members:\n   :exclude-members: __init__\n" if kind == "autoclass" else ""
    return f"```{{eval-rst}}\n.. {kind}:: {shake_ros.PUBLIC[name]}.{name}\n{options}```\n"


def pages() -> dict[str, str]:
    """One page: functions first, then what they return."""
    verbs = sorted(name for name in shake_ros.PUBLIC if name[0].islower())
    results = sorted(name for name in shake_ros.PUBLIC if name[0].isupper())
    rows = "\n".join(f"| `sr.{name}` | {first_line(name)} |" for name in verbs)
    text = [HEAD + rows, "", *(f"### `sr.{name}`\n\n{directive('autofunction', name)}" for name in verbs)]
    text += ["## Results", "", *(f"### `{name}`\n\n{directive('autoclass', name)}" for name in results)]
    return {"python.md": "\n".join(text)}
