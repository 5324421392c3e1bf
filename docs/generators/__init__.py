"""Pages of the manual that are made from the code each time it is built: see `python -m docs.generators`."""
