"""Recordings and accelerograms → arrays with units and provenance; results → files."""
