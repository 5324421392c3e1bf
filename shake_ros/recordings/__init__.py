"""Recordings, tables and accelerograms → arrays with units and provenance."""
